"""Tables of what is refused, written as they read.

Expressions begin at the margin, and go on in lines with two blanks; below them, with
four blanks, stands the pattern that the message of each matches. First come imports of
what else the expressions name.
"""

import re
import tomllib
from collections.abc import Iterator

import pytest

EXPRESSION = re.compile(r"^\S.*\n(?: {2}\S.*\n)*", re.MULTILINE)
ROW = re.compile(rf"((?:{EXPRESSION.pattern})+)((?: {{4}}.*\n)+)", re.MULTILINE)
IMPORT = re.compile(r"^(?:from|import) .*\n", re.MULTILINE)


def refused(
    table: str, names: dict[str, object], given: str = ""
) -> pytest.MarkDecorator:
    """Give a test each expression as a `call`, and the `message` of its refusal."""
    known = dict(names)
    exec("".join(IMPORT.findall(table)), known)
    rows = []
    for expressions, message in ROW.findall(IMPORT.sub("", table)):
        pattern = " ".join(map(str.strip, message.splitlines()))
        for text in EXPRESSION.findall(expressions):
            rows.append((eval(f"lambda {given}: ({text})", known), pattern))
    assert rows
    return pytest.mark.parametrize(
        ("call", "message"), rows, ids=map(str, range(len(rows)))
    )


def mistakes(table: str) -> Iterator[tuple[str, object, str, str]]:
    """Give each key of a file, its value (None: it is left out), and two texts of the
    message: the place, and the remedy. In the table a line has the first two, as the
    file has them, and below it one the others.
    """
    for line, place, remedy in re.findall(r"^(\S.*)\n {4}(.*) \| (.*)$", table, re.M):
        key, _, value = line.partition(" = ")
        found = tomllib.loads(f"value = {value}")["value"] if value else None
        yield key, found, place, remedy
