"""What a rig file may hold: every key once, by an example; its unit, sign, choices and default.

The reader, the writer, the messages and the reference page (with the words of docs/reference/rig-keys.toml) are made
from these tables. A key that is a field of a record takes unit, bounds, choices and default from there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from functools import cache
from typing import Any

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
from stickslip.model.records import Number, choices_of, declared
from stickslip.model.units import si_unit

# ---------------------------------------------------------------------------------------------------------------------
# Keys that exclude each other
# ---------------------------------------------------------------------------------------------------------------------

MATERIAL: Mapping[str, Mapping[str, str]] = {
    "chain": {"coupling": "youngs_modulus", "leaf": "shear_modulus", "mass": "density"},
    "sheet": {"coupling": "youngs_modulus", "shear": "shear_modulus", "mass": "density"},
}
"""Of an elastic body: what is given directly, or follows from its shape and a property of the material."""
SHAPE = ("spacing", "width", "height")
COEFFICIENTS = ("mu_s", "mu_k")
SCALES = ("contact_strength", "normal_load", *COEFFICIENTS, "breaking_displacement")
"""Keys that are 1 in natural units, or make up what is."""


def _either(one: str, *others: str, needed: bool = False, because: str = "") -> Either:
    return Either(((one,), others), needed=needed, because=because)


_OF_THEIR_OWN = "pieces have durations of their own"
RULES: Mapping[str, tuple[Either, ...]] = {
    "slider": (_either("damping_ratio", "damping", needed=True),),
    **{
        body: tuple(_either(m, direct, needed=direct != "leaf") for direct, m in material.items())
        for body, material in MATERIAL.items()
    },
    "interface": (
        _either("contact_strength", "normal_load", *COEFFICIENTS, needed=True),
        _either("thresholds", *COEFFICIENTS, needed=True, because="they say how wide the thresholds are"),
        _either("delay", "v_half"),
        _either("newborn", *COEFFICIENTS, because="these are read as of unstretched newborns"),
        _either("areas", *COEFFICIENTS, because="these are read as of equal contacts"),
        _either("areas", "v_half", because="it is read as of equal contacts"),
    ),
    "drive": (
        _either("velocity", "pieces", needed=True),
        _either("distance", "duration"),
        _either("distance", "pieces", because=_OF_THEIR_OWN),
        _either("duration", "pieces", because=_OF_THEIR_OWN),
    ),
}

# ---------------------------------------------------------------------------------------------------------------------
# Tables of a file
# ---------------------------------------------------------------------------------------------------------------------


def _of(record: type, rules: tuple[Either, ...] = (), **examples: Any) -> dict[str, Key]:
    """The keys of a table that is made into a record: fields of it, each with an example, and keys that are none."""
    excluded = {name for rule in rules for way in rule.ways for name in way}
    keys = {name: each if isinstance(each, Key) else _key(record, name, each) for name, each in examples.items()}
    return {name: replace(key, required=key.required and name not in excluded) for name, key in keys.items()}


def _key(record: type, name: str, example: Any) -> Key:
    """The key of a field: unit, bounds, choices and default are those of the field."""
    kind, mark = declared(record)[name]
    bounds = mark if isinstance(mark, Number) else Number()
    given = next(field.default for field in fields(record) if field.name == name)
    default = _USUAL.get(name) if record in DISTRIBUTIONS.values() and given is MISSING else given
    sign: Sign = "above 0" if bounds.above == 0 else "at least 0" if bounds.at_least == 0 else ""
    unit = "" if bounds.unit == "1" else bounds.unit
    if unit and not isinstance(example, (str, list)):
        example = "2 ms" if unit == "time" else f"2 {si_unit(unit)}"
    return Key(
        example,
        unit=unit,
        sign=sign,
        choices=choices_of(kind),
        default=None if default is MISSING or default in (float("inf"), float("-inf")) else default,
        required=given is MISSING and default in (MISSING, None),
    )


TOP: Mapping[str, Key] = {
    "name": Key("Brake pad", default="rig", longest=200),
    "units": Key("SI", choices=("SI", "natural"), default="SI"),
    "slider": Key({"mass": "75.6 g"}),
    "chain": Key({"blocks": 57}),
    "sheet": Key({"along": 60, "across": 20}),
    "interface": Key({"contact_strength": "768 N"}, required=True),
    "drive": Key({"velocity": "0.4 mm/s"}, required=True),
    "simulation": Key({"contacts": 2000}),
    "feasible": Key({"stiffness": ["1 MN/m", "10 MN/m"]}),
    "assumed": Key({"interface.delay": "measure the steady force at several speeds"}),
    "fitted": Key({"interface.thresholds.std": {"interval": "0.1 to 0.4", "how": "weak", "draws": [0.1, 0.2, 0.4]}}),
    "source": Key("Tromborg et al. 2014, Table S1", default=""),
}
"""Keys at the top of the file."""

_SECTION = {
    "spacing": "2.5 mm",
    "width": quantity("5 mm"),
    "height": quantity("77.5 mm"),
    "youngs_modulus": quantity("3 GPa"),
    "density": quantity("1180 kg/m^3"),
    "shear_modulus": quantity("1.1 GPa"),
}
_SPRINGS = {
    "coupling": "540 MN/m",
    "mass": "1.1 g",
    "leaf": "0.2 MN/m",
    "side": "4 MN/m",
    "damping": quantity("100 1/s", "at least 0", default=0.0),
    "viscosity": "10 kg/s",
    "ends": "free",
}
_NO_DELAY = (
    "hold the rig at rest for longer and longer, or slide it at several speeds: without delay and ageing contacts "
    "never strengthen with rest and nothing can stick-slip; the speed at which the kinetic friction has fallen to half "
    "its value in slow sliding is v_half"
)
TABLES: Mapping[str, Mapping[str, Key]] = {
    "slider": _of(
        Slider,
        RULES["slider"],
        mass="75.6 g",
        stiffness="4 MN/m",
        damping="200 1/s",
        damping_ratio=Key(0.15, sign="at least 0"),
    ),
    "chain": _of(Chain, RULES["chain"], blocks=57, **_SECTION, **_SPRINGS),
    "sheet": _of(Sheet, RULES["sheet"], along=60, across=20, **_SECTION, shear="200 MN/m", **_SPRINGS),
    "interface": _of(
        Interface,
        contact_strength=quantity("768 N"),
        normal_load=quantity("1920 N"),
        mu_s=Key(0.32, sign="above 0"),
        mu_k=Key(0.2, sign="above 0"),
        breaking_displacement=quantity("2 um", required=True),
        thresholds=Key({"distribution": "gaussian", "std": 0.1}),
        initial=Key(
            {"distribution": "gaussian", "mean": 0.0, "std": 0.05},
            default={"distribution": "gaussian", "mean": 0.0, "std": 0.01},
            measure="repeat a slow pull after unloading and reloading: a rounder first peak means a wider distribution",
        ),
        delay=quantity(
            "2 ms", "at least 0", words=("never", "on arrest"), also=(Mapping,), default=0.0, measure=_NO_DELAY
        ),
        v_half=quantity("1 mm/s"),
        sliding_force="150 N",
        newborn=Key({"distribution": "uniform", "low": 0.0, "high": 0.2}),
        track_scatter=0.1,
        areas="fresh",
        ageing=Key({"model": "langevin", "time": "1 s"}),
        temperature=Key(
            {"kind": "bell", "temperature": "293 K", "activation_volume": "0.5 nm^3", "shear_strength": "1 GPa"}
            | {"attempts": "1e12 1/s"}
        ),
    ),
    "drive": {
        "velocity": quantity("0.4 mm/s", "", also=(list, Mapping)),
        "distance": quantity("4 mm"),
        "duration": quantity("10 s"),
        "pieces": Key([{"start": "10 mm/s", "end": "1 m/s", "duration": "0.5 s"}]),
    },
    "simulation": {
        "method": Key("contacts", choices=tuple(METHODS), default="contacts"),
        "contacts": Key(2000),
        "seed": Key(1, default=1),
        "rtol": Key(1e-5, default=1e-4),
        "start": Key("from rest", choices=("from rest", "sliding"), also=(Mapping,), default="from rest"),
        "interval": quantity("0.5 ms"),
    },
}
"""Keys of each table, by its name."""
PIECE = _of(Piece, start="10 mm/s", end="1 m/s", duration="0.5 s")
"""Keys of each of `drive.pieces`."""
START = _of(Prestressed, stretching=Key(0.7, also=(list,), required=True), push="40 N", pushed_blocks=3)
"""Keys of `simulation.start` as a table."""
RUN: Mapping[str, Key] = {"blocks": Key(20, required=True), "stretching": START["stretching"]}
"""Keys of each run of blocks alike in `simulation.start.stretching`."""
FITTED: Mapping[str, Key] = {
    "interval": Key("1 N to 2 N", required=True),
    "how": Key("identified", required=True, longest=400),
    "draws": Key([1.0, 2.0], required=True),
}
"""Keys of each entry of `fitted`."""


def tables() -> dict[str, Mapping[str, Key]]:
    """The tables of a file by their names, with bodies and methods of the user's own."""
    simulation = TABLES["simulation"]
    method = replace(simulation["method"], choices=tuple(METHODS))
    own = {name: keys_of(kind) for name, kind in BODIES.items()}
    return {**own, **TABLES, "simulation": {**simulation, "method": method}}


# ---------------------------------------------------------------------------------------------------------------------
# Records that a table names: distributions, delays, ageing, temperature; and methods
# ---------------------------------------------------------------------------------------------------------------------

KINDS: Mapping[str, tuple[str, Mapping[str, type]]] = {
    **dict.fromkeys(("thresholds", "initial", "newborn"), ("distribution", DISTRIBUTIONS)),
    "delay": ("model", DELAYS),
    "ageing": ("model", AGEING_MODELS),
    "temperature": ("kind", ACTIVATIONS),
}
"""Of keys of `interface` whose value is a table: the word in it that names a record, and the records by name."""
_EXAMPLES: Mapping[str, Any] = {
    "std": 0.1,
    "low": 0.8,
    "high": 1.2,
    "shape": 8.0,
    "lower": 0.0,
    "edges": [0.5, 1.0, 1.5],
    "weights": [1.0, 2.0],
    "thresholds": {"distribution": "gaussian", "std": 0.1},
    "newborn": 0.0,
    "time": "1 s",
    "width": "16 nm",
    "attempts": "1e12 1/s",
    "temperature": 0.01,
    "height": 100.0,
    "power": 1.5,
    "slope": 0.02,
    "negative": "clip",
}
"""Of fields of the records, by their names; other fields have one of their type."""
_USUAL = {"mean": 1.0, "scale": 1.0}
"""What is taken for the scale of a distribution that is left out: that of `breaking_displacement`."""
_BOLTZMANN = 1.380649e-23
"""In J/K."""


@dataclass(frozen=True)
class Instead:
    """Keys that a file may give in place of fields of a record, and how these follow from them."""

    keys: Mapping[str, Key]
    fields: tuple[str, ...]
    made: Callable[..., tuple[Any, ...]]  # of their values, and `length`, the breaking displacement

    @property
    def rule(self) -> Either:
        """The keys or the fields."""
        return Either((tuple(self.keys), self.fields))


def _histogram(samples: tuple[float, ...], *, length: float) -> tuple[Any, ...]:
    del length  # stretchings are relative to it
    made = Empirical.from_samples(samples)
    return made.edges, made.weights


INSTEAD: Mapping[type, Instead] = {
    Empirical: Instead({"samples": Key([0.9, 1.0, 1.3])}, ("edges", "weights"), _histogram),
    Bell: Instead(
        {
            "temperature": Key("293 K", si="K", sign="above 0"),
            "activation_volume": Key("0.5 nm^3", si="m^3", sign="above 0"),
            "shear_strength": Key("1 GPa", si="Pa", sign="above 0"),
        },
        ("width",),
        lambda temperature, volume, strength, length: (_BOLTZMANN * temperature / (strength * volume) * length,),
    ),
}


@cache
def keys_of(record: type) -> Mapping[str, Key]:
    """Keys of the table that makes a record that a table names.

    Raises `InputError` if a delay of the user's own has a number without a unit: a file could not say what it means.
    """
    instead = INSTEAD.get(record)
    examples: dict[str, Any] = dict(instead.keys) if instead else {}
    made = {field.name for field in fields(record) if field.init}
    for name, (kind, mark) in declared(record).items():
        if record in DELAYS.values() and name in made and mark is None and kind is float:
            raise InputError(
                f"{record.__name__}.{name}: has no unit, so no file can give it; declare it as "
                "Annotated[float, Number('time')], or of another unit"
            )
        if name == "rate" and by_time(record):
            examples["time"] = Key("1 s", unit="time", sign="above 0", required=True)
        elif name in made:
            of_type = (*choices_of(kind), {bool: False, int: 1, str: "text"}.get(kind, 1.0))
            examples[name] = _EXAMPLES.get(name, of_type[0])
    return _of(record, (instead.rule,) if instead else (), **examples)


def by_time(record: type) -> bool:
    """Whether a model of ageing has a rate, which a file gives as a time."""
    return "rate" in declared(record) and hasattr(record, "with_time")


def fields_of_method(kind: type) -> dict[str, str]:
    """Fields of a method that a file gives, each with its key in `simulation`."""
    names = [field.name for field in fields(kind) if field.name != "memoryless"]  # for comparison only
    return {name: "contacts" if name == "count" else name for name in names}


def methods_with(key: str) -> list[str]:
    """Names of the methods that have a key of `simulation`."""
    return [name for name, kind in METHODS.items() if key in fields_of_method(kind).values()]


def keys_of_simulation(method: object) -> tuple[dict[str, Key], dict[str, str]]:
    """Keys of `simulation` with a method, one of the user's own among them; and why it has not those of other ones."""
    usual, kind = dict(tables()["simulation"]), METHODS.get(method) if isinstance(method, str) else None
    if kind is None:
        return usual, {}
    of_methods = {name: words for name in usual if (words := " or ".join(map(repr, methods_with(name))))}
    own = {key: usual.get(key) or keys_of(kind)[name] for name, key in fields_of_method(kind).items()}
    others = {name: f"belongs to method = {words}; leave it out with {method!r}" for name, words in of_methods.items()}
    return {name: key for name, key in usual.items() if name not in of_methods} | own, others


def paths(given: Iterable[str]) -> list[str]:
    """Paths of keys, such as ``"interface.delay"``: those given, or their parents, and all others."""
    known = ["name", "units", *(f"{table}.{name}" for table, keys in tables().items() for name in keys)]
    return [*(path for path in given if ".".join(path.split(".")[:2]) in known), *known]
