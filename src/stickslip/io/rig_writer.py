"""Rigs written as the content of rig files: the shortest text that reads back the same."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import groupby
from typing import Any

from stickslip.errors import InputError, shown
from stickslip.io import rig_keys
from stickslip.io.keys import Key
from stickslip.io.rig_keys import keys_of
from stickslip.model import Delay, ElasticBody, FromRest, FromSliding, Gaussian, Piece, Prestressed, Slider
from stickslip.model.body import BODIES
from stickslip.model.delays import OnArrest
from stickslip.model.distributions import Distribution
from stickslip.model.drive import USUAL_DISTANCE
from stickslip.model.methods import METHODS
from stickslip.model.parameters import parameter_named
from stickslip.model.quantities import read_quantity
from stickslip.model.rig import Rig
from stickslip.model.units import Scales, engineering, si_unit

Document = dict[str, Any]
Same = Callable[[float], bool]
"""Whether a value in the units of the file is the one to be written."""


class RigWriter:
    """Writes the records of a rig as the tables of a file; without scales every quantity is a plain number."""

    def __init__(self, rig: Rig, digits: int | None) -> None:
        self.rig, self.digits, self.natural = rig, digits, rig.scales is None
        self.scales = rig.scales or Scales(force=1.0, stretching=1.0)

    def document(self, damping_ratio: bool | None) -> Document:
        """The content of the file."""
        rig = self.rig
        feasible = {
            name: [self._quantity(end, parameter_named(name).unit) for end in ends]
            for name, *ends in rig.operation.feasible
        }
        optional = {
            "feasible": feasible,
            "assumed": {key: item.how for key, item in rig.assumed.items() if not item.default},
            "fitted": {
                key: {"interval": one.interval, "how": one.how, "draws": list(one.draws)}
                for key, one in rig.fitted.items()
            },
        }
        return (
            {"name": rig.name}
            | ({"units": "natural"} if self.natural else {})
            | ({"source": rig.source} if rig.source else {})
            | self._body(damping_ratio)
            | {"interface": self._interface(), "drive": self._drive(), "simulation": self._simulation()}
            | {name: table for name, table in optional.items() if table}
        )

    def _refuse(self, what: str) -> InputError:
        return InputError(f"rig {self.rig.name!r}: {what} cannot be written into a rig file")

    # -------------------------------------------------- records

    def _values(self, record: Any, keys: Mapping[str, Key], *, defaults: bool = True) -> Document:
        """The fields of a record that its table has keys for; those that have their default may be left out."""
        found: Document = {}
        for name, key in keys.items():
            value, same = getattr(record, name, None), None
            if name == "time" and rig_keys.by_time(type(record)):
                same = self._same_rate(record)
            if value is None or value == -math.inf or (not defaults and value == key.default):
                continue
            if isinstance(value, Distribution):
                found[name] = self._named("thresholds", value)
            elif isinstance(value, tuple):
                found[name] = [self._number(item) for item in value]
            else:
                found[name] = self._quantity(value, key.unit, same) if key.unit else self._number(value)
        return found

    def _named(self, key: str, record: Any) -> Document:
        """A record that a table names."""
        word, kinds = rig_keys.KINDS[key]
        name = next((name for name, kind in kinds.items() if type(record) is kind), None)
        if name is None:
            raise self._refuse(f"{shown(record)}, which has no name among {', '.join(kinds)},")
        return {word: name} | self._values(record, keys_of(type(record)))

    def _same_rate(self, record: Any) -> Same:
        return lambda time: record.with_time(time / self.scales.unit("time")) == record

    def _body(self, damping_ratio: bool | None) -> Document:
        slider = self.rig.slider
        for name, kind in BODIES.items():  # section and material became springs and masses
            if isinstance(slider, kind):
                return {name: self._values(slider, rig_keys.tables()[name], defaults=False)}
        if not isinstance(slider, Slider):
            raise self._refuse(f"the impedance {shown(slider)} in place of a Slider")
        found = self._values(slider, {name: rig_keys.SLIDER[name] for name in ("mass", "stiffness", "damping")})
        short = float(f"{slider.damping_ratio:.4g}")
        if damping_ratio is None:
            damping_ratio = slider.mass > 0 and 2.0 * short * slider.frequency == slider.damping
        if damping_ratio and slider.mass > 0:
            del found["damping"]
            found["damping_ratio"] = short if self.digits is None else self._number(slider.damping_ratio)
        return {"slider": found}

    def _interface(self) -> Document:
        interface, found, scales = self.rig.interface, {}, self.scales
        known = ("temperature", "sliding_force", "newborn", "track_scatter", "on_arrest", "areas")
        interface.allow(known, "a rig file")
        blocks = self.rig.slider.size if isinstance(self.rig.slider, ElasticBody) and not self.natural else 1
        if not self.natural:
            found["contact_strength"] = self._quantity(blocks, "f_s", lambda si: si / blocks == scales.force)
            found["breaking_displacement"] = self._quantity(1.0, "x_s", lambda si: si == scales.stretching)
        found["thresholds"] = self._named("thresholds", interface.thresholds)
        # A default that was taken is left out, so that it is taken, and told of, again.
        if self.digits is not None or interface.initial != Gaussian(mean=0.0, std=0.01):
            found["initial"] = self._named("initial", interface.initial)
        if self.digits is not None or interface.delay != Delay(0.0):
            found["delay"] = self._delay()
        if force := interface.sliding_force:
            found["sliding_force"] = self._quantity(
                blocks * force, "f_s", lambda si: si / blocks / scales.force == force
            )
        if interface.track_scatter:
            found["track_scatter"] = self._number(interface.track_scatter)
        if interface.areas is not None:
            found["areas"] = interface.areas
        for name in ("newborn", "ageing", "temperature"):
            if (record := getattr(interface, name)) is not None:
                found[name] = self._named(name, record)
        return found

    def _delay(self) -> Any:
        delay = self.rig.interface.delay
        if isinstance(delay, Delay):
            return "never" if math.isinf(delay.time) else self._quantity(delay.time, "time")
        if isinstance(delay, OnArrest):
            return "on arrest"
        found = self._named("delay", delay)
        return {key: value for key, value in found.items() if (key, value) != ("model", "random")}  # as without

    # -------------------------------------------------- drive and simulation

    def _drive(self) -> Document:
        pieces: tuple[Piece, ...] = self.rig.drive.pieces
        if any(piece.until is not None for piece in pieces):
            raise self._refuse("a drive with conditions")
        if len(pieces) > 1 or pieces[0].start != pieces[0].end:
            ends = [{end: self._velocity(getattr(piece, end)) for end in ("start", "end")} for piece in pieces]
            lasts = [{"duration": self._quantity(piece.duration, "time")} for piece in pieces]
            return {"pieces": [end | last for end, last in zip(ends, lasts, strict=True)]}
        velocity, duration = pieces[0].start, pieces[0].duration
        found = {"velocity": self._speeds(velocity)}
        if self.digits is None and velocity and duration == USUAL_DISTANCE / abs(velocity):
            return found  # a default, too
        size = self.scales.unit("x_s")
        distance = velocity and self._quantity(
            abs(velocity) * duration, "x_s", lambda si: si / size / abs(velocity) == duration, or_none=True
        )
        return found | ({"distance": distance} if distance else {"duration": self._quantity(duration, "time")})

    def _speeds(self, velocity: float) -> Any:
        operation = self.rig.operation
        if operation.between is not None:
            return {name: self._velocity(end) for name, end in zip(("from", "to"), operation.between, strict=True)}
        return [self._velocity(speed) for speed in operation.speeds] or self._velocity(velocity)

    def _velocity(self, value: float) -> Any:
        """A velocity; the fastest one of a drive is also what the unit of time comes from."""
        size, x_s, time = self.scales.unit("x_s/time"), self.scales.stretching, self.scales.time
        if not self.natural:
            both = self._quantity(
                value, "x_s/time", lambda si: si / size == value and (not si or x_s / abs(si) == time), or_none=True
            )
            if both is not None:
                return both
        return self._quantity(value, "x_s/time")

    def _simulation(self) -> Document:
        method, start, output = self.rig.method, self.rig.start, self.rig.output
        if isinstance(start, FromSliding) and start != FromSliding():
            raise self._refuse("a start with a perturbation, or with blocks at rest,")
        name = next((name for name, kind in METHODS.items() if type(method) is kind), None)
        if name is None or getattr(method, "memoryless", False):
            raise self._refuse(f"the method {shown(method)}")
        keys = rig_keys.fields_of_method(type(method))
        found: Document = {"method": name, **{key: getattr(method, field) for field, key in keys.items()}}
        words = {FromRest: "from rest", FromSliding: "sliding"}
        found["start"] = self._prestressed(start) if isinstance(start, Prestressed) else words[type(start)]
        if output.interval is not None:
            found["interval"] = self._quantity(output.interval, "time")
        return found

    def _prestressed(self, start: Prestressed) -> Document:
        found = self._values(start, rig_keys.START, defaults=False)
        if isinstance(start.stretching, tuple):
            alike = [(value, len(list(group))) for value, group in groupby(start.stretching)]
            if 2 * len(alike) <= len(start.stretching):
                found["stretching"] = [{"blocks": n, "stretching": self._number(value)} for value, n in alike]
        return found

    # -------------------------------------------------- numbers

    def _number(self, value: Any) -> Any:
        if isinstance(value, float) and self.digits is not None:
            return float(f"{value:.{self.digits}g}")
        return value

    def _quantity(self, value: float, unit: str, same: Same | None = None, *, or_none: bool = False) -> Any:
        """A natural value as it stands in a file: the shortest text that reads back as the same.

        Where none reads back as the same it is the nearest that there is, or None with `or_none`.
        """
        size = self.scales.unit(unit)
        fits = same or (lambda si: si / size == value)
        if self.natural or unit == "1":
            if self.digits is not None:
                return self._number(value)
            return next(filter(fits, _roundings(value)), None if or_none else value)
        name = si_unit(unit)
        if self.digits is not None:
            return engineering(value * size, name, self.digits)
        texts = (text for text in _texts(value * size, name) if fits(read_quantity(text, name, text)))
        return next(texts, None if or_none else f"{value * size!r} {name}")


def _roundings(value: float) -> list[float]:
    """A number with few digits, with more, and its neighbours."""
    near = [math.nextafter(value, way) for way in (math.inf, -math.inf)]
    return [*(float(f"{value:.{digits}g}") for digits in (4, 8, 12, 15)), value, *near]


def _texts(value: float, unit: str) -> list[str]:
    """A quantity in words of few digits, of more, and of all; then its neighbours."""
    low, high = (math.nextafter(value, way) for way in (-math.inf, math.inf))
    exact = [value, low, high, math.nextafter(low, -math.inf), math.nextafter(high, math.inf)]
    return [engineering(value, unit, digits) for digits in range(4, 17)] + [f"{one!r} {unit}" for one in exact]
