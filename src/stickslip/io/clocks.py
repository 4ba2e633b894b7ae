"""Times of day, with or without a date, as instruments write them."""

import datetime as dt
import re
from functools import lru_cache

DAY = 86400.0  # s
_DATE = (
    r"\d{4}(?P<mark>[-/.])\d\d?(?P=mark)\d\d?"  # 2024-02-01, 2024/02/01
    r"|\d\d?\.\d\d?\.(?:\d{4}|\d\d)"  # 25.04.2026, 25.4.26
    # 5/4/2026 is in April or in May, and months have names in many languages
    r"|\d\d?/\d\d?/\d{4}|\d\d?[- ][^\W\d_]{3,9}\.?[- ]\d{4}"
    r"|[^\W\d_]{3,9}\.? \d\d?,? \d{4}"
)
# 12:00:01.234, and 12:00:01:234
_SECONDS = r"(?P<seconds>[0-5]\d(?:[.,]\d*|:\d{3})?)"
_TIME = rf"(?P<hours>\d{{1,3}}):(?P<minutes>[0-5]\d)(?::{_SECONDS})?"
_HALF = r"(?:\s?(?P<half>[AaPp])\.?[Mm]\.?)?"
_OFFSET = r"(?:\s?(?:Z|UTC|(?P<sign>[-+])(?P<east>\d\d):?(?P<least>[0-5]\d)?))?"
_CLOCK = re.compile(rf"(?:(?P<date>{_DATE})(?:[Tt]|,?\s))?{_TIME}{_HALF}{_OFFSET}")
_MINUTES = re.compile(r"(\d{1,3}):([0-5]\d[.,]\d+)")  # 02:03.4, as Excel shows them
_SINCE_1970 = {"s": 1e9, "ms": 1e12, "us": 1e15, "ns": 1e18}
"""Units of times since 1970, and the time in 2001 in each. In 2038, when a signed
32-bit number of seconds overflows, the time is 2.2 times as long.
"""
_DAYS = (40_000.0, 60_000.0), (733_000.0, 753_000.0)
"""Ranges of days in this century: counted from 1900, as in a spreadsheet, and from the
year 0, as in MATLAB.
"""
_FIRST_DAY = dt.date(2000, 1, 1).toordinal()


def seconds_of(text: str) -> float | None:
    """Return the seconds since midnight of a time of day, or since 2000 of a time with
    a date (in UTC, if it has an offset); None if the text is no time.
    """
    if short := _MINUTES.fullmatch(text):
        return 60.0 * int(short[1]) + float(short[2].replace(",", "."))
    match = _CLOCK.fullmatch(text)
    if match is None:
        return None
    fields = match.groupdict("0")
    hours = int(fields["hours"])
    has_half = match["half"] is not None
    if has_half:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + 12 * (fields["half"] in "Pp")
    try:
        days = _days_since_2000(fields["date"], month_first=has_half)
    except ValueError:  # a thirtieth of February
        return None
    east = 3600.0 * int(fields["east"]) + 60.0 * int(fields["least"])
    if fields["sign"] == "-":
        east = -east
    seconds = float(re.sub("[,:]", ".", fields["seconds"]))
    return DAY * days + 3600.0 * hours + 60.0 * int(fields["minutes"]) + seconds - east


@lru_cache(maxsize=256)
def _days_since_2000(date: str, *, month_first: bool) -> int:
    """Return the days from 2000-01-01 to a date, or 0 if the order of day and month is
    not known, or there is no date: then only the time of day counts, and it starts
    again at midnight. Raises `ValueError` if there is no such date.

    A date with slashes has the `month_first` beside AM or PM.
    """
    numbers = map(int, re.findall(r"\d+", date))
    if re.match(r"\d{4}", date):
        year, month, day = numbers
    elif re.fullmatch(r"\d+\.\d+\.\d+", date):
        day, month, year = numbers
    elif month_first and "/" in date:
        month, day, year = numbers
    else:
        return 0
    century = 2000 if year < 100 else 0
    return dt.date(century + year, month, day).toordinal() - _FIRST_DAY


def turn_of(text: str) -> float:
    """Return the seconds after which a time of day starts again: those of a day, or of
    an hour if the text holds only minutes and seconds.
    """
    return 3600.0 if _MINUTES.fullmatch(text.strip().strip('"')) else DAY


def are_days(first: float, last: float) -> bool:
    """Return whether times are likely days of a spreadsheet or of MATLAB, within one
    day: as seconds, they would begin half a day late, and span less than a second.
    """
    of_this_century = [low <= first and last <= high for low, high in _DAYS]
    return any(of_this_century) and last - first < 1.0


def unit_since_1970(count: float) -> str:
    """Return the unit in which a number is a time since 1970, between 2001 and 2038;
    an empty text if there is none.
    """
    for unit, least in _SINCE_1970.items():
        if 1.0 <= count / least < 2.2:
            return unit
    return ""
