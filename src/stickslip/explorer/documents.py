"""Rigs as the page holds them: the content of a rig file, as a plain mapping.

What the page shows in a field is what stands in the document; every check is made here, by `stickslip.io.rig_files`.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from stickslip import model
from stickslip.errors import InputError, number, shown
from stickslip.io import rig_files as rigs
from stickslip.model import RandomDelay
from stickslip.model.distributions import Empirical
from stickslip.model.rig import Rig
from stickslip.model.units import SI, Quantity, Scales, engineering, quantity
from stickslip.paper import cases
from stickslip.paper.cases import PaperCase
from stickslip.simulation import estimate
from stickslip.stability import PARAMETERS

Document = dict[str, Any]

LONGEST = 8.0
"""Seconds of a run, as estimated before it starts."""
MOST_SAMPLES = 200_000
"""Of a run; by default there are 50,000 at most, and a screen shows some thousands."""
MOST_PIECES = 1_000
"""Of a drive."""
MOST_BINS = 1_000
"""Of an empirical distribution of thresholds."""
DECADES = 15
"""Powers of ten of a number of the model, in natural units."""
NARROWEST, WIDEST = 2e-3, 5.0
"""Bounds on the standard deviation of the thresholds over their mean, and on both in ``x_s``: theory takes its steps by the
narrowest distribution and goes as far as the widest."""

LARGEST_REQUEST = 1_000_000
"""Bytes of a message from the page, and of a document."""
MOST_ITEMS = 100_000
"""Numbers, texts and tables in a message."""
DEEPEST = 12
"""Tables within tables in a message."""
LONGEST_TEXT = 2_000
"""Characters of a text in a message."""

QUANTITIES: Mapping[str, Quantity] = {
    parameter.name: "length" if parameter.unit == "1" else quantity(parameter.unit) for parameter in PARAMETERS
}
"""Parameters of the theory of stability, and what they are."""

_BENCH = Scales(force=768.0, stretching=2e-6, time=5e-3)
"""Scales for a rig in natural units that is to be shown in SI: those of the example pmma_slider."""


# ---------------------------------------------------------------------------------------------------------------------
# In
# ---------------------------------------------------------------------------------------------------------------------


def from_json(content: str | bytes) -> object:
    """Read what a page sends: JSON of bounded size, depth and numbers.

    Raises
    ------
    InputError
        If it is anything else.
    """
    if len(content) > LARGEST_REQUEST:
        raise InputError(f"this message has {len(content) / 1e6:.1f} MB, more than {LARGEST_REQUEST / 1e6:g}")
    try:
        found = json.loads(content, parse_int=_integer, parse_constant=_no_constant)
    except InputError:
        raise
    except (ValueError, RecursionError):
        raise InputError("this message is no JSON, or nested too deep") from None
    level, count = [found], 0
    for _ in range(DEEPEST):
        count += len(level)
        if count > MOST_ITEMS:
            raise InputError(f"this message holds more than {MOST_ITEMS} items")
        inner: list[object] = []
        for item in level:
            if isinstance(item, str):
                _check_text(item)
            elif isinstance(item, Mapping):
                inner += [*item, *item.values()]
            elif isinstance(item, list):
                inner += item
        level = inner
        if not level:
            return found
    raise InputError(f"this message is nested more than {DEEPEST} levels deep")


def _integer(text: str) -> int:
    if len(text) > 20:
        raise InputError(f"{text[:20]}...: a whole number in a message has at most 20 digits")
    return int(text)


def _no_constant(text: str) -> object:
    raise InputError(f"{text}: a number in a message must be finite")


def _check_text(text: str) -> None:
    if len(text) > LONGEST_TEXT:
        raise InputError(f"{shown(text)}: a text in a message has at most {LONGEST_TEXT} characters")
    if re.search(r"[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff]", text):
        raise InputError(f"{shown(text)}: holds characters that are no text")


def rig_of(document: object) -> Rig:
    """Make the rig that a document describes.

    Raises
    ------
    InputError
        As `stickslip.io.rig_files.from_document`, and if a run of it would keep the page waiting.
    """
    if not isinstance(document, Mapping):
        raise InputError("rig: must be a table with slider, interface and drive")
    assumed = document.get("assumed")
    if isinstance(assumed, Mapping):
        # A field of the page can take away a key that the file says was assumed.
        kept = {key: how for key, how in assumed.items() if _stands(document, str(key))}
        document = {**document, "assumed": kept}
    return rigs.from_document(document)


def _stands(document: Mapping[str, Any], path: str) -> bool:
    node: Any = document
    for part in path.split("."):
        if not isinstance(node, Mapping) or part not in node:
            return False
        node = node[part]
    return True


def check_size(rig: Rig) -> None:
    """Raise `InputError` if a run would keep the page waiting."""
    pieces = rig.drive.pieces
    elsewhere = "for longer ones use `stickslip simulate`"
    _check_decades(rig)
    if len(pieces) > MOST_PIECES:
        raise InputError(f"drive.pieces: must be at most {MOST_PIECES}, here {len(pieces)}, to stay live; {elsewhere}")
    for name in ("thresholds", "initial"):
        distribution = getattr(rig.interface, name)
        if isinstance(distribution, Empirical) and len(distribution.weights) > MOST_BINS:
            raise InputError(
                f"interface.{name}: must have at most {MOST_BINS} bins, here {len(distribution.weights)}, to stay live"
            )
    samples = 0.0 if rig.output.interval is None else rig.drive.duration / rig.output.interval
    if samples > MOST_SAMPLES:
        raise InputError(
            f"simulation.interval = {rig.in_units(rig.output.interval or 0.0, 'time')}: must be at least "
            f"{rig.in_units(rig.drive.duration / MOST_SAMPLES, 'time')} in a run of this length ({MOST_SAMPLES} "
            f"samples), to stay live; {elsewhere}"
        )
    estimate(rig).check(LONGEST, otherwise="use `stickslip simulate`")


def _check_decades(rig: Rig) -> None:
    """Raise `InputError` if a number is so far from the scales of the interface that arithmetic fails."""
    interface, slider, ageing = rig.interface, rig.slider, rig.interface.ageing
    delay, thresholds = interface.delay, interface.thresholds
    found = {
        "slider.stiffness": [slider.stiffness],
        "slider.mass": [slider.mass],
        "slider.damping": [slider.damping],
        "drive.velocity": [speed for piece in rig.drive.pieces for speed in (piece.start, piece.end)],
        "drive.duration": [piece.duration for piece in rig.drive.pieces],
        "interface.delay": [value for value in vars(delay).values() if isinstance(value, float)],
        "interface.ageing": [value for value in vars(ageing).values() if isinstance(value, float)] if ageing else [],
        "interface.thresholds": [thresholds.moment(1), thresholds.standard_deviation()],
    }
    for key, values in found.items():
        for value in values:
            never = key == "interface.delay" and math.isinf(value)
            if not (value == 0 or never or 10.0**-DECADES <= abs(value) <= 10.0**DECADES):
                raise InputError(
                    f"{key}: is {value:.3g} in natural units; within {DECADES} decades of 1 it can be computed with"
                )


def check_thresholds(rig: Rig) -> None:
    """Raise `InputError` if theory would keep the page waiting: it resolves the distribution of thresholds."""
    thresholds = rig.interface.thresholds
    mean, std = thresholds.moment(1), thresholds.standard_deviation()
    if not (std >= NARROWEST * mean and mean + std <= WIDEST):  # written so that NaN is refused
        raise InputError(
            f"interface.thresholds.std = {std:.4g}: must be at least {NARROWEST:g} of the mean "
            f"({mean:.4g}), and both together at most {WIDEST:g}, for what theory says of them, to stay live"
        )


_KEY = re.compile(r"\b(?:slider|interface|drive|simulation|units|name|assumed)(?:\.[a-z_0-9]+)+")
_OF_RECORDS = {
    "Slider.": "slider.",
    "Contacts.count": "simulation.contacts",
    "Contacts.seed": "simulation.seed",
    "MasterEquation.cells": "simulation.cells",
    "Output.interval": "simulation.interval",
    "FromSliding": "simulation.start",
    "Langevin.rate": "interface.ageing.time",
    "Interface.initial": "interface.initial",
    "Interface.ageing": "interface.ageing",
    "Interface.delay": "interface.delay",
    "Delay.time": "interface.delay",
    "RandomDelay.": "interface.delay.",
    "Scales.force": "interface.contact_strength",
    "Scales.stretching": "interface.breaking_displacement",
    "Piece.duration": "drive.distance",
    "Piece.": "drive.velocity",
    "drive:": "drive.velocity",
    "velocity": "drive.velocity",
}
_KEY_OF_RECORD = re.compile("|".join(rf"(?<![\w.]){re.escape(name)}(\w*)" for name in _OF_RECORDS))


def complaints(error: Exception, document: object = None) -> list[dict[str, str]]:
    """Return what is wrong, each with the key of the document that it is about (empty if there is none)."""
    text = str(error).removeprefix("rig: ")
    return [
        {"key": _key(part, document), "message": part.strip()}
        for part in re.split(r"; (?=[a-z]+\.[a-z_.]+(?: = |: ))", text)
    ]


def _key(text: str, document: object) -> str:
    if "needs a mass above 0" in text:
        return "slider.mass"
    if found := _KEY.search(text):
        return found[0]
    if found := _KEY_OF_RECORD.search(text):
        name = next(name for name in _OF_RECORDS if found[0].startswith(name))
        return _OF_RECORDS[name] + (found[0].removeprefix(name) if _OF_RECORDS[name].endswith(".") else "")
    if re.match(r"(Gaussian|Uniform|Exponential|Gamma|LogNormal|Weibull|Empirical)\b", text):
        return "interface." + _faulty_distribution(document)
    return ""


def _faulty_distribution(document: object) -> str:
    """Which of the two distributions of a document cannot be made; errors of a distribution do not say whose it is."""
    plain = deepcopy(document)
    if not isinstance(plain, dict) or not isinstance(plain.get("interface"), dict):
        return "thresholds"
    plain["interface"].pop("initial", None)
    try:
        rigs.from_document(plain)
    except InputError:
        return "thresholds"
    return "initial"


# ---------------------------------------------------------------------------------------------------------------------
# Changed
# ---------------------------------------------------------------------------------------------------------------------


def turned(rig: Rig, values: Mapping[str, Any]) -> Document:
    """Return the document of a rig with some parameters varied.

    Parameters
    ----------
    rig : Rig
    values : mapping of str to float
        Parameter and value, in the basic unit of the rig's own system (N/m, m/s, kg, 1/s, s, m; or natural).

    Raises
    ------
    InputError
        If the rig has no such parameter.
    """
    document = deepcopy(dict(rig.document))
    slider, interface, drive = (_table(document, name) for name in ("slider", "interface", "drive"))
    for name, value in values.items():
        if name not in QUANTITIES:
            raise InputError(f"{shown(name)}: is no parameter; there are {', '.join(QUANTITIES)}")
        value = number(name, value, above=0)
        natural = value if rig.scales is None else rig.scales.natural(value, QUANTITIES[name])
        if name in ("stiffness", "mass", "damping"):
            # A parameter is turned at constant eta, as on the map.
            if slider.pop("relative_damping", None) is not None:
                slider["damping"] = _written(rig.slider.damping, "rate", rig.scales)
            slider[name] = _written(natural, QUANTITIES[name], rig.scales)
        elif name == "velocity":
            if "velocity" not in drive:
                raise InputError("drive.pieces: this drive is a ramp; its velocity is not one number to turn")
            drive["velocity"] = _written(natural, "velocity", rig.scales)
        elif name == "delay":
            delay = rig.interface.delay
            if isinstance(delay, RandomDelay) and delay.mean > 0:
                std = delay.std * natural / delay.mean
                interface["delay"] = {
                    "mean": _written(natural, "time", rig.scales),
                    "std": _written(std, "time", rig.scales),
                    "negative": delay.negative,
                }
            else:
                interface["delay"] = _written(natural, "time", rig.scales)
        elif name == "ageing":
            if not isinstance(rig.interface.ageing, model.Langevin):
                raise InputError("interface.ageing: these thresholds do not age by langevin; there is no time to turn")
            interface["ageing"]["time"] = _written(natural, "time", rig.scales)
        else:
            distribution = _table(interface, "thresholds")
            if "std" not in distribution:
                raise InputError("interface.thresholds: this distribution has no standard deviation of its own to turn")
            distribution["std"] = _short(natural)
    return document


def with_damping(rig: Rig, relative: bool) -> Document:
    """Return the document with the damping given as ``eta/Omega``, or as ``eta`` itself."""
    document = deepcopy(dict(rig.document))
    slider = _table(document, "slider")
    slider.pop("damping", None)
    slider.pop("relative_damping", None)
    if relative:
        slider["relative_damping"] = _short(rig.slider.damping / rig.slider.frequency)
    else:
        slider["damping"] = _written(rig.slider.damping, "rate", rig.scales)
    return document


def in_units(rig: Rig, units: str) -> Document:
    """Return the document of a rig in the other system of units.

    A rig in natural units has no scales; it gets those of the PMMA bench among the examples.
    """
    if units not in ("SI", "natural"):
        raise InputError(f"units = {shown(units)}: must be 'SI' or 'natural'")
    document = deepcopy(dict(rig.document))
    if (units == "natural") == (rig.scales is None):
        return document
    scales = _BENCH if units == "SI" else None
    slider, interface, drive = (_table(document, name) for name in ("slider", "interface", "drive"))
    document["units"] = units
    slider["mass"] = _written(rig.slider.mass, "mass", scales)
    slider["stiffness"] = _written(rig.slider.stiffness, "stiffness", scales)
    if "damping" in slider:
        slider["damping"] = _written(rig.slider.damping, "rate", scales)
    for key in ("contact_strength", "normal_load", "friction_coefficient", "breaking_displacement"):
        interface.pop(key, None)
    if scales is not None:
        interface["contact_strength"] = _written(1.0, "force", scales)
        interface["breaking_displacement"] = _written(1.0, "length", scales)
    delay = rig.interface.delay
    if isinstance(delay, RandomDelay):
        interface["delay"]["mean"] = _written(delay.mean, "time", scales)
        interface["delay"]["std"] = _written(delay.std, "time", scales)
    elif "delay" in interface and interface["delay"] != "never":
        interface["delay"] = _written(delay.moment(1), "time", scales)
    ageing = rig.interface.ageing
    if isinstance(ageing, (model.Langevin, model.ExponentialGrowth)):
        rate = ageing.rate**2 if isinstance(ageing, model.Langevin) else ageing.rate
        interface["ageing"]["time"] = _written(1.0 / rate, "time", scales)
    elif ageing is not None:
        interface["ageing"]["time"] = _written(ageing.time, "time", scales)
    if "pieces" in drive:
        drive["pieces"] = [
            {
                "start": _written(piece.start, "velocity", scales),
                "end": _written(piece.end, "velocity", scales),
                "duration": _written(piece.duration, "time", scales),
            }
            for piece in rig.drive.pieces
        ]
    else:
        velocity, duration = rig.natural.velocity, rig.drive.duration
        drive["velocity"] = _written(velocity, "velocity", scales)
        if "duration" in drive:
            drive["duration"] = _written(duration, "time", scales)
        else:
            drive["distance"] = _written(abs(velocity) * duration, "length", scales)
    if rig.output.interval is not None:
        _table(document, "simulation")["interval"] = _written(rig.output.interval, "time", scales)
    document.pop("assumed", None)  # its sentences are about the numbers of the file
    return document


def _table(document: Document, name: str) -> Document:
    part = document.setdefault(name, {})
    document[name] = part = dict(part)
    return part


def _written(value: float, quantity: Quantity, scales: Scales | None) -> float | str:
    """A natural value as it stands in a document."""
    return _short(value) if scales is None else engineering(scales.si(value, quantity), SI[quantity])


def _short(value: float) -> float:
    return float(f"{value:.5g}")


# ---------------------------------------------------------------------------------------------------------------------
# Presets
# ---------------------------------------------------------------------------------------------------------------------

_FIGURES = {
    1: (cases.FIG1, "no delay, narrow start"),
    2: (cases.FIG2, "elastic instability"),
    3: (cases.FIG3, "critical stiffness"),
    4: (cases.FIG4, "delay .2: stick-slip"),
    5: (cases.FIG5, "broken contacts never re-attach"),
    6: (cases.FIG6, "critical delay"),
    7: (cases.FIG7, "transitions in velocity"),
    8: (cases.FIG8, "ageing contacts"),
    9: (cases.FIG9, "ageing, against velocity"),
    10: (cases.FIG10, "ageing, against its rate"),
    11: (cases.FIG11, "ageing, slower"),
}


def presets() -> list[dict[str, Any]]:
    """Return every preset: a group, a title and a document."""
    found: list[dict[str, Any]] = [{"group": "Begin", "title": "Sliding or stick-slip?", "document": first()}]
    for figure, (case, words) in _FIGURES.items():
        title = f"Fig. {figure}: {words}"
        found.append({"group": "The paper", "title": title, "document": paper(case, f"Fig. {figure}")})
    for file in sorted(rigs.EXAMPLES.glob("*.toml")):
        try:
            document = tomllib.loads(file.read_text())
            rig_of(document)
        except (InputError, tomllib.TOMLDecodeError, UnicodeDecodeError):
            continue  # sweeps and maps lie there, too
        found.append({"group": "Rigs", "title": str(document.get("name", file.stem)), "document": document})
    return found


def first() -> Document:
    """Return the rig that the app begins with: Fig. 4 of the paper, with fewer contacts over a shorter distance."""
    document = paper(cases.FIG4, "Sliding or stick-slip")
    document["simulation"]["contacts"] = 3_000
    document["drive"]["distance"] = 40.0
    return document


def paper(case: PaperCase, name: str) -> Document:
    """Return a case of the paper as a document in natural units."""
    interface, slider = case.interface, case.slider
    thresholds, initial, delay = interface.thresholds, interface.initial, interface.delay
    relative = round(slider.damping / slider.frequency, 6)
    parts: Document = {
        "thresholds": {
            "distribution": "gaussian",
            "mean": thresholds.moment(1),
            "std": thresholds.standard_deviation(),
        },
        "initial": {"distribution": "gaussian", "mean": initial.moment(1), "std": initial.standard_deviation()},
    }
    for distribution in parts.values():
        distribution.update({key: _short(distribution[key]) for key in ("mean", "std")})
    if delay.moment(1) > 0:
        parts["delay"] = "never" if math.isinf(delay.moment(1)) else delay.moment(1)
    if isinstance(interface.ageing, model.Langevin):
        parts["ageing"] = {"distribution": "langevin", "time": float(f"{interface.ageing.rate**-2:.12g}")}
    damping = {"relative_damping": relative} if relative in (0.1, 0.3) else {"damping": slider.damping}
    distance = 60.0 if interface.ageing is None else 30.0
    return {
        "name": name,
        "units": "natural",
        "slider": {"mass": slider.mass, "stiffness": slider.stiffness, **damping},
        "interface": parts,
        "drive": {"velocity": case.velocity, "distance": distance},
        "simulation": {"method": "contacts", "contacts": case.contacts, "seed": 1, "cells": 100, "start": "relaxed"},
    }
