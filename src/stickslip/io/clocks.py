"""Times of day, with or without a date, as instruments write them."""

import datetime as dt
import re

DAY = 86400.0  # s
_DATES = {
    # 2024-02-01, 2024/02/01
    "year": r"(?P<year>\d{4})(?P<mark>[-/.])(?P<month>\d\d?)(?P=mark)(?P<day>\d\d?)",
    # 25.04.2026, 25.4.26
    "day": r"(?P<day>\d\d?)\.(?P<month>\d\d?)\.(?P<year>\d{4}|\d\d)",
    # 4/25/2026, only with AM or PM: otherwise the day may come first
    "month": r"(?P<month>\d\d?)/(?P<day>\d\d?)/(?P<year>\d{4})",
}
# Dates beside which only the time of the day counts, which begins anew at midnight:
# 5/4/2026 is in April or in May, and months have names in many languages.
_ANY_DATE = (
    r"(?:\d\d?/\d\d?/\d{4}|\d\d?[- ][^\W\d_]{3,9}\.?[- ]\d{4}"
    r"|[^\W\d_]{3,9}\.? \d\d?,? \d{4})"
)
# 12:00:01.234, and 12:00:01:234
_SECONDS = r"(?P<seconds>[0-5]\d(?:[.,]\d*|:\d{3})?)"
_TIME = rf"(?P<hours>\d{{1,3}}):(?P<minutes>[0-5]\d)(?::{_SECONDS})?"
_HALF = r"\s?(?P<half>[AaPp])\.?[Mm]\.?"
_MINUTES = r"(?P<minutes>\d{1,3}):(?P<seconds>[0-5]\d[.,]\d+)"  # as Excel shows them
_OFFSET = r"\s?(?:Z|UTC|(?P<sign>[-+])(?P<east>\d\d):?(?P<least>[0-5]\d)?)"
_BETWEEN = r"(?:[Tt]|,?\s)"
_CLOCKS = [
    re.compile(rf"(?:{_DATES['year']}{_BETWEEN})?{_TIME}(?:{_HALF})?(?:{_OFFSET})?"),
    re.compile(rf"{_DATES['day']}{_BETWEEN}{_TIME}(?:{_HALF})?(?:{_OFFSET})?"),
    re.compile(rf"{_DATES['month']}{_BETWEEN}{_TIME}{_HALF}(?:{_OFFSET})?"),
    re.compile(rf"{_ANY_DATE}{_BETWEEN}{_TIME}(?:{_HALF})?(?:{_OFFSET})?"),
    re.compile(_MINUTES),
]
_SINCE_1970 = {"s": 1e9, "ms": 1e12, "us": 1e15, "ns": 1e18}
"""Units of time since 1970, and how many had passed in 2001. By 2038, when a signed
32-bit count of seconds overflows, it is 2.2 times as many.
"""
_DAYS = (40_000.0, 60_000.0), (733_000.0, 753_000.0)
"""Days since 1900, as a spreadsheet counts them, and since the year 0, as MATLAB does,
in this century.
"""
_FIRST_DAY = dt.date(2000, 1, 1).toordinal()


def seconds_of(text: str) -> float | None:
    """Return the seconds since midnight of a time of day, or those since 2000 of one
    with a date (in UTC, if it has an offset); None if the text is no time.
    """
    match = next((found for each in _CLOCKS if (found := each.fullmatch(text))), None)
    if match is None:
        return None
    optional = ("hours", "half", "east", "least", "sign")
    fields: dict[str, str] = dict.fromkeys(optional, "") | match.groupdict("")
    hours = int(fields["hours"] or 0)
    if fields["half"]:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + 12 * (fields["half"] in "Pp")
    days = 0
    if fields.get("year"):
        year = int(fields["year"]) + (2000 if len(fields["year"]) == 2 else 0)
        try:
            date = dt.date(
                year,
                int(fields["month"]),
                int(fields["day"]),
            )
        except ValueError:  # a thirtieth of February
            return None
        days = date.toordinal() - _FIRST_DAY
    east = 3600.0 * int(fields["east"] or 0) + 60.0 * int(fields["least"] or 0)
    if fields["sign"] == "-":
        east = -east
    seconds = float(re.sub("[,:]", ".", fields["seconds"] or "0"))
    return DAY * days + 3600.0 * hours + 60.0 * int(fields["minutes"]) + seconds - east


def turn_of(text: str) -> float:
    """Return the seconds after which a time of day starts again: a day, or an hour if
    it holds minutes and seconds only.
    """
    return 3600.0 if re.fullmatch(_MINUTES, text.strip().strip('"')) else DAY


def are_days(first: float, last: float) -> bool:
    """Whether times look as the days of a spreadsheet or of MATLAB, within one day: in
    seconds they would be half a day after the begin, and all within a second.
    """
    of_this_century = [low <= first and last <= high for low, high in _DAYS]
    return any(of_this_century) and last - first < 1.0


def unit_since_1970(count: float) -> str:
    """Return the unit in which a number is a time since 1970 between 2001 and 2038;
    empty if there is none.
    """
    return next(
        (unit for unit, least in _SINCE_1970.items() if 1.0 <= count / least < 2.2),
        "",
    )
