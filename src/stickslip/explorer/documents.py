"""Rigs in the form of the page: the content of a rig file, as a plain mapping.

A field of the page shows the text in the document; all checks are made here, by
`stickslip.io`.
"""

import json
import math
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from pandas import json_normalize

from stickslip import io
from stickslip.errors import InputError, number, refused, shown
from stickslip.model import (
    Contacts,
    ElasticBody,
    Empirical,
    Rig,
    Scales,
    Slider,
    constant,
)
from stickslip.paper import CASES, PaperCase
from stickslip.plot import lasting
from stickslip.simulation import estimate, slowness
from stickslip.stability import PARAMETERS

Document = dict[str, Any]

# longest run of the page, in estimated seconds; a longer one is cut short
LONGEST = 4.0
# least fraction of a drive that a run must show; a shorter run is refused
SHORTEST = 0.02
MOST = {
    "contacts": 1_000_000,
    "samples": 200_000,
    "pieces": 1_000,
    "bins": 1_000,
    "blocks": 400,
}
"""Largest numbers of contacts, samples, pieces, bins and blocks that the page accepts,
so that it responds quickly.
"""
DIGITS = 5  # significant digits of the numbers that the page shows
DECADES = 15  # largest power of ten of a number of the model, in natural units
NARROWEST, WIDEST = 2e-3, 5.0
"""Bounds on the standard deviation of the thresholds over their mean, and on the sum of
both in ``x_s``: theory takes steps as small as the narrowest distribution and goes as
far as the widest.
"""

LARGEST_REQUEST = 1_000_000  # bytes of a message from the page, and of a document

# parameters of stability theory: the axes of the map
NAMES = tuple(parameter.name for parameter in PARAMETERS)

_BENCH = Scales(force=768.0, stretching=2e-6, time=5e-3)
"""Scales of a rig in natural units that is to be shown in SI: those of the example
pmma_slider.
"""


def from_json(content: str | bytes) -> object:
    """Read a message of a page: JSON of limited size, with finite numbers and texts
    that can be encoded.
    """
    if len(content) > LARGEST_REQUEST:
        raise InputError(
            f"this message has {len(content) / 1e6:.1f} MB, more than "
            f"{LARGEST_REQUEST / 1e6:g}"
        )
    try:
        found = json.loads(content)
        json.dumps(found, ensure_ascii=False, allow_nan=False).encode()
    except (ValueError, RecursionError):
        raise InputError("this message is no JSON") from None
    return found


def rig_of(document: object) -> Rig:
    """Make the rig of a document with a single slider; an elastic slider is refused."""
    rig = any_rig_of(document)
    if isinstance(rig.slider, ElasticBody):
        raise InputError(
            "rig: an elastic slider is shown on the page Fronts; here, give [slider]"
        )
    if not isinstance(rig.slider, Slider):
        raise InputError(
            "rig: the page shows a slider on a spring; give [slider] with a stiffness, "
            "or use `stickslip simulate`"
        )
    return rig


def any_rig_of(document: object) -> Rig:
    """Make the rig of a document, with a rigid or an elastic slider."""
    if not isinstance(document, Mapping):
        raise InputError("rig: must be a table with slider, interface and drive")
    return io.from_document(document)


def seconds_of(request: Mapping[str, Any]) -> float:
    """Return the seconds that the server allows for a run, by default `LONGEST`."""
    return float(request.get("seconds", LONGEST))


def values_of(rig: Rig) -> dict[str, float]:
    """Return the values of the parameters of the map, in the rig's own units."""
    found = {}
    for name in NAMES if rig.natural.velocity > 0 else ():
        with suppress(InputError):  # the rig has no such parameter
            if math.isfinite(value := rig.value(name)):
                found[name] = value
    return found


def of(rig: Rig) -> Document:
    """Return the document of a rig as the page shows it."""
    return io.to_document(rig, digits=DIGITS)


def shortened(rig: Rig, seconds: float) -> Rig:
    """Return the rig with its drive cut short, so that a run takes no longer than
    `seconds` by estimate; the rig itself if that would leave too little.
    """
    short = rig
    for _ in range(6):
        if (excess := estimate(short).reference_seconds / seconds) <= 1.0:
            return short
        if (
            not math.isfinite(excess)
            or short.drive.duration < SHORTEST * excess * rig.drive.duration
        ):
            break
        short = lasting(short, 0.95 / excess * short.drive.duration)
    return rig


def extended(rig: Rig, seconds: float) -> Rig | None:
    """Return the rig with a drive twice as long; None if that would take too long, or
    the drive is not constant.
    """
    try:
        longer = lasting(rig, 2.0 * rig.drive.duration)
    except InputError:
        return None
    return longer if estimate(longer).reference_seconds <= seconds else None


def rig_asked_for(request: Mapping[str, Any]) -> Rig:
    """Make the rig of a request, with the duration, in the rig's own units, of its run
    on the page, if given.
    """
    rig = rig_of(request.get("document"))
    duration = request.get("duration")
    if duration is None:
        return rig
    return lasting(rig, number("duration", duration, above=0) / rig.unit("time"))


def check_size(rig: Rig, seconds: float) -> None:
    """Raise `InputError` if a run would take too long for the page."""
    check_decades(rig)
    for name in ("thresholds", "initial", "newborn"):
        if isinstance(distribution := getattr(rig.interface, name), Empirical):
            check_count(f"interface.{name}", "bins", len(distribution.weights))
    check_count("drive.pieces", "pieces", len(rig.drive.pieces))
    if isinstance(rig.method, Contacts):
        check_count("simulation.contacts", "contacts", rig.method.count)
    samples = rig.drive.duration / (rig.output.interval or math.inf)
    check_count("simulation.interval", "samples", samples)
    if rig.slider.mass == 0:
        raise InputError(
            (
                "slider.mass = 0: must be above 0 for a run; theory of stability takes "
                "a "
                "slider without"
            ),
            "slider.mass",
        )
    check_work(rig, seconds)


def check_work(rig: Rig, seconds: float) -> None:
    """Raise `InputError` if a run takes longer than this on the machine on which costs
    were measured, so that all machines accept the same runs.
    """
    seconds *= slowness()
    estimate(rig).check(seconds, otherwise="use `stickslip simulate`")


def check_count(key: str, what: str, count: float) -> None:
    """Raise `InputError` if a number of contacts, samples and so on is too large for
    the page.
    """
    if count > MOST[what]:
        more = (
            f"at most {MOST[what]} {what}, here {count:.6g}, to stay live; for more "
            "use `stickslip simulate`"
        )
        raise InputError(f"{key}: must make {more}", key)


def check_decades(rig: Rig) -> None:
    """Raise `InputError` if a number is so far from the scales of the interface that
    arithmetic fails.
    """
    for key, value in json_normalize(io.to_document(rig.natural)).iloc[0].items():
        if (
            isinstance(value, float)
            and value
            and math.isfinite(value)
            and abs(math.log10(abs(value))) > DECADES
        ):
            raise InputError(
                (
                    f"{key}: is {value:.3g} in natural units; within {DECADES} decades "
                    "of "
                    "1 it can be computed with"
                ),
                str(key),
            )


def check_thresholds(rig: Rig) -> None:
    """Raise `InputError` if theory would take too long for the page, as it must resolve
    the distribution of thresholds.
    """
    thresholds = rig.interface.threshold_distribution
    mean = thresholds.moment(1)
    std = thresholds.standard_deviation()
    # written so that NaN is refused
    if not (std >= NARROWEST * mean and mean + std <= WIDEST):
        raise InputError(
            f"interface.thresholds.std = {std:.4g}: must be at least {NARROWEST:g} of "
            "the mean "
            f"({mean:.4g}), and both together at most {WIDEST:g}, for "
            "theory to answer at once",
            "interface.thresholds.std",
        )


def complaints(error: Exception) -> list[dict[str, str]]:
    """Return the mistakes in a document, each with its key (empty if there is none).

    If there are more mistakes than a rig has keys, they are reported in one line, which
    counts the rest, and not beside fields.
    """
    mistakes = error.mistakes if isinstance(error, InputError) else (error,)
    if len(mistakes) > sum(map(len, io.TABLES.values())):
        mistakes = (error,)
    return [
        {
            "key": getattr(mistake, "place", ""),
            "message": str(mistake).removeprefix("rig: "),
        }
        for mistake in mistakes
    ]


def with_parameters(document: Document, values: Mapping[str, Any]) -> Document:
    """Return a document with other values of some parameters, in the basic units of the
    document's own system (N/m, m/s, kg; natural).
    """
    rig = rig_of(document)
    for name, value in values.items():
        if name not in NAMES:
            raise InputError(
                f"{shown(name)}: is no parameter; there are {', '.join(NAMES)}"
            )
        rig = rig.with_values(**{name: number(name, value, above=0)})
    # Parameters are varied at constant eta, as on the map.
    ratio = _by_ratio(document) and not values.keys() & {"stiffness", "mass", "damping"}
    return _like(document, rig, damping_ratio=ratio)


def with_damping(document: Document, ratio: bool) -> Document:
    """Return a document with the damping given by its ratio, or as ``eta`` itself."""
    return _like(document, rig_of(document), damping_ratio=ratio)


def in_units(document: Document, units: str, scales: Any = None) -> Document:
    """Return a document in the other system of units, and the scales of the one in SI,
    so that it can be converted back.

    The default scales are those of the PMMA example.
    """
    if units not in ("SI", "natural"):
        raise refused("units", units, "must be 'SI' or 'natural'")
    rig = rig_of(document)
    if (units == "natural") == (rig.scales is None):
        return {"document": document}
    try:
        back = Scales(**scales) if scales else _BENCH
    except TypeError:
        words = "must be a table of force, stretching and time"
        raise refused("scales", scales, words) from None
    # The assumptions of a file hold only for its own numbers.
    converted = replace(rig, scales=None if rig.scales else back, assumed={})
    found = {"document": _like(document, converted, damping_ratio=_by_ratio(document))}
    return found | ({"scales": vars(rig.scales)} if rig.scales else {})


def _by_ratio(document: Document) -> bool:
    return "damping_ratio" in document["slider"]


def _like(document: Document, rig: Rig, *, damping_ratio: bool) -> Document:
    """Return the document of a rig, with the temperature as it was given."""
    made = io.to_document(rig, digits=DIGITS, damping_ratio=damping_ratio)
    if (heat := document["interface"].get("activation")) and document.get(
        "units"
    ) == made.get("units"):
        made["interface"]["activation"] = heat  # a rig keeps no kelvins
    return made


@lru_cache(maxsize=1)
def presets() -> tuple[dict[str, Any], ...]:
    """Return every preset: a group, a title and a document."""
    bench = first_document()
    shipped = _table("presets")
    short = paper(CASES["fig4"], "Sliding or stick-slip")
    short["simulation"]["contacts"] = 3_000
    short["drive"]["distance"] = 40.0
    warm = first_document() | {"name": "Warm teaching bench"}
    warm["interface"]["activation"] = shipped["heat"]
    titles = {
        "Teaching bench": bench,
        "Sliding or stick-slip? (natural units)": short,
        "Teaching bench, contacts broken by heat": warm,
    }
    found = [
        {"group": "Begin", "title": title, "document": document}
        for title, document in titles.items()
    ]
    found += [
        {"group": "Benches and machines", "title": rig.name, "document": of(rig)}
        for rig in map(io.example, io.example_names())
        # A slow fault with thermal contacts slips only twice in the longest run of a
        # page, too few for a verdict.
        if rig.name != bench["name"]
        and rig.interface.activation is None
        and isinstance(rig.slider, Slider)
    ]
    found += [
        {
            "group": "The paper, in natural units",
            "title": f"Fig. {figure}: {words}",
            "document": paper(CASES[f"fig{figure}"], f"Fig. {figure}"),
        }
        for figure, words in shipped["figures"].items()
    ]
    return tuple(found)


def page_content() -> dict[str, Any]:
    """Return the initial content of a page: presets, bars, the questions of the tour,
    and the explanation of each quantity and field.
    """
    shipped = _table("presets")
    bar = io.example("pmma_bar")
    bars = [*shipped["bars"], {"title": bar.name, "document": of(bar)}]
    return {
        "presets": presets(),
        "bars": bars,
        "tour": shipped["tour"],
        **_table("glossary"),
    }


def _table(name: str) -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parent / f"{name}.toml").read_text("utf-8"))


def first_document() -> Document:
    """Return the rig that the app begins with: the teaching bench with a shorter run,
    so that it responds quickly.
    """
    document = of(io.example("teaching_bench"))
    document["drive"]["distance"] = "60 mm"
    return document


def paper(case: PaperCase, name: str) -> Document:
    """Return a case of the paper as a document in natural units."""
    distance = 60.0 if case.interface.ageing is None else 30.0
    drive = constant(case.velocity, distance / case.velocity)
    return io.to_document(
        replace(
            case.rig, drive=drive, method=Contacts(case.contacts, seed=1), name=name
        ),
        digits=12,
    )
