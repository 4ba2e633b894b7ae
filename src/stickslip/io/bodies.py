"""Elastic bodies and their prestressed starts in rig files: what is wrong with a table, and what record it makes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from stickslip.errors import InputError, shown
from stickslip.io.keys import toml
from stickslip.io.rig_keys import MATERIAL, SHAPE, START, TABLES
from stickslip.model import Chain, ElasticBody, Prestressed, Sheet

BODIES: Mapping[str, type[ElasticBody]] = {"chain": Chain, "sheet": Sheet}
"""Elastic bodies by the table that describes them."""

Natural = Callable[[float, str], float]
"""Turns a value of a file, and its natural unit, into natural units."""


def name_of(body: object) -> str | None:
    """Return the name of the table of a body; None if it is not elastic."""
    return next((name for name, kind in BODIES.items() if isinstance(body, kind)), None)


def size_of(name: str, values: Mapping[str, Any]) -> int:
    """Return the number of blocks."""
    return int(values["blocks"]) if name == "chain" else int(values["along"]) * int(values["across"])


def missing(name: str, given: Mapping[str, Any], *, natural: bool) -> Iterator[str]:
    """Yield the keys that are missing in the table of a body: of its springs and masses, of the shape of a block."""
    for direct, material in MATERIAL[name].items():
        if TABLES[name][direct].default is None and direct not in given and material not in given:
            yield direct if natural else material
    if set(MATERIAL[name].values()) & set(given):
        yield from (key for key in SHAPE if key not in given)


def wrong(name: str, given: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what cannot be in the table of a body: where, and why."""
    for key in ("blocks", "along", "across"):
        value = given.get(key)
        if isinstance(value, int) and not isinstance(value, bool) and value < 1:
            yield f"{name}.{key}", f"is {value}; give at least 1"
    for direct, material in MATERIAL[name].items():
        if direct in given and material in given:
            yield name, f"give {direct} or {material}, not both"


def body_from(name: str, values: Mapping[str, Any], natural: Natural) -> ElasticBody:
    """Make a body of the values of its table: properties of the material become springs and masses of blocks."""
    length, width, height = (values.get(key, math.nan) for key in SHAPE)
    found = {key: value for key, value in values.items() if key not in ("width", "height")}
    # A spring from a block to the top is as long as the bar is high, one from row to row as a row is wide.
    shape = {
        "coupling": width * height / length,
        "leaf": width * length / height,
        "shear": height * length / width,
        "mass": width * height * length,
    }
    for direct, material in MATERIAL[name].items():
        if material in found:
            found[direct] = found.pop(material) * shape[direct]
    # Products in the units of the file: what follows from the material can be written into a file again, bit for bit.
    keys = TABLES[name]
    made: dict[str, Any] = {
        key: natural(value, keys[key].unit) if keys[key].unit else value for key, value in found.items()
    }
    return BODIES[name](**made)


def start_from(values: Mapping[str, Any], body: ElasticBody, natural: Natural) -> Prestressed:
    """Make a prestressed start of the values of its table."""
    stretching = values["stretching"]
    if isinstance(stretching, list):
        stretching = _profile(stretching, body.size)
    return Prestressed(
        stretching=stretching, push=natural(values["push"], START["push"].unit), pushed_blocks=values["pushed_blocks"]
    )


def _profile(content: list[Any], size: int) -> tuple[float, ...]:
    """The stretching of each block, from a list of numbers or of runs of blocks alike."""
    found: list[float] = []
    total, place = 0, "Prestressed.stretching"
    for i, item in enumerate(content):
        blocks, value = 1, item
        if isinstance(item, Mapping):
            blocks, value = item.get("blocks", 0), item.get("stretching")
            whole = isinstance(blocks, int) and not isinstance(blocks, bool) and blocks > 0
            if set(item) != {"blocks", "stretching"} or not whole:
                example = toml({"blocks": 20, "stretching": 0.7})
                what = f"{place}[{i}] = {shown(item)}: must be a number, or blocks alike: {example}"
                raise InputError(what, f"{place}[{i}]")
        total += blocks
        if total <= size:
            found += [START["stretching"].read(value, f"{place}[{i}]", natural=True)] * blocks
    if total != size:
        raise InputError(
            f"{place}: is of {total} blocks, but there are {size}; give one number, or one for each", place
        )
    return tuple(found)
