"""TOML files read table by table: every mistake in one line that names place, value and remedy."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from stickslip.errors import InputError, shortened, shown, together
from stickslip.io import files
from stickslip.io.keys import Either, Key, toml

Made = TypeVar("Made")

LARGEST_FILE = 1_000_000
"""Bytes beyond which a file is no description of anything."""


def read_toml(path: Path, kind: str, example: str) -> dict[str, Any]:
    """Read the content of a TOML file; errors say what it should be, ``"rig file"``, and name an example."""
    content = files.read(path, kind, largest=LARGEST_FILE)
    if not content.strip():
        raise InputError(f"{path}: is empty; see {example} for what a {kind} holds")
    try:
        return tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:  # it is binary, no TOML, nested too deep, or holds endless integers
        raise InputError(f"{path}: is not valid TOML, as a {kind} is: {shortened(str(error))}") from None


class MistakesError(Exception):
    """What stands in the file cannot be read on."""


class MissingError(InputError):
    """A key is missing; the example is a value that it could have."""

    def __init__(self, place: str, example: Any) -> None:
        super().__init__(f"{place}: is missing; write, for example, {place} = {toml(example)}", place)
        self.example = toml(example)


_MOST_EACH = 40
"""Mistakes that are told each at its key, too: a form has no more."""
_MOST_READ = 1_000
"""Mistakes after which a file is read no further."""


class Tables:
    """Reads the tables of a file one after the other, and notes every mistake on the way.

    With `natural`, quantities are plain numbers.
    """

    def __init__(self, *, natural: bool) -> None:
        self.natural = natural
        self.mistakes: list[InputError] = []
        self.refused: dict[str, str] = {}  # why a key that others have is unknown, by its path

    def wrong(self, place: str, what: str) -> None:
        """Note a mistake."""
        self.mistakes.append(InputError(f"{place}: {what}", place))

    def refuse(self, place: str, value: object, what: str) -> NoReturn:
        """Note that a value cannot be, and read this part no further."""
        self.mistakes.append(InputError(f"{place} = {shown(value)}: {what}", place))
        raise MistakesError

    def missing(self, place: str, key: Key) -> None:
        """Note that a key is missing, once."""
        if all(mistake.place != place for mistake in self.mistakes):
            self.mistakes.append(MissingError(place, 1.0 if self.natural and key.unit else key.example))

    def table(self, content: object, keys: Mapping[str, Key], place: str = "") -> dict[str, Any]:
        """Values of a table, quantities in SI units or natural ones; tables in it as they stand."""
        if len(self.mistakes) > _MOST_READ:
            raise MistakesError
        if not isinstance(content, Mapping):
            self.mistakes.append(InputError(f"{place} = {shown(content)}: must be a table, as in [{place}]", place))
            return {}
        path = f"{place}." if place else ""
        for i, name in enumerate(str(name) for name in content if name not in keys):
            what = f"unknown key; {unknown(name, keys)}" if i < _MOST_EACH else "unknown key"  # a word takes its time
            self.wrong(path + name[:60], self.refused.get(path + name, what))
        found: dict[str, Any] = {}
        for name, key in keys.items():
            if name in content:
                try:
                    value = content[name]
                    found[name] = value if key.is_left(value) else key.read(value, path + name, natural=self.natural)
                except InputError as error:
                    self.mistakes.append(error)
            elif key.required and key.is_table:
                found[name] = {}
            elif key.required:
                self.missing(path + name, key)
            elif key.default is not None:
                found[name] = key.default
        return found

    def choose(self, content: object, rule: Either, keys: Mapping[str, Key], place: str) -> None:
        """Note what a rule has against a table."""
        if not isinstance(content, Mapping):
            return  # told of already
        ways = [way for way in rule.ways if keys.keys() >= {*way}]  # some are none in natural units
        given = [way for way in ways if not content.keys().isdisjoint(way)]
        if len(given) > 1:
            self.wrong(place, rule.clash)
        elif ways and (given or rule.needed):
            for name in (given or ways)[0]:
                if name not in content:
                    self.missing(f"{place}.{name}", keys[name])

    def kind(self, content: object, place: str, word: str, kinds: Mapping[str, type], example: Any) -> type[Any]:
        """The record that a table names."""
        if not isinstance(content, Mapping):
            self.refuse(place, content, f"must be a table, such as {toml(example)}")
        named = content.get(word)
        if isinstance(named, str) and named in kinds:
            return kinds[named]
        key = f"{place}.{word}"
        given = f"{key} = {shown(named)}" if word in content else key
        known = f"must be one of the known {word}s {', '.join(map(repr, kinds))}, as in {toml(example)}"
        self.mistakes.append(InputError(f"{given}: {known}", key))
        raise MistakesError

    def make(self, place: str, make: Callable[[], Made], names: Mapping[str, str] | None = None) -> Made:
        """Make a record; its complaint about a field becomes one about the key, which `names` may name."""
        try:
            return make()
        except InputError as error:
            field = error.place.partition(".")[2]
            key = (names or {}).get(field, field)
            self.mistakes.append(error.at(f"{place}.{key}" if key else place))
            raise MistakesError from None

    def part(self, read: Callable[[], Made]) -> Any:
        """A part of the file, or None where it cannot be read: the mistake is noted, and the others are looked for."""
        with suppress(MistakesError):
            return read()

    def stop(self, before: int = 0) -> None:
        """Read no further if there was a mistake, besides the first so many."""
        if len(self.mistakes) > before:
            raise MistakesError

    def in_one_line(self, place: str) -> InputError:
        """One error for every mistake in a file, as far as a line reaches; what is missing comes last, together."""
        missing = [mistake for mistake in self.mistakes if isinstance(mistake, MissingError)]
        lines = [str(mistake) for mistake in self.mistakes if len(missing) == 1 or mistake not in missing]
        if len(missing) > 1:
            examples = ", ".join(f"{mistake.place} = {mistake.example}" for mistake in missing)
            lines.append(f"missing, here with example values: {examples}")
        key = self.mistakes[0].place if len(self.mistakes) == 1 else ""
        each = tuple(self.mistakes) if len(self.mistakes) <= _MOST_EACH else ()
        return InputError(f"{place}: {together(lines)}", key, each)


def unknown(name: str, known: Iterable[str]) -> str:
    """What to write in place of a word that is not known."""
    near = difflib.get_close_matches(name, known := tuple(known), n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
