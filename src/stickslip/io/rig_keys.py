"""The keys of a rig file, each with its unit, sign, choices and default.

Their examples are in every_key.toml, in the form of a rig file. A key that is a field
of a record takes unit, bounds, choices and default from there; any other has the unit
of its example, and is above 0. The reader, the writer, the messages and the reference
page (with the texts of docs/reference/rig-keys.toml) all use these keys.
"""

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from stickslip.errors import InputError
from stickslip.io.keys import Either, Key, Keys, natural_unit_of
from stickslip.model import Areas, Chain, Interface, Prestressed, Sheet, Slider
from stickslip.model.activation import ACTIVATIONS, Bell
from stickslip.model.ageing import AGEING_MODELS
from stickslip.model.body import BODIES
from stickslip.model.delays import DELAYS
from stickslip.model.distributions import DISTRIBUTIONS, Empirical
from stickslip.model.drive import ForcePiece, Piece
from stickslip.model.methods import METHODS
from stickslip.model.records import Number, choices_of, declared
from stickslip.model.structure import ControlledAxis, Matrices, StateSpace
from stickslip.model.units import si_unit

MATERIAL: Mapping[str, Mapping[str, str]] = {
    "chain": {"coupling": "youngs_modulus", "leaf": "shear_modulus", "mass": "density"},
    "sheet": {
        "coupling": "youngs_modulus",
        "shear": "shear_modulus",
        "mass": "density",
    },
}
"""Fields of an elastic body that are given directly, or follow from its shape and this
property of the material.
"""
SHAPE = ("spacing", "width", "height")
SCALES = ("contact_strength", "normal_load", "mu_s", "mu_k", "breaking_displacement")
"""Keys that define the natural units, in which they have no value."""

RULES: Mapping[str, tuple[Either, ...]] = {
    "slider": (Either("damping_ratio", "damping", needed=True),),
    "modes": (
        Either("frequency", "stiffness", needed=True),
        Either("damping_ratio", "damping", needed=True),
    ),
    "controller": (
        Either("kp", "kpp kv kiv", needed=True),
        Either("ki", "kpp"),
        Either("kd", "kpp"),
    ),
    **{
        body: tuple(
            Either(m, direct, needed=direct != "leaf") for direct, m in material.items()
        )
        for body, material in MATERIAL.items()
    },
    "interface": (
        Either("contact_strength", "mu_s mu_k", needed=True),
        Either("thresholds", "areas", "mu_s mu_k", needed=True),
        Either("delay", "v_half"),
        # coefficients assume unstretched newborn contacts, and contacts of equal area
        Either("newborn", "mu_s mu_k"),
        Either("areas", "v_half"),
    ),
    "friction": (
        Either("thresholds", "mu_s", needed=True),
        Either("friction", "contact_strength", "mu_k", "areas", "ageing"),
        Either("friction", "delay", "v_half", "newborn", "activation"),
    ),
    "drive": (
        Either("velocity", "pieces", "force", needed=True),
        Either("distance", "duration", "pieces"),
        Either("distance", "force"),
    ),
}


_EXAMPLES = tomllib.loads(Path(__file__).with_name("every_key.toml").read_text("utf-8"))
_WITHIN: Mapping[str, Mapping[str, Any]] = _EXAMPLES.pop("within")
_MORE: Mapping[str, dict[str, Any]] = _EXAMPLES.pop("more")
"""Properties of keys that follow neither from a record nor from an example."""
_USUAL = {"mean": 1.0, "scale": 1.0}
"""Default mean or scale of a distribution: the breaking displacement."""


def _first(example: Any) -> Any:
    """Return the first item of nested lists, such as a matrix."""
    return _first(example[0]) if isinstance(example, list) else example


def _keys(
    table: str, examples: Mapping[str, Any], record: type | None = None
) -> dict[str, Key]:
    """Return the keys of a table, from their examples and the fields of the record that
    the table becomes.
    """
    found = {}
    for name, example in examples.items():
        first = _first(example)
        properties = {} if record is None else _of_field(record, name)
        if unit := properties.get("unit"):
            if not isinstance(example, (str, list)):
                example = "2 ms" if unit == "time" else f"2 {si_unit(unit)}"
        elif isinstance(first, str) and (unit := natural_unit_of(first)):
            properties |= {"unit": unit, "sign": "above 0"}
        if (path := f"{table}.{name}") == "simulation.method":
            properties["choices"] = METHODS
        found[name] = Key(example, **(properties | _MORE.get(path, {})))
    return found


def _of_field(record: type, name: str) -> dict[str, Any]:
    """Return unit, bounds, choices and default of the key for a field of a record;
    empty if the record has no such field.
    """
    field = next((each for each in fields(record) if each.name == name), None)
    if field is None:
        return {}
    kind, mark = declared(record)[name]
    bounds = mark if isinstance(mark, Number) else Number()
    sign = ""
    if bounds.above == 0:
        sign = "above 0"
    elif bounds.at_least == 0:
        sign = "at least 0"
    default = None if field.default is MISSING else field.default
    if default is None and record in DISTRIBUTIONS.values():
        default = _USUAL.get(name)
    return {
        "unit": "" if bounds.unit == "1" else bounds.unit,
        "sign": sign,
        "choices": choices_of(kind),
        "default": None if default == -math.inf else default,
        "required": field.default is MISSING and default is None,
    }


_RECORDS = {
    "slider": Slider,
    "controller": ControlledAxis,
    "chain": Chain,
    "sheet": Sheet,
    "interface": Interface,
}
_BLOCKS = {
    name: example for name, example in _EXAMPLES["chain"].items() if name != "blocks"
}
TOP: Keys = _keys(
    "top",
    {
        name: dict([*each.items()][:1]) if isinstance(each, Mapping) else each
        for name, each in _EXAMPLES.items()
    },
)
"""Keys at the top of the file; the example of a table is its first key."""
TABLES: Mapping[str, Keys] = {
    name: _keys(
        name,
        _EXAMPLES[name] | (_BLOCKS if name == "sheet" else {}),
        _RECORDS.get(name),
    )
    for name in (*_RECORDS, "drive", "simulation")
}
"""Keys of each table, by its name."""
STRUCTURES: Mapping[str, Keys] = {
    name: _keys(name, _WITHIN[name], record)
    for name, record in (
        ("modes", None),
        ("matrices", Matrices),
        ("state_space", StateSpace),
    )
}
"""Keys of each of `slider.modes`, of `slider.matrices` and `slider.state_space`."""
OF_SLIDER: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "": (("mass", "stiffness", "damping", "damping_ratio"), ()),
    "modes": (("modes",), ("stiffness",)),
    "matrices": (("matrices",), ("stiffness",)),
    "state_space": (("state_space",), ()),
    "controller": (("mass",), ("damping",)),
    "force": (("mass",), ("damping", "stiffness")),
}
"""Required and optional keys of `slider`, by its kind: a mass on a spring (no name), a
structure, an axis with a controller, or a mass that a force pulls.
"""


def keys_of_slider(kind: str) -> dict[str, Key]:
    """Return the keys of `slider` for a kind in `OF_SLIDER`."""
    slider = TABLES["slider"]
    usual, optional = OF_SLIDER[kind]
    return {name: slider[name] for name in usual} | {
        name: replace(slider[name], required=False, default=0.0, sign="at least 0")
        for name in optional
    }


PIECE = _keys("piece", _EXAMPLES["drive"]["pieces"][0], Piece)
"""Keys of each of `drive.pieces`."""
FORCE = _keys("force", _WITHIN["force"], ForcePiece)
"""Keys of each of `drive.force`."""
START = _keys("start", _WITHIN["start"], Prestressed)
"""Keys of `simulation.start` as a table."""
RUN = _keys("run", _WITHIN["run"])
"""Keys of each run of equal blocks in `simulation.start.stretching`."""
FITTED = _keys("fitted", next(iter(_EXAMPLES["fitted"].values())))
"""Keys of each entry of `fitted`."""


def tables() -> dict[str, Keys]:
    """Return the tables of a file by their names, including a user's own bodies."""
    return {name: keys_of(kind) for name, kind in BODIES.items()} | dict(TABLES)


KINDS: Mapping[str, tuple[str, Mapping[str, type]]] = {
    **dict.fromkeys(
        ("thresholds", "initial", "newborn", "distribution"),
        ("distribution", DISTRIBUTIONS),
    ),
    "areas": ("", {"": Areas}),
    "delay": ("model", DELAYS),
    "ageing": ("model", AGEING_MODELS),
    "activation": ("kind", ACTIVATIONS),
}
"""For each key of `interface`, or of a table in it, whose value is a table: the key of
that table that names a record, and the records by name. Without such a key, there is
only one record.
"""
_BOLTZMANN = 1.380649e-23  # in J/K


def _histogram(_length: float, samples: tuple[float, ...]) -> dict[str, Any]:
    made = Empirical.from_samples(samples)
    return {"edges": made.edges, "weights": made.weights}


def _width(
    length: float, temperature: float, activation_volume: float, shear_strength: float
) -> dict[str, Any]:
    energy = shear_strength * activation_volume
    return {"width": _BOLTZMANN * temperature / energy * length}


class Instead(NamedTuple):
    """Keys that a file may give in place of fields of a record, and the function that
    makes these fields from the breaking displacement and the keys.
    """

    keys: Keys
    rule: Either
    make: Callable[..., dict[str, Any]]


INSTEAD: Mapping[type, Instead] = {
    Empirical: Instead(
        _keys("empirical", _WITHIN["empirical"]),
        Either("samples", "edges weights", needed=True),
        _histogram,
    ),
    Bell: Instead(
        _keys("bell", _WITHIN["bell"]),
        Either(
            "temperature activation_volume shear_strength",
            "width",
            needed=True,
        ),
        _width,
    ),
}


@cache
def keys_of(record: type) -> Keys:
    """Return the keys of the table from which a record is made.

    Raises `InputError` if a user's own delay has a number without a unit, which would
    be ambiguous in a file.
    """
    found = dict(INSTEAD[record].keys) if record in INSTEAD else {}
    made = {field.name for field in fields(record) if field.init}
    for name, (kind, mark) in declared(record).items():
        if (
            record in DELAYS.values()
            and name in made
            and mark is None
            and kind is float
        ):
            raise InputError(
                f"{record.__name__}.{name}: has no unit; declare it as "
                "Annotated[float, Number('time')]"
            )
        if name == "rate" and by_time(record):
            found["time"] = Key("1 s", unit="time", sign="above 0", required=True)
        elif name in made:
            of_type = (
                *choices_of(kind),
                {bool: False, int: 1, str: "text"}.get(kind, 1.0),
            )
            found |= _keys("", {name: _WITHIN["fields"].get(name, of_type[0])}, record)
    return found


def key_at(path: str, document: Mapping[str, Any]) -> Key | None:
    """Return the key at a path of a rig file, such as ``"interface.thresholds.std"``,
    for the kind of table that the file has, or could have, there; None if there is no
    such key.
    """
    table, *names = path.split(".")
    keys: Keys = tables().get(table, TOP if not names else {})
    if table == "simulation":
        keys = keys_of_simulation(within(document, table).get("method"))
    content = within(document, table)
    found = None if names else keys.get(table)
    for name in names:
        found = keys.get(name)
        word, kinds = KINDS.get(name, ("", {}))
        content = within(content, name)
        named = content.get(word, "")
        possible = [*kinds.values()]
        if isinstance(named, str) and named in kinds:
            possible = [kinds[named]]
        keys = {}
        for kind in possible:
            keys = {**keys_of(kind), **keys}
    return found


def within(content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a table within a table; an empty one if there is none."""
    found = content.get(name)
    return found if isinstance(found, Mapping) else {}


def by_time(record: type) -> bool:
    """Return whether a model of ageing has a rate that a file gives as a time."""
    return "rate" in declared(record) and hasattr(record, "with_time")


def fields_of_method(kind: type) -> dict[str, str]:
    """Return the fields of a method that a file may hold, with their keys in
    `simulation`.
    """
    # `memoryless` is for comparisons only
    names = [field.name for field in fields(kind) if field.name != "memoryless"]
    return {name: "contacts" if name == "count" else name for name in names}


def methods_with(key: str) -> list[str]:
    """Return the names of the methods that have a key of `simulation`."""
    return [
        name for name, kind in METHODS.items() if key in fields_of_method(kind).values()
    ]


def keys_of_simulation(method: object) -> dict[str, Key]:
    """Return the keys of `simulation` with a method, which may be a user's own."""
    usual = dict(TABLES["simulation"])
    if not isinstance(method, str) or method not in METHODS:
        return usual
    kind = METHODS[method]
    own = {
        key: usual.get(key) or keys_of(kind)[name]
        for name, key in fields_of_method(kind).items()
    }
    return {name: key for name, key in usual.items() if not methods_with(name)} | own


def paths(given: Iterable[str]) -> list[str]:
    """Return paths of keys, such as ``"interface.delay"``: those given, or their
    parents, and all others.
    """
    known = [
        "name",
        "units",
        *(f"{table}.{name}" for table, keys in tables().items() for name in keys),
    ]
    return [
        *(path for path in given if ".".join(path.split(".")[:2]) in known),
        *known,
    ]
