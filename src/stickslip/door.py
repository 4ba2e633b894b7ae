"""The door for TOML files: strict models in, every mistake in one line that names place, value and remedy.

Quantities in SI files are strings with a unit, ``"4 MN/m"``; a number without one is refused, because nobody can tell
what it meant. Files in natural units hold plain numbers.
"""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, TypeAdapter, ValidationError, ValidationInfo

from stickslip import files
from stickslip.errors import InputError

if TYPE_CHECKING:
    import pint

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
        if "\0" in text:
            raise InputError(f"{path}: is a binary file; a {kind} is TOML text")
        return tomllib.loads(text)
    except UnicodeDecodeError:
        raise InputError(f"{path}: is a binary file; a {kind} is TOML text") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: is not valid TOML: {error}") from None


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
        mistakes = [_one_mistake(item, kind) for item in error.errors()]
        raise InputError(f"{place}: {'; '.join(dict.fromkeys(mistakes))}") from None


# ---------------------------------------------------------------------------------------------------------------------
# Quantities
# ---------------------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry()


def quantity(unit: str, example: str, sign: Literal["above 0", "at least 0", ""] = "above 0") -> BeforeValidator:
    """How a quantity is read: a string with a unit in SI files, a plain number in natural ones."""

    def to_si(value: object, info: ValidationInfo) -> object:
        result = _read(value, natural=bool(info.context and info.context["natural"]))
        if not math.isfinite(result):
            raise ValueError("must be finite")
        if (sign == "above 0" and result <= 0) or (sign == "at least 0" and result < 0):
            raise ValueError(f"must be {sign}")
        return result

    def _read(value: object, natural: bool) -> float:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            if natural:
                return float(value)
            raise ValueError(f"has no unit; write it as a string, such as {example!r}")
        if not isinstance(value, str):
            raise ValueError(f"must be a quantity, such as {example!r}")
        if natural:
            raise ValueError("must be a plain number, as the file says units = 'natural'")
        return _parse(value, unit, example)

    return BeforeValidator(to_si)


def _parse(text: str, unit: str, example: str) -> float:
    import pint
    from pint.errors import PintError

    try:
        found: Any = _registry().Quantity(text)
        if found.dimensionless and unit:
            raise ValueError(f"has no unit; write it as in {example!r}")
        result = float(found.to(unit).magnitude)
    except pint.DimensionalityError:
        raise ValueError(f"is not in a unit of {unit!r}; write it as in {example!r}") from None
    except (PintError, AttributeError, TypeError, ValueError, ArithmeticError, AssertionError, SyntaxError) as error:
        if "unit" in str(error) and "write" in str(error):
            raise
        raise ValueError(f"cannot be read as a quantity; write it as in {example!r}") from None
    except Exception:  # pint lets errors of the tokenizer through
        raise ValueError(f"cannot be read as a quantity; write it as in {example!r}") from None
    return result


Mass = Annotated[float, quantity("kg", "75.6 g", "at least 0")]
Stiffness = Annotated[float, quantity("N/m", "4 MN/m")]
Rate = Annotated[float, quantity("1/s", "200 1/s", "at least 0")]
Force = Annotated[float, quantity("N", "768 N")]
Length = Annotated[float, quantity("m", "2 um")]
Time = Annotated[float, quantity("s", "2 ms")]
Lag = Annotated[float, quantity("s", "2 ms", "at least 0")]
Velocity = Annotated[float, quantity("m/s", "0.4 mm/s", "")]


# ---------------------------------------------------------------------------------------------------------------------
# Errors in the user's words
# ---------------------------------------------------------------------------------------------------------------------


_TAGS = {
    *("random", "fixed", "never", "gaussian", "uniform", "exponential", "gamma", "lognormal", "weibull", "empirical"),
    *("langevin", "logarithmic", "as list", "as table", "as range"),
}
"""Names of the alternatives of a union: no keys of a file."""


def _one_mistake(item: Any, document: type[Part]) -> str:
    """Say one thing that is wrong with a file: key, value and remedy."""
    path = [str(part) for part in item["loc"] if part not in _TAGS]
    kind, value = item["type"], item["input"]
    key = ".".join(path) or "the file"
    if kind == "extra_forbidden":
        known = _keys_beside(path, document)
        near = difflib.get_close_matches(path[-1], known, n=1, cutoff=0.5)
        remedy = f"; did you mean {near[0]!r}?" if near else f"; known here: {', '.join(known)}"
        return f"{key}: unknown key{remedy}"
    if kind == "missing":
        return f"{key}: is missing"
    if kind in ("union_tag_not_found", "union_tag_invalid"):
        return f"{key}: must name its law, such as {{law = 'gaussian', spread = 0.1}}; known laws: {_tags(item)}"
    if kind == "literal_error":
        return f"{key} = {value!r}: must be {item['ctx']['expected']}"
    if kind == "value_error":
        shown = "" if isinstance(value, dict) else f" = {value!r}"
        return f"{key}{shown}: {item['ctx']['error']}"
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
    }
    return f"{key} = {value!r}: {words.get(kind, item['msg'].lower())}"


_LAWS = ("gaussian", "uniform", "exponential", "gamma", "lognormal", "weibull", "empirical")


def _tags(item: Any) -> str:
    return str(item.get("ctx", {}).get("expected_tags", ", ".join(_LAWS)))


def _keys_beside(path: list[str], document: type[Part]) -> list[str]:
    """Keys that the file may hold beside the last of a path."""
    schema = _schema(document)

    def resolve(node: dict[str, Any]) -> dict[str, Any]:
        return dict(schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]) if "$ref" in node else node

    def alternatives(node: dict[str, Any]) -> list[dict[str, Any]]:
        below = node.get("anyOf") or node.get("oneOf")
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
