"""Quantities: one strict grammar, exact values, and nothing is misread."""

import math
import sys
import time
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.errors import InputError
from stickslip.model.quantities import LONGEST_QUANTITY, read_number, read_quantity


def refusal(text, unit="N/m"):
    with pytest.raises(InputError) as caught:
        read_quantity(text, unit, "4 MN/m")
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 200
    return message


READ = """4 MN/m = 4e6 N/m | 4\u00a0MN/m = 4e6 N/m | 4.0e3 kN/m = 4e6 N/m | 1 h = 60 min
+.5 N/m = 0.5 N/m | -0.4 mm/s = -4e-4 m/s | 0 N = 0 N | 4 kg/s² = 4 N/m
2 um = 2e-6 m | 7 \u03bcm = 7e-6 m | 7 µm = 7e-6 m | 7 micron = 7e-6 m | 3 Å = 3e-10 m
200 1/s = 200 1/s | 200 s^-1 = 200 1/s | 200 s⁻¹ = 200 1/s | 4 kg*m/(s^2*m) = 4 N/m
3 t = 3e3 kg | 5 daN = 50 N | 1 kgf = 9.80665 N | 1 lbf = 4.4482216152605 N
36 km/h = 10 m/s | 3 kN/m = 3 N/mm | 4 MN·m⁻¹ = 4e6 N/m | 2 um = 0.002 mm"""
READINGS = [
    ("1 lbf/in", 4.4482216152605 / 0.0254, "N/m"),
    ("30 mm/yr", 0.03 / (365.25 * 86400), "m/s"),
]
for each in READ.replace("\n", " | ").split(" | "):
    text, meaning = each.split(" = ")
    READINGS.append((text, *meaning.split(" ", 1)))


@pytest.mark.parametrize(("text", "value", "unit"), READINGS)
def test_what_is_well_written_is_read(text, value, unit):
    # Sizes are exact, rounded once; the right-hand sides are rounded once or twice.
    expected = pytest.approx(float(value), rel=3e-16, abs=0)
    assert read_quantity(text, unit, "") == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("4,0 MN/m", "write '4.0 MN/m': decimal point, not comma"),
        ("1.000,5 N/m", "write '1000.5 N/m'"),
        ("1,200 N/m", "one number with a decimal point and its unit"),
        ("1 200 N/m", "write '1200 N/m'"),
        ("\u22122 N/m", "write '-2 N/m'"),
        ("200 s-1", "write '200 s^-1'"),
        ("2 N s/m", "write '2 N*s/m'"),
        ("4 N/m*s", "two ways"),
        ("4", "has no unit"),
        ("12 pound", "'lb' or 'lbf'"),
        ("3 mil", "write it in 'um'"),
        ("3 kt", "knots or kilotonnes"),
        ("3 Hz", "write '1/s'"),
        ("4 N", "not in a unit of"),
        ("1 1/(m*s²)", "not in a unit of"),
        ("-inf N/m", "finite"),
        ("1e999 N/m", "finite"),
        ("1e-320 N/m", "too small for double precision"),
    ],
)
def test_a_refusal_says_what_would_be_right(text, words):
    assert words in refusal(text)


WRONG = (
    "\u221e N/m|~2 N/m|$2 N/m|2 N/m;|2(1) N/m|4 N/m\u0000|2\u20133 N/m|4 MN/m 2|[1,2] "
    "N/m|1..2 N/m|N/m|pi N/m|"
    "m|| |-|.|e|1 pi|2 c|1 k|1 hbar|1 m_e|1 R|1 G|4 gal|4 hp|9**9**9**9 N/m|4 "
    "N^9^9/m|4 N/m^99|4 N/m^0|"
    "4 N/m^1.5|4 N\u00b2\u00b2/m|4 N/m\u2074|4\u00b2 N/m|\uff14 N/m|4^2 N/m|0x10 "
    "N/m|1e N/m|1e1e1 N/m|--4 N/m|"
    "- 4 N/m|4 N/m\u000a|4\u0009N/m|4 N/m # stiff|4 N//m|4 N/|4 *N/m|4 N/(m|4 "
    "((N))/m|4 N/()|(4 N/m)|4*N/m|"
    "4 N+2 N|4 N/m, 5 N/m|1/2 N/m|4 2/s|4 %|4 N per m|4 degC|4 rad/s|4 NN/m|4 kmin|4 "
    "dd|4 mPas|4 das|4 ma|"
    "4 mn/m|4 N/M|4 KN/m|4 Kg|4 Sec|4 Newton|4 Ns/m|4 Nm|4 __class__|4 N.m|4 "
    "sqrt(N)|True|1j N|4 N/m\u200b|"
    "4 N/\u043c|4e3\u00b2 N/m"
)
JUNK = [
    *WRONG.split("|"),
    "9" * 65,
    "4 N" + "N" * 100_000,
    "4." + "0" * 100_000 + " N/m",
    "(" * 64,
    "4 " + "N*" * 31,
]
JUNK += ["4 " + "m*" * 30 + "m", "4 " + "m**9*" * 12 + "m"]
JUNK += [head + "Qm^9*" * 11 + tail for head, tail in (("4 ", "Qm^9"), ("1e999 ", "m"))]
JUNK += [" " * 64, "9*N m^(" * 12]


def test_junk_is_refused_at_once():
    begun = time.process_time()
    for text in JUNK:
        refusal(text)
        with pytest.raises(InputError):
            read_number(text)
    assert time.process_time() - begun < 2.0


PREFIXES = {"": 1, "k": 1000, "M": 10**6, "m": Fraction(1, 10**3)}
PREFIXES["u"] = Fraction(1, 10**6)
UNITS = {"m": (1, 0, 0), "g": (0, 1, 0), "s": (0, 0, 1)}
UNITS |= {"N": (1, 1, -2), "Pa": (-1, 1, -2), "J": (2, 1, -2)}
SIZES = {
    "in": (Fraction(254, 10**4), (1, 0, 0)),
    "t": (Fraction(1000), (0, 1, 0)),
    "min": (Fraction(60), (0, 0, 1)),
    "kgf": (Fraction("9.80665"), (1, 1, -2)),
}
for p, size in PREFIXES.items():
    for u, kind in UNITS.items():
        SIZES[p + u] = Fraction(size) / (1000 if u == "g" else 1), kind
"""Units as powers of metres, kilograms and seconds, which this test defines without a
library.
"""

RAISED = {"²": 2, "³": 3, "⁻¹": -1, "⁻²": -2, "¹": 1}

plain = st.from_regex(
    r"[-+]?(?:[0-9]{1,9}(?:\.[0-9]{0,9})?|\.[0-9]{1,9})(?:[eE][-+]?[0-9]{1,2})?",
    fullmatch=True,
)
SIGNS = st.tuples(st.sampled_from(["^", "**"]), st.integers(-3, 3).filter(bool))
exponents = st.one_of(
    st.just(("", 1)),
    st.sampled_from(sorted(RAISED.items())),
    SIGNS.map(lambda p: (f"{p[0]}{p[1]}", p[1])),
)
powers = st.tuples(st.sampled_from(sorted(SIZES)), exponents)


@settings(max_examples=200)
@given(
    plain,
    st.lists(powers, min_size=1, max_size=3),
    st.lists(powers, max_size=2),
    st.sampled_from(["*", "·", " * "]),
    st.sampled_from(["", " ", "  "]),
)
def test_what_is_accepted_is_a_number_times_a_unit(number, above, below, times, blank):
    exact = Fraction(number)
    kind = (0, 0, 0)
    sides = []
    for factors, sign in ((above, 1), (below, -1)):
        sides.append(times.join(name + mark for name, (mark, _) in factors))
        for name, (_, power) in factors:
            size, parts = SIZES[name]
            exact *= size ** (sign * power)
            kind = tuple(a + sign * power * b for a, b in zip(kind, parts, strict=True))
    text = number + blank + sides[0] + (f" / ({sides[1]})" if below else "")
    powers = zip(("m", "kg", "s"), kind, strict=True)
    parts = [f"{base}^{power}" for base, power in powers if 0 < abs(power) < 10]
    wanted = "*".join(parts)
    is_long = len(text) > LONGEST_QUANTITY
    if is_long or not wanted or any(abs(power) > 9 for power in kind):
        return
    try:
        expected = float(exact)
    except OverflowError:
        expected = math.inf
    if math.isinf(expected) or (exact and abs(expected) < sys.float_info.min):
        refusal(text, wanted)
    else:
        assert read_quantity(text, wanted, "") == expected


def test_plain_numbers():
    well_written = {"0.5": 0.5, "-1e3": -1e3, " 7 ": 7.0, "+.5": 0.5, "4.": 4.0}
    well_written["007"] = 7.0
    assert {text: read_number(text) for text in well_written} == well_written
    strange = ["", "²", "0,5", "1_000", "0x10", "nan", "-infinity", "1e999", "1e-320"]
    strange += ["9" * 5000, "1 2", "4 s", "٣"]
    for text in (*strange, "\u22122"):
        with pytest.raises(InputError) as caught:
            read_number(text)
        assert len(str(caught.value)) < 150
