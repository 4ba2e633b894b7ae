"""Check that every equation of the paper that the code cites has a test, and that every
tested equation is cited.

A citation is ``Eq. (8)``, ``Eqs. (1)-(4)`` or ``Eqs. (1), (3) and (8)`` anywhere in
``src/**/*.py``; a test in ``tests/`` or ``verification/`` has the mark
``@pytest.mark.eq(8)``, alone or as part of ``pytestmark``. Prints one line for each
equation that has only one of the two, with exit status 1.

    python tools/equations.py [ROOT]
"""

import ast
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

LAST = 18  # the last equation of the paper

# Between the words of a citation: blanks, line ends, and comment signs of continued
# lines.
_GAP = r"[\s#]*"
_HEAD = re.compile(rf"\b(?:Eqs?\.|Equations?\b)(?={_GAP}\(?{_GAP}\d)", re.IGNORECASE)
_NUMBER = re.compile(rf"{_GAP}\({_GAP}(\d+){_GAP}\)")
_RANGE = re.compile(rf"{_GAP}(?:-|\u2013|to\b){_GAP}(?=\()")
_AND = re.compile(
    rf"{_GAP}(?:,{_GAP}and\b|,|and\b|or\b|&){_GAP}(?=\({_GAP}\d+{_GAP}\))"
)


@dataclass(frozen=True, kw_only=True)
class Mention:
    """An equation cited at a place; ``number`` is None if it cannot be read."""

    number: int | None
    path: str
    line: int

    @property
    def place(self) -> str:
        return f"{self.path}:{self.line}"


def citations(text: str, path: str) -> Iterator[Mention]:
    """Yield the equations cited in a source text, with ranges expanded."""
    for head in _HEAD.finditer(text):
        line = text.count("\n", 0, head.start()) + 1
        numbers = _listed_numbers(text, head.end())
        if not numbers:
            yield Mention(number=None, path=path, line=line)
        for number in numbers:
            yield Mention(number=number, path=path, line=line)


def _listed_numbers(text: str, position: int) -> list[int]:
    """Return the numbers of the list ``(a), (b)-(c) and (d)`` that starts at a
    position; none if there is no list.
    """
    numbers: list[int] = []
    in_range = False
    while found := _NUMBER.match(text, position):
        number = int(found[1])
        numbers.extend(range(numbers[-1] + 1, number + 1) if in_range else [number])
        position = found.end()
        joint = (in_range_joint := _RANGE.match(text, position)) or _AND.match(
            text, position
        )
        if joint is None:
            break
        in_range = in_range_joint is not None
        position = joint.end()
    return numbers


def marks(text: str, path: str) -> Iterator[Mention]:
    """Yield the equations named by ``pytest.mark.eq(...)`` in a test file."""
    nodes = list(ast.walk(ast.parse(text, filename=path)))
    calls = [
        node for node in nodes if isinstance(node, ast.Call) and _is_eq_mark(node.func)
    ]
    for call in calls:
        if not call.args:
            yield Mention(number=None, path=path, line=call.lineno)
        for argument in call.args:
            yield Mention(number=_integer(argument), path=path, line=argument.lineno)
    called = {call.func for call in calls}
    for node in nodes:
        if isinstance(node, ast.Attribute) and _is_eq_mark(node) and node not in called:
            yield Mention(number=None, path=path, line=node.lineno)


def _is_eq_mark(node: ast.AST) -> bool:
    """Return whether the node is ``pytest.mark.eq`` or ``mark.eq``."""
    if not (isinstance(node, ast.Attribute) and node.attr == "eq"):
        return False
    owner = node.value
    return (isinstance(owner, ast.Attribute) and owner.attr == "mark") or (
        isinstance(owner, ast.Name) and owner.id == "mark"
    )


def _integer(node: ast.expr) -> int | None:
    """Return the value of an integer literal, None for anything else."""
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return node.value
    return None


def cited_in(root: Path) -> list[Mention]:
    """Return the citations in all sources below ``root/src``."""
    return [
        mention
        for path, text in _python_files(root, "src")
        for mention in citations(text, path)
    ]


def tested_in(root: Path) -> list[Mention]:
    """Return the marks of all tests below ``root/tests`` and ``root/verification``."""
    return [
        mention
        for folder in ("tests", "verification")
        for path, text in _python_files(root, folder)
        for mention in marks(text, path)
    ]


def _python_files(root: Path, folder: str) -> Iterator[tuple[str, str]]:
    for path in sorted((root / folder).rglob("*.py")):
        yield path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")


def complaints(cited: Sequence[Mention], tested: Sequence[Mention]) -> list[str]:
    """Return one line for each equation that breaks the rule, and for each citation
    that cannot be read.
    """
    lines = []
    for mention in cited:
        if mention.number is None:
            lines.append(
                f"{mention.place}: cannot read this citation; write Eq. (8) or Eqs. "
                "(1)-(4)"
            )
    for mention in tested:
        if mention.number is None:
            lines.append(
                f"{mention.place}: pytest.mark.eq takes equation numbers, such as "
                "eq(8) or eq(1, 2)"
            )
    first_citation = _first_of_each(cited)
    first_mark = _first_of_each(tested)
    for number in sorted(first_citation.keys() | first_mark.keys()):
        mention = first_citation.get(number) or first_mark[number]
        if not 1 <= number <= LAST:
            lines.append(
                f"Eq. ({number}): named in {mention.place}, but the paper's last is "
                f"({LAST})"
            )
        elif number not in first_mark:
            lines.append(
                f"Eq. ({number}): cited in {mention.place}, but no test is marked "
                f"eq({number})"
            )
        elif number not in first_citation:
            lines.append(
                f"Eq. ({number}): tested in {mention.place}, but nothing in src cites "
                "it"
            )
    return lines


def _first_of_each(mentions: Sequence[Mention]) -> dict[int, Mention]:
    first: dict[int, Mention] = {}
    for mention in mentions:
        if mention.number is not None:
            first.setdefault(mention.number, mention)
    return first


def main(arguments: Sequence[str]) -> int:
    """Check the tree at the given root (default: this project) and return the exit
    status.
    """
    root = Path(arguments[0]) if arguments else Path(__file__).resolve().parents[1]
    cited = cited_in(root)
    tested = tested_in(root)
    lines = complaints(cited, tested)
    for line in lines:
        print(line)
    if not lines:
        print(f"{len(_first_of_each(cited))} equations cited, each with a test")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
