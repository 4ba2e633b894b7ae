"""Reading of TOML files, table by table, with all mistakes reported in one line that
names place, value and remedy.
"""

import difflib
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stickslip.errors import InputError, refused, shortened, together
from stickslip.io import files
from stickslip.io.keys import Either, Key, Keys, toml
from stickslip.words import listed

Values = dict[str, Any]
"""The values of a table, in the units of the file; nested tables are not yet read."""

LARGEST_FILE = 1_000_000  # bytes; a larger file does not describe a rig or a sweep


def read_toml(path: Path, kind: str, example: str) -> dict[str, Any]:
    """Return the content of a TOML file; errors name the `kind` of file that it should
    be, such as ``"rig file"``, and an example.
    """
    content = files.read(path, kind, largest=LARGEST_FILE)
    if not content.strip():
        raise InputError(f"{path}: is empty; see {example} for what a {kind} holds")
    try:
        # without a byte order mark
        return tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{path}: is not valid TOML, as a {kind} is: line {line} is not in UTF-8; "
            "save the file as UTF-8"
        ) from None
    # the file is binary, no TOML, nested too deep, or holds overlong integers
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: is not valid TOML, as a {kind} is: {shortened(str(error))}"
        ) from None


class NotedError(InputError):
    """A part of the file cannot be read further; the reason is already noted."""


class MissingError(InputError):
    """A key is missing; the example is a value that it could have."""

    def __init__(self, place: str, example: Any) -> None:
        super().__init__(
            f"{place}: is missing; write, for example, {place} = {toml(example)}", place
        )
        self.example = toml(example)


@contextmanager
def at(place: str, names: Mapping[str, str] | None = None) -> Iterator[None]:
    """Turn the error of a record about a field into one about the key of the file, in
    which `names` may rename fields.
    """
    try:
        yield
    except InputError as error:
        field = error.place.partition(".")[2]
        key = (names or {}).get(field, field)
        raise error.at(f"{place}.{key}" if key else place) from None


# most unknown keys for which the nearest known one is suggested, which takes time
_MOST_WORDS = 40


class Tables:
    """Reader of the tables of a file, which notes every mistake.

    With `natural`, quantities are plain numbers.
    """

    def __init__(self, *, natural: bool) -> None:
        self.natural = natural
        self.mistakes: list[InputError] = []

    def note(self, error: InputError) -> None:
        """Note a mistake, unless it is already noted."""
        if not isinstance(error, NotedError):
            self.mistakes.append(error)

    def wrong(self, place: str, words: str) -> None:
        """Note a mistake in the key at a place."""
        self.note(InputError(f"{place}: {words}", place))

    def missing(self, place: str, key: Key) -> None:
        """Note that a key is missing, if its place has no mistake yet."""
        if all(mistake.place != place for mistake in self.mistakes):
            self.note(
                MissingError(place, 1.0 if self.natural and key.unit else key.example)
            )

    def part(self, read: Callable[[], Any]) -> Any:
        """Return a part of the file; if it cannot be read, note the mistake and return
        None, so that further mistakes can be found.
        """
        try:
            return read()
        except InputError as error:
            self.note(error)

    def table(
        self,
        content: object,
        keys: Keys,
        place: str = "",
        rules: Iterable[Either] = (),
    ) -> Values:
        """Return the values of a table, quantities in SI or natural units; nested
        tables are returned unread.
        """
        if not isinstance(content, Mapping):
            self.note(refused(place, content, f"must be a table, as in [{place}]"))
            return {}
        path = f"{place}." if place else ""
        for i, name in enumerate(str(name) for name in content if name not in keys):
            word = f"; {unknown(name, keys)}" if i < _MOST_WORDS else ""
            self.wrong(path + name[:60], f"unknown key{word}")
        found: Values = {}
        of_rules = {name for rule in rules for name in rule.names}
        for name, key in keys.items():
            if name in content:
                try:
                    value = content[name]
                    found[name] = (
                        value
                        if key.is_left(value)
                        else key.read(value, path + name, natural=self.natural)
                    )
                except InputError as error:
                    self.note(error)
            elif key.required and name not in of_rules:
                if key.is_table:
                    found[name] = {}
                else:
                    self.missing(path + name, key)
            elif key.default is not None:
                found[name] = key.default
        for rule in rules:
            self._choose(content, rule, keys, place)
        return found

    def _choose(
        self,
        content: Mapping[str, Any],
        rule: Either,
        keys: Keys,
        place: str,
    ) -> None:
        """Note where a table breaks a rule."""
        # some keys do not exist in natural units
        possible = [each for each in rule.alternatives if keys.keys() >= {*each}]
        given = [each for each in possible if not content.keys().isdisjoint(each)]
        if len(given) > 1:
            self.wrong(
                place or given[1][0],
                f"give {' or '.join(map(listed, rule.alternatives))}, not both",
            )
        elif possible and (given or rule.needed):
            for name in (given or possible)[0]:
                if name not in content:
                    self.missing(f"{place}.{name}", keys[name])

    def whole(
        self,
        content: object,
        keys: Keys,
        place: str,
        rules: Iterable[Either] = (),
    ) -> Values:
        """Return the values of a table; stop if it has a mistake."""
        before = len(self.mistakes)
        values = self.table(content, keys, place, rules)
        self.stop(before)
        return values

    def stop(self, before: int = 0) -> None:
        """Read no further if there are more than `before` mistakes."""
        if len(self.mistakes) > before:
            raise NotedError("")

    def in_one_line(self, place: str) -> InputError:
        """Return one error for all mistakes in a file, as far as they fit in a line;
        missing keys are listed together at the end.
        """
        missing = [each for each in self.mistakes if isinstance(each, MissingError)]
        missing = missing if len(missing) > 1 else []
        lines = [str(each) for each in self.mistakes if each not in missing]
        if missing:
            examples = ", ".join(f"{each.place} = {each.example}" for each in missing)
            lines.append(f"missing, here with example values: {examples}")
        key = self.mistakes[0].place if len(self.mistakes) == 1 else ""
        return InputError(f"{place}: {together(lines)}", key, tuple(self.mistakes))


_RENAMED = {"temperature": "activation", "track_scatter": "slip_to_slip_scatter"}
"""Names that keys had in files of earlier versions, with the present names."""


_MEANT = {"speed": "velocity", "law": "distribution"}
"""Words that users write for keys, with these keys."""


def unknown(name: str, known: Iterable[str]) -> str:
    """Return a suggestion of a known word in place of an unknown one."""
    known = tuple(known)
    meant = _MEANT.get(name)
    if meant in known:
        return f"did you mean {meant!r}?"
    renamed = _RENAMED.get(name)
    if renamed in known:
        return f"it is called {renamed!r} now"
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
