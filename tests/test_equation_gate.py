"""The gate that ties the paper's equations in the code to their tests."""

import equations
import pytest

# The marks below are inside strings: the gate must not see them when it reads this very
# file.
MARK = "@pytest.mark." + "eq"


@pytest.fixture
def tree(tmp_path):
    """Write a small project and return the gate's exit status and lines."""

    def check(capsys, *, src="", tests=""):
        for folder, text in (("src/pack", src), ("tests", tests)):
            (tmp_path / folder).mkdir(parents=True)
            (tmp_path / folder / "test_a.py").write_text(text)
        status = equations.main([str(tmp_path)])
        return status, capsys.readouterr().out.splitlines()

    return check


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("Eq. (8)", [8]),
        ("see eq. (8), which", [8]),
        ("Equation (12) of the paper", [12]),
        ("Eqs. (1)-(4)", [1, 2, 3, 4]),
        ("Eqs. (1)\N{EN DASH}(4) and (10)", [1, 2, 3, 4, 10]),
        ("Eqs. (1) to (3)", [1, 2, 3]),
        ("Eqs. (1), (3), and (8); (9) is a number", [1, 3, 8]),
        ("# Eqs. (1),\n    # (3)", [1, 3]),
        ("Eq. (8), a distribution (2) of two", [8]),
        ("Eq. 8 and Eqs. 1-4", [None, None]),
        ("Eqs. (1-4)", [None]),
        ("Eq. (n), the equals sign, eq(3)", []),
    ],
)
def test_citations_are_read_in_every_usual_form(text, numbers):
    assert [mention.number for mention in equations.citations(text, "a.py")] == numbers


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        (f"{MARK}(3)\ndef test(): ...", [3]),
        (
            f"{MARK}(3, 4)\nclass TestX:\n    {MARK}(9)\n    def test(self): ...",
            [3, 4, 9],
        ),
        (f"pytestmark = [{MARK[1:]}(1), pytest.mark.slow]", [1]),
        (f"cases = [pytest.param(0, marks={MARK[1:]}(2))]", [2]),
        (
            (
                f"from pytest import mark\n{MARK.replace('pytest.', '')}(5)\ndef "
                "test(): "
                "..."
            ),
            [5],
        ),
        (f"{MARK}\ndef test(): ...", [None]),
        (f"{MARK}('8')\ndef test(): ...", [None]),
        (f"'''{MARK}(3)'''  # {MARK}(4)", []),
    ],
)
def test_marks_are_read_from_the_syntax_tree(text, numbers):
    assert [mention.number for mention in equations.marks(text, "a.py")] == numbers


@pytest.mark.parametrize(
    ("src", "tests", "said"),
    [
        (
            '"""Eqs. (1)-(2)."""',
            f"{MARK}(1)\n{MARK}(2)\ndef test(): ...",
            ["2 equations cited, each with a test"],
        ),
        (
            '"""\nEqs. (3), (99).\nEq. (3)\n"""',
            f"\n{MARK}(8)\ndef test(): ...",
            [
                "Eq. (3): cited in src/pack/test_a.py:2, but no test is marked eq(3)",
                "Eq. (8): tested in tests/test_a.py:2, but nothing in src cites it",
                "Eq. (99): named in src/pack/test_a.py:2, but the paper's last is (18)",
            ],
        ),
    ],
)
def test_each_lonely_equation_is_one_line_with_its_place(
    tree, capsys, src, tests, said
):
    status, lines = tree(capsys, src=src, tests=tests)
    assert lines == said
    assert status == (len(said) > 1)


def test_what_cannot_be_read_is_not_passed_over(tree, capsys):
    status, lines = tree(capsys, src="# Eq. 8", tests=f"{MARK}()\ndef test(): ...")
    assert status == 1
    assert [line.partition(": ")[0] for line in lines] == [
        "src/pack/test_a.py:1",
        "tests/test_a.py:1",
    ]
