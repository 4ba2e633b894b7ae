"""TOML files and the quantities in them: every mistake in one line that names place, value and remedy.

Quantities in SI files are strings with a unit, ``"4 MN/m"``; a number without one is refused, because nobody can tell
what it meant. Files in natural units hold plain numbers.
"""

from __future__ import annotations

import difflib
import math
import sys
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, TypeAdapter, ValidationError, ValidationInfo

from stickslip.errors import InputError, extreme, shortened, shown, together
from stickslip.io import files
from stickslip.model.quantities import read_quantity

LARGEST_FILE = 1_000_000
"""Bytes beyond which a file is no description of anything."""


class Part(BaseModel):
    """A table of a file: strict, closed, frozen."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


Document = TypeVar("Document", bound=Part)


def read_toml(path: Path, kind: str, example: str) -> dict[str, Any]:
    """Read the content of a TOML file.

    Parameters
    ----------
    path : Path
    kind : str
        What the file should be, for the message: ``"rig file"``.
    example : str
        A file to look at.

    Raises
    ------
    InputError
        If the file is missing, empty, binary or no TOML.
    """
    content = files.read(path, kind, largest=LARGEST_FILE)
    if not content.strip():
        raise InputError(f"{path}: is empty; see {example} for what a {kind} holds")
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{path}: is a binary file; a {kind} is TOML text")
    return parse_toml(text, str(path), kind)


def parse_toml(text: str, place: str, kind: str) -> dict[str, Any]:
    """Read TOML text; `place` begins the message of an error, and `kind` is what the text should be."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{place}: is not valid TOML: {shortened(str(error))}") from None
    except RecursionError:
        raise InputError(f"{place}: is nested too deep; a {kind} has tables in tables, three levels at most") from None
    except ValueError:  # Python reads no integer of more than 4300 digits
        raise InputError(f"{place}: holds a whole number of thousands of digits; no {kind} needs one") from None


def validate(kind: type[Document], content: Mapping[str, Any], place: str, *, natural: bool) -> Document:
    """Check the content of a file against a model.

    Parameters
    ----------
    kind : type
        The model.
    content : mapping
        What the file holds.
    place : str
        Begins the message of an error.
    natural : bool
        Whether quantities are plain numbers in natural units.

    Raises
    ------
    InputError
        Naming every mistake: key, value, remedy.
    """
    try:
        return kind.model_validate(content, context={"natural": natural})
    except ValidationError as error:
        mistakes = dict.fromkeys(_one_mistake(item, kind) for item in error.errors(include_url=False))
        raise InputError(f"{place}: {together(mistakes)}") from None


# ---------------------------------------------------------------------------------------------------------------------
# Quantities
# ---------------------------------------------------------------------------------------------------------------------


Sign = Literal["above 0", "at least 0", ""]


def quantity_of(value: object, unit: str, example: str, sign: Sign = "above 0", *, natural: bool = False) -> float:
    """Read a quantity: text with a unit in SI files, a plain number in natural ones.

    Raises
    ------
    InputError
        If it is anything else; the message does not name the place.
    """
    result = _number_of(value, unit, example, natural)
    if not math.isfinite(result):
        raise InputError("must be finite")
    if refusal := extreme(result):
        raise InputError(f"{refusal} (in {unit})")
    if (sign == "above 0" and result <= 0) or (sign == "at least 0" and result < 0):
        raise InputError(f"must be {sign}")
    return result


def _number_of(value: object, unit: str, example: str, natural: bool) -> float:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if natural:
            return float(value) if abs(value) <= sys.float_info.max else math.inf
        raise InputError(f"has no unit; write it as a string, such as {example!r}")
    if not isinstance(value, str):
        raise InputError(f"must be a quantity, such as {example!r}")
    if natural:
        raise InputError("must be a plain number, as the file says units = 'natural'")
    return read_quantity(value, unit, example)


def quantity(unit: str, example: str, sign: Sign = "above 0") -> BeforeValidator:
    """How a model reads a quantity, as `quantity_of`."""

    def to_si(value: object, info: ValidationInfo) -> object:
        return quantity_of(value, unit, example, sign, natural=bool(info.context and info.context["natural"]))

    return BeforeValidator(to_si)


Length = Annotated[float, quantity("m", "2 um")]
Time = Annotated[float, quantity("s", "2 ms")]


# ---------------------------------------------------------------------------------------------------------------------
# Errors in the user's words
# ---------------------------------------------------------------------------------------------------------------------


_TAGS = ("as list", "as table", "as range")
"""Names of the alternatives of a union: no keys of a file."""


def _one_mistake(item: Any, document: type[Part]) -> str:
    """Say one thing that is wrong with a file: key, value and remedy."""
    path = [shortened(str(part)) for part in item["loc"] if part not in _TAGS]
    kind, value = item["type"], item["input"]
    key = ".".join(path) or "the file"
    if kind == "extra_forbidden":
        if key == "run.cells":
            return "run.cells: is gone; write rtol, the error of the force, such as 1e-4"
        known = _keys_beside(path, document)
        near = difflib.get_close_matches(path[-1], known, n=1, cutoff=0.5)
        remedy = f"; did you mean {near[0]!r}?" if near else f"; known here: {', '.join(known)}"
        return f"{key}: unknown key{remedy}"
    if kind == "missing":
        return f"{key}: is missing"
    if kind == "literal_error":
        return f"{key} = {shown(value)}: must be {item['ctx']['expected']}"
    if kind == "value_error":
        found = "" if isinstance(value, dict) else f" = {shown(value)}"
        return f"{key}{found}: {item['ctx']['error']}"
    words = {
        "float_type": "must be a number",
        "int_type": "must be a whole number",
        "string_type": "must be text in quotes",
        "list_type": "must be a list",
        "model_type": f"must be a table, as in [{key}]",
        "dict_type": f"must be a table, as in [{key}]",
        "model_attributes_type": f"must be a table, as in [{key}]",
        "greater_than_equal": f"must be at least {item.get('ctx', {}).get('ge')}",
        "less_than": f"must be below {item.get('ctx', {}).get('lt')}",
        "string_too_long": f"must be at most {item.get('ctx', {}).get('max_length')} characters long",
    }
    return f"{key} = {shown(value)}: {words.get(kind, item['msg'].lower())}"


def _keys_beside(path: list[str], document: type[Part]) -> list[str]:
    """Keys that the file may hold beside the last of a path."""
    schema = _schema(document)

    def resolve(node: dict[str, Any]) -> dict[str, Any]:
        return dict(schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]) if "$ref" in node else node

    def alternatives(node: dict[str, Any]) -> list[dict[str, Any]]:
        below = node.get("anyOf") or node.get("oneOf") or node.get("allOf")  # the last is how pydantic 2.8 refers
        return [inner for one in below for inner in alternatives(resolve(one))] if below else [node]

    node: dict[str, Any] = schema
    for part in path[:-1]:
        following = [one["properties"][part] for one in alternatives(node) if part in one.get("properties", {})]
        if not following:
            return []
        node = resolve(following[0])
    return sorted({key for one in alternatives(node) for key in one.get("properties", {})})


@lru_cache(maxsize=4)
def _schema(document: type[Part]) -> dict[str, Any]:
    return TypeAdapter(document).json_schema()
