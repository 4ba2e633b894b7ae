"""Tables of what is refused: calls, then a pattern of the message of them all."""

import re
import tomllib
from collections.abc import Callable, Iterator

import pytest


def refused(*table: Callable[..., object] | str) -> pytest.MarkDecorator:
    """Give a test each `call` of a table and the `message` that follows, a pattern."""
    rows = []
    calls = []
    for item in table:
        if isinstance(item, str):
            rows += [(call, item) for call in calls]
            calls = []
        else:
            calls.append(item)
    ids = map(str, range(len(rows)))
    return pytest.mark.parametrize(("call", "message"), rows, ids=ids)


def mistakes(table: str) -> Iterator[tuple[str, object, str, str]]:
    """Yield each key of a file, its value (None: it is left out), and two texts of the
    message: the place, and the remedy. In the table a line holds key and value as in a
    file, and the indented line below it the two texts, with a bar between.
    """
    for line, place, remedy in re.findall(r"^(\S.*)\n {4}(.*) \| (.*)$", table, re.M):
        key, _, value = line.partition(" = ")
        found = tomllib.loads(f"value = {value}")["value"] if value else None
        yield key, found, place, remedy
