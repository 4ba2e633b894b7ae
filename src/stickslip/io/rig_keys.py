"""What a rig file may hold: every key once, with its meaning, its unit, an example, and how to measure it.

The reader, the writer, the messages and the reference page are made from these tables. A key that is a field of a
record takes unit, bounds, choices and default from there; which keys exclude each other is said by the rules.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from functools import cache
from types import NoneType
from typing import Any, Literal, get_args, get_origin

from stickslip.errors import InputError
from stickslip.io.keys import Either, Key, Sign, quantity
from stickslip.model import Chain, Interface, Prestressed, Sheet, Slider
from stickslip.model.activation import ACTIVATIONS, Bell
from stickslip.model.ageing import AGEING_MODELS
from stickslip.model.body import BODIES
from stickslip.model.delays import DELAYS
from stickslip.model.distributions import DISTRIBUTIONS, Empirical
from stickslip.model.drive import Piece
from stickslip.model.methods import METHODS
from stickslip.model.records import declared
from stickslip.model.units import si_unit

# ---------------------------------------------------------------------------------------------------------------------
# Keys of records
# ---------------------------------------------------------------------------------------------------------------------

Said = Key | tuple[str, Any] | tuple[str, Any, str]
"""A key, or of a field of a record the meaning, an example, and what is taken if it is left out."""


def _key(record: type, name: str, meaning: str, example: Any, otherwise: str = "") -> Key:
    """The key of a field of a record: unit, bounds, choices and default are those of the field."""
    kind, mark = declared(record)[name]
    given = next(field.default for field in fields(record) if field.name == name)
    endless = given in (float("inf"), float("-inf"))
    default = None if given is MISSING or endless else given
    if record in DISTRIBUTIONS.values() and default is None and not endless:
        default = _USUAL.get(name)
    if endless:
        otherwise = "none are"
    sign: Sign = "" if mark is None else "above 0" if mark.above == 0 else "at least 0" if mark.at_least == 0 else ""
    unit = "" if mark is None or mark.unit == "1" else mark.unit
    if unit and not isinstance(example, (str, list)):
        example = "2 ms" if unit == "time" else f"2 {si_unit(unit)}"
    kinds = (kind, *get_args(kind))
    return Key(
        meaning,
        example,
        unit=unit,
        sign=sign,
        choices=next((get_args(each) for each in kinds if get_origin(each) is Literal), ()),
        default=default,
        required=default is None and given is MISSING and not otherwise,
        otherwise=otherwise,
    )


def _table(record: type, rules: tuple[Either, ...] = (), **said: Said) -> dict[str, Key]:
    """The keys of a table that is made into a record; the rules say what is given in place of a key."""
    found: dict[str, Key] = {}
    for name, each in said.items():
        key = found[name] = each if isinstance(each, Key) else _key(record, name, *each)
        others = " or ".join(rule.others(name) for rule in rules if rule.others(name) and not rule.because)
        if others and key.default is None:
            found[name] = replace(key, required=False, otherwise=key.otherwise or others)
    return found


NO_DELAY = (
    "hold the rig at rest for longer and longer, or slide it at several speeds: without delay and ageing contacts "
    "never strengthen with rest and nothing can stick-slip; the speed at which the kinetic friction has fallen to half "
    "its value in slow sliding is v_half"
)

# ---------------------------------------------------------------------------------------------------------------------
# Tables of a file
# ---------------------------------------------------------------------------------------------------------------------

_NO_SLIDER = "In place of `slider`: a {} of blocks, {}each on contacts of its own."
_NATURAL = (
    "The system of units. `natural`: plain numbers; the mean threshold force, stiffness and breaking displacement of a "
    "contact are 1, and mass and stiffness are per contact."
)

TOP: Mapping[str, Key] = {
    "name": Key("What to call the rig.", "Brake pad", default="rig", longest=200),
    "units": Key(_NATURAL, "SI", choices=("SI", "natural"), default="SI"),
    "slider": Key("The slider and its driving spring.", {"mass": "75.6 g"}, otherwise="`chain` or `sheet`"),
    "chain": Key(_NO_SLIDER.format("bar", ""), {"blocks": 57}, otherwise="`slider`"),
    "sheet": Key(_NO_SLIDER.format("plate", "seen from above, "), {"along": 60, "across": 20}, otherwise="`slider`"),
    "interface": Key("The contacts between slider and base.", {"contact_strength": "768 N"}, required=True),
    "drive": Key("How the far end of the driving spring moves.", {"velocity": "0.4 mm/s"}, required=True),
    "simulation": Key("How the rig is simulated.", {"contacts": 2000}, otherwise="all its defaults"),
    "feasible": Key(
        "What could be built or set otherwise: for parameters by name, the lowest and the highest value. Mitigations "
        "are looked for inside.",
        {"stiffness": ["1 MN/m", "10 MN/m"]},
        otherwise="a factor 30 either way",
    ),
    "assumed": Key(
        "What was not measured: the path of a key, and how to measure it.",
        {"interface.delay": "measure the steady force at several speeds"},
        otherwise="defaults that were taken are still listed",
    ),
    "fitted": Key(
        "What was fitted to a trace: the path of a key; its interval, what the trace says of it, and draws in SI.",
        {"interface.thresholds.std": {"interval": "0.1 to 0.4", "how": "weak", "draws": [0.1, 0.2, 0.4]}},
        otherwise="nothing was fitted",
    ),
    "source": Key("Where the numbers come from.", "Tromborg et al. 2014, Table S1", default=""),
}
"""Keys at the top of the file."""

MATERIAL: Mapping[str, Mapping[str, str]] = {
    "chain": {"coupling": "youngs_modulus", "leaf": "shear_modulus", "mass": "density"},
    "sheet": {"coupling": "youngs_modulus", "shear": "shear_modulus", "mass": "density"},
}
"""Of an elastic body: what is given directly, or follows from its shape and a property of the material."""

SHAPE = ("spacing", "width", "height")
"""Keys of the shape of a block."""

COEFFICIENTS = ("mu_s", "mu_k")


def _either(one: str, *others: str, needed: bool = False, because: str = "", natural: int = 0) -> Either:
    return Either(((one,), others), needed=needed, because=because, natural=natural)


RULES: Mapping[str, tuple[Either, ...]] = {
    "slider": (_either("damping_ratio", "damping", needed=True),),
    **{
        body: tuple(_either(m, direct, needed=direct != "leaf", natural=1) for direct, m in material.items())
        for body, material in MATERIAL.items()
    },
    "interface": (
        _either("thresholds", *COEFFICIENTS, needed=True, because="they say how wide the thresholds are"),
        _either("delay", "v_half"),
        _either("newborn", *COEFFICIENTS, because="these are read as of unstretched newborns"),
        _either("areas", *COEFFICIENTS, because="these are read as of equal contacts"),
        _either("areas", "v_half", because="it is read as of equal contacts"),
    ),
    "drive": (
        _either("velocity", "pieces", needed=True),
        _either("distance", "duration"),
        _either("distance", "pieces", because="pieces have durations of their own"),
        _either("duration", "pieces", because="pieces have durations of their own"),
    ),
}
"""Keys of a table that exclude each other."""

STRENGTH = _either("contact_strength", "normal_load", *COEFFICIENTS, needed=True)
"""The scale of force, in an SI file."""

SLIDER = _table(
    Slider,
    RULES["slider"],
    mass=("Mass of the slider and of all that moves with it.", "75.6 g"),
    stiffness=("Stiffness of the driving spring: of whatever connects the slider to what pulls.", "4 MN/m"),
    damping=("Damping `eta` of Eq. (11): off the surface, the slider's ringing decays as `exp(-eta t/2)`.", "200 1/s"),
    damping_ratio=Key(
        "In place of `damping`: the damping ratio `zeta = eta/(2 Omega)` of the slider on its spring, "
        "`Omega = sqrt(stiffness/mass)`; 1 is critical.",
        0.15,
        sign="at least 0",
    ),
)

_COUPLING = "Young's modulus `E`: neighbours along the drive are coupled by springs of `E B H/dx`."
_TOP = (
    "Shear modulus `G` of a bar that is held and moved along its top: the drive pulls each block by a spring of `{}`."
)
_ROWS = "Shear modulus `G`: neighbouring rows are coupled by springs of `G H dx/B` from block to block."
_SECTION: Mapping[str, Said] = {
    "spacing": ("Length `dx` of a block along the drive.", "2.5 mm", "`coupling`"),
    "width": quantity("Width `B` of the bar, or of a row of the sheet.", "5 mm", otherwise="`coupling`"),
    "height": quantity("Height `H` of the bar, or thickness of the sheet.", "77.5 mm", otherwise="`coupling`"),
    "youngs_modulus": quantity(_COUPLING, "3 GPa"),
    "density": quantity("Density `rho`: a block has the mass `rho B H dx`.", "1180 kg/m^3"),
}
_DASHPOT = "Dashpot between neighbours along the drive; between rows in proportion to their stiffness."
_SPRINGS: Mapping[str, Said] = {
    "coupling": ("In place of `youngs_modulus`: stiffness between neighbours along the drive.", "540 MN/m"),
    "mass": ("In place of `density`: mass of a block.", "1.1 g"),
    "leaf": ("Stiffness of a spring from each block to the drive.", "0.2 MN/m"),
    "side": ("Stiffness of a spring from the first block (of a sheet, of every row) to the drive.", "4 MN/m"),
    "damping": quantity("Damping `eta` of each block against the ground.", "100 1/s", "at least 0", default=0.0),
    "viscosity": (_DASHPOT, "10 kg/s"),
    "ends": ("Whether opposite ends are coupled.", "free"),
}

CHAIN = _table(
    Chain,
    RULES["chain"],
    blocks=("Number of blocks that the bar is cut into.", 57),
    **_SECTION,
    shear_modulus=quantity(_TOP.format("G B dx/H"), "1.1 GPa"),
    **_SPRINGS,
)

SHEET = _table(
    Sheet,
    RULES["sheet"],
    along=("Number of blocks along the drive.", 60),
    across=("Number of rows beside each other.", 20),
    **_SECTION,
    shear_modulus=quantity(_ROWS, "1.1 GPa"),
    shear=("In place of `shear_modulus`: stiffness between neighbouring rows, from block to block.", "200 MN/m"),
    **_SPRINGS,
)

INTERFACE = _table(
    Interface,
    (STRENGTH, *RULES["interface"]),
    contact_strength=quantity(
        "Sum of the threshold forces of all contacts, `N f_s`. The static friction is smaller, as contacts do not "
        "break all at once.",
        "768 N",
    ),
    normal_load=quantity("With `mu_s` and `mu_k`: the force that presses the slider on.", "1920 N"),
    mu_s=Key(
        "With `normal_load` and `mu_k`: coefficient of static friction, the largest force of a slow pull over the "
        "load.",
        0.32,
        sign="above 0",
    ),
    mu_k=Key(
        "With `normal_load` and `mu_s`: coefficient of kinetic friction in slow sliding. The two give the contact "
        "strength and the standard deviation of Gaussian thresholds.",
        0.2,
        sign="above 0",
    ),
    breaking_displacement=quantity(
        "Mean displacement `x_s` at which a contact breaks; close to static friction over the slope of the force at "
        "the start of a slow pull.",
        "2 um",
    ),
    thresholds=Key(
        "Distribution of the displacements at which contacts break, in units of `breaking_displacement`.",
        {"distribution": "gaussian", "std": 0.1},
        otherwise="with `mu_s` and `mu_k`: Gaussian, of the standard deviation that they ask for",
    ),
    initial=Key(
        "Distribution of the stretchings of the contacts at the start, in the same unit.",
        {"distribution": "gaussian", "mean": 0.0, "std": 0.05},
        default={"distribution": "gaussian", "mean": 0.0, "std": 0.01},
        measure="repeat a slow pull after unloading and reloading: a rounder first peak means a wider distribution",
    ),
    delay=quantity(
        "Time until a broken contact is attached again: a time, a table for a random one, "
        '`"on arrest"` for contacts that wait until the slider stops, or `"never"`.',
        "2 ms",
        "at least 0",
        words=("never", "on arrest"),
        or_table=True,
        default=0.0,
        measure=NO_DELAY,
    ),
    v_half=quantity(
        "In place of `delay`: the speed at which the kinetic friction has halved; the delay is the mean breaking "
        "displacement over it.",
        "1 mm/s",
    ),
    sliding_force=(
        "Force of all contacts together, were they all detached and sliding; `contact_strength` is their strength "
        "attached.",
        "150 N",
    ),
    newborn=Key(
        "Distribution of the stretchings with which contacts re-attach, along the motion, in units of "
        "`breaking_displacement`.",
        {"distribution": "uniform", "low": 0.0, "high": 0.2},
        otherwise="they are unstretched",
    ),
    track_scatter=(
        "Scatter from slip to slip of all thresholds alike: standard deviation of the factor, of mean 1, that those "
        "drawn between two arrests of the slider have in common.",
        0.1,
    ),
    areas=(
        "Contacts of different areas, whose distribution `thresholds` then is: drawn afresh at each re-attachment, or "
        "one for each site. The threshold force goes with the area, the stiffness with its root.",
        "fresh",
        "all contacts are equally stiff",
    ),
    ageing=Key(
        "How the thresholds of contacts grow with their age.",
        {"model": "langevin", "time": "1 s"},
        otherwise="they do not",
    ),
    temperature=Key(
        "How contacts break before their threshold.",
        {"kind": "bell"}
        | {"temperature": "293 K", "activation_volume": "0.5 nm^3", "shear_strength": "1 GPa", "attempts": "1e12 1/s"},
        otherwise="they do not",
    ),
)

SCALES = ("contact_strength", "normal_load", *COEFFICIENTS, "breaking_displacement")
"""Keys that are 1 in natural units, or make up what is."""

DRIVE: Mapping[str, Key] = {
    "velocity": quantity(
        "Constant velocity of the drive; a list of all speeds at which the rig works, the one to simulate first; or a "
        'table `{ from = "1 mm/s", to = "50 mm/s" }` of their range, of which the middle is simulated.',
        "0.4 mm/s",
        "",
        or_list=True,
        or_table=True,
        otherwise="`pieces`",
    ),
    "distance": quantity(
        "How far the drive goes at this velocity.",
        "4 mm",
        otherwise="120 breaking displacements, by when most transients are over",
    ),
    "duration": quantity("In place of `distance`: for how long.", "10 s", otherwise="`distance`"),
    "pieces": Key(
        "In place of `velocity`: velocities that change linearly in time, piece after piece.",
        [{"start": "10 mm/s", "end": "1 m/s", "duration": "0.5 s"}],
        otherwise="`velocity`",
    ),
}

PIECE = _table(
    Piece,
    start=("Velocity at the beginning of the piece.", "10 mm/s"),
    end=("Velocity at its end.", "1 m/s"),
    duration=("How long the piece lasts.", "0.5 s"),
)

SIMULATION: Mapping[str, Key] = {
    "method": Key(
        "Every contact followed, many of them counted together, or the limit of infinitely many; of a chain, also in "
        "balance all the time.",
        "contacts",
        choices=tuple(METHODS),
        default="contacts",
    ),
    "contacts": Key(
        "Number of contacts, for all methods but `master equation`: 1 to 1e8, for `population` 1e9; of a chain or a "
        "sheet, of each block.",
        2000,
        otherwise="10,000; 100 for each block of a chain or a sheet",
    ),
    "seed": Key("Seed of the random numbers: the same seed gives the same run.", 1, default=1),
    "rtol": Key(
        "Error of the master equation, in total contact strengths: 1e-10 to 0.1; of a `population`, from 1e-6.",
        1e-5,
        default=1e-4,
    ),
    "start": Key(
        "The state that a run starts from: at rest with an unstretched spring, or in steady smooth sliding; or, for a "
        "chain or a sheet, a table: at rest on stretched contacts, with a push that sets it off.",
        "from rest",
        choices=("from rest", "sliding"),
        or_table=True,
        default="from rest",
    ),
    "interval": quantity(
        "Time between the samples of a run.",
        "0.5 ms",
        otherwise="a fraction of the run that resolves the slider's oscillation",
    ),
}

START = _table(
    Prestressed,
    stretching=Key(
        "Stretching of the contacts of each block, in units of `breaking_displacement`: one number, a list with one "
        "for each block, or a list of runs of blocks alike, `[{ blocks = 20, stretching = 0.7 }, { blocks = 37, "
        "stretching = 0.4 }]`.",
        0.7,
        or_list=True,
        required=True,
    ),
    push=("Constant force on each of the first blocks besides; of a sheet, of every row.", "40 N"),
    pushed_blocks=("How many blocks are pushed.", 3),
)
"""Keys of `simulation.start` as a table."""

TABLES: Mapping[str, Mapping[str, Key]] = {
    "slider": SLIDER,
    "chain": CHAIN,
    "sheet": SHEET,
    "interface": INTERFACE,
    "drive": DRIVE,
    "simulation": SIMULATION,
}

FITTED: Mapping[str, Key] = {
    "interval": Key("The 90 % interval.", "1 N to 2 N", required=True),
    "how": Key("What the trace says of it.", "identified", required=True, longest=400),
    "draws": Key("Equally likely values in SI units.", [1.0, 2.0], required=True),
}
"""Keys of each entry of `fitted`."""

RENAMED: Mapping[str, str] = {
    "slider.relative_damping": "is gone; write damping_ratio = eta/(2 Omega), half of what relative_damping was",
    "interface.friction_coefficient": (
        "is gone, as it was no measured coefficient; write mu_s and mu_k beside normal_load, "
        "or contact_strength = coefficient x normal_load"
    ),
    "simulation.cells": "is gone; write rtol, the error of the force, such as 1e-4",
}
"""Keys that were, and what to write now."""

# ---------------------------------------------------------------------------------------------------------------------
# Records that a table names: distributions, delays, ageing, temperature, methods
# ---------------------------------------------------------------------------------------------------------------------

_FIELDS: Mapping[str, tuple[str, Any]] = {
    "mean": ("Mean.", 1.0),
    "std": ("Standard deviation.", 0.1),
    "low": ("Smallest value.", 0.8),
    "high": ("Largest value.", 1.2),
    "scale": ("Scale: 63 % of the values are smaller.", 1.0),
    "shape": ("Shape: the larger, the narrower.", 8.0),
    "lower": ("Values below this one are cut off.", 0.0),
    "edges": ("In place of `samples`: rising edges of the bins of a histogram.", [0.5, 1.0, 1.5]),
    "weights": ("With `edges`: the weight of each bin.", [1.0, 2.0]),
    "thresholds": ("Thresholds of the contacts that slide.", {"distribution": "gaussian", "std": 0.1}),
    "time": ("Time in which the thresholds age.", "1 s"),
    "newborn": ("Threshold of a newborn contact, relative to the mean of `thresholds`.", 0.0),
    "width": ("Displacement over which the rate of breaking grows by a factor e.", "16 nm"),
    "attempts": ("Rate of breaking on top of the barrier.", "1e12 1/s"),
    "temperature": ("`k_B T` over the stiffness of a contact times the square of its breaking displacement.", 0.01),
    "height": ("Barrier of an unstretched contact over `k_B T`.", 100.0),
    "power": ("How the barrier falls with the stretching: 1, 1.5 or 2.", 1.5),
    "kramers": ("Whether the rate falls with the barrier's curvature, after Kramers.", False),
    "slope": ("Growth of the threshold per factor e in age, relative to the mean of `thresholds`.", 0.02),
    "negative": ("What becomes of a draw below 0: it is set to 0, drawn again, or its sign changed.", "clip"),
}
"""Meaning and example of the fields of records, by their names; other fields have them in the record's docstring."""

_USUAL = {"mean": 1.0, "scale": 1.0}
"""What is taken for the scale of a distribution that is left out: that of `breaking_displacement`."""

_BOLTZMANN = 1.380649e-23
"""In J/K."""


KINDS: Mapping[str, tuple[str, Mapping[str, type]]] = {
    **dict.fromkeys(("thresholds", "initial", "newborn"), ("distribution", DISTRIBUTIONS)),
    "delay": ("model", DELAYS),
    "ageing": ("model", AGEING_MODELS),
    "temperature": ("kind", ACTIVATIONS),
}
"""Of keys of `interface` whose value is a table: the word in it that names a record, and the records by name."""


@dataclass(frozen=True)
class Instead:
    """Keys that a file may give in place of fields of a record, and how these follow from them."""

    keys: Mapping[str, Key]
    fields: tuple[str, ...]
    made: Callable[..., tuple[Any, ...]]

    @property
    def rule(self) -> Either:
        """The keys or the fields."""
        return Either((tuple(self.keys), self.fields), natural=1)


def _histogram(samples: tuple[float, ...]) -> tuple[Any, ...]:
    made = Empirical.from_samples(samples)
    return made.edges, made.weights


_VOLUME = "Area that a contact gives way at a time, times how far: some molecules."

INSTEAD: Mapping[type, Instead] = {
    Empirical: Instead(
        {"samples": Key("Measured values, from which a histogram is made.", [0.9, 1.0, 1.3])},
        ("edges", "weights"),
        _histogram,
    ),
    Bell: Instead(
        {
            "temperature": Key("Temperature of the interface.", "293 K", si="K", sign="above 0"),
            "activation_volume": Key(_VOLUME, "0.5 nm^3", si="m^3", sign="above 0"),
            "shear_strength": Key("Shear strength of the contacts themselves.", "1 GPa", si="Pa", sign="above 0"),
        },
        ("width",),
        lambda temperature, volume, strength: (_BOLTZMANN * temperature / (strength * volume),),
    ),
}


@cache
def keys_of(record: type) -> Mapping[str, Key]:
    """Keys of the table that makes a record that a table names.

    Raises `InputError` if a delay of the user's own has a number without a unit: a file could not say what it means.
    """
    instead = INSTEAD.get(record)
    said: dict[str, Said] = dict(instead.keys) if instead else {}
    made = {field.name for field in fields(record) if field.init}
    for name, (kind, mark) in declared(record).items():
        if name not in made:
            continue
        if record in DELAYS.values() and mark is None and kind is float:
            raise InputError(
                f"{record.__name__}.{name}: has no unit, so no file can give it; declare it as "
                "Annotated[float, Number('time')], or of another unit"
            )
        if name == "rate" and by_time(record):
            said["time"] = Key("Time in which the thresholds age.", "1 s", unit="time", sign="above 0", required=True)
        else:
            said[name] = _FIELDS.get(name) or _documented(record, name, kind)
    return _table(record, (instead.rule,) if instead else (), **said)


def _documented(record: type, name: str, kind: Any) -> tuple[str, Any]:
    """What the docstring of a record says of a field, and an example of its type."""
    found = re.search(rf"^ *{name} ?:.*\n((?: {{8,}}.*\n?)+)", record.__doc__ or "", re.MULTILINE)
    meaning = " ".join(found[1].split()) if found else ""
    kinds = [one for one in get_args(kind) if one is not NoneType] if get_origin(kind) is not Literal else [str]
    plain = kind if isinstance(kind, type) else (kinds or [float])[0]
    return meaning, {int: 1, str: "text"}.get(plain, 1.0)


def by_time(record: type) -> bool:
    """Whether a model of ageing has a rate, which a file gives as a time."""
    return "rate" in declared(record) and hasattr(record, "with_time")


def fields_of_method(kind: type) -> dict[str, str]:
    """Fields of a method that a file gives, each with its key in `simulation`."""
    names = [field.name for field in fields(kind) if field.name != "memoryless"]  # for comparison only
    return {name: "contacts" if name == "count" else name for name in names}


def keys_of_simulation(method: object) -> dict[str, Key]:
    """Keys of `simulation`: those of a method of the user's own besides."""
    kind = METHODS.get(method) if isinstance(method, str) else None
    own = keys_of(kind) if kind else {}
    besides = {key: own[name] for name, key in fields_of_method(kind).items() if key not in SIMULATION} if kind else {}
    return {**SIMULATION, **besides, "method": replace(SIMULATION["method"], choices=tuple(METHODS))}


def methods_with(key: str) -> list[str]:
    """Names of the methods that have a key of `simulation`."""
    return [name for name, kind in METHODS.items() if key in fields_of_method(kind).values()]


def tables() -> dict[str, Mapping[str, Key]]:
    """The tables of a file by their names, those of bodies of the user's own besides."""
    return {name: keys_of(kind) for name, kind in BODIES.items()} | dict(TABLES)


def keys_at_the_top() -> dict[str, Key]:
    """The keys at the top of a file."""
    bodies = {name: Key("In place of `slider`.", {}, otherwise="`slider`") for name in BODIES}
    return bodies | dict(TOP)


def key_at(path: str, document: Mapping[str, Any]) -> Key | None:
    """The key at a path of a document; None if it is in a table that cannot be read."""
    table, name, *below = path.split(".")
    key = tables()[table].get(name)
    content = document.get(table, {}).get(name)
    if not below or name not in KINDS:
        return key
    word, kinds = KINDS[name]
    kind = kinds.get(content.get(word, "random")) if isinstance(content, Mapping) else None
    return keys_of(kind).get(below[0]) if kind else None


def is_path(path: str) -> bool:
    """Whether a path such as ``"interface.delay"`` names a key of a rig file."""
    table, _, rest = path.partition(".")
    return path in ("name", "units") or rest.partition(".")[0] in tables().get(table, {})
