"""The columns of a measured table that hold numbers, for a person to choose from."""

from typing import NamedTuple

from stickslip.measure.headings import simple
from stickslip.measure.tables import read_table


class Column(NamedTuple):
    """A column of numbers."""

    #: what `stickslip.read_trace` takes for it: its name or, where others share that,
    #: its number from 1
    key: str
    heading: str  #: its number and its heading


def columns(content: bytes) -> list[Column]:
    r"""Return the columns of numbers of a table, from the bytes of its file.

    Raises `InputError` if there is no table in it.

    Examples
    --------
    >>> from stickslip.measure import columns
    >>> columns(b"time [s],force [N]\n0.0,1.0\n0.1,2.0\n")[1]
    Column(key='force', heading='2: force (N)')
    """
    headings, numeric = read_table(content)[:2]
    names = [simple(heading.name) for heading in headings]
    found = []
    for i in numeric:
        is_alone = bool(names[i]) and names.count(names[i]) == 1
        key = headings[i].name if is_alone else str(i + 1)
        found.append(Column(key or str(i + 1), f"{i + 1}: {headings[i]}".strip(": ")))
    return found
