"""Rigs written as the content of rig files: the shortest text that reads back the same."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import groupby
from typing import Any, TypeVar

from stickslip.errors import InputError, shown
from stickslip.io import rig_keys
from stickslip.io.bodies import name_of
from stickslip.io.rig_keys import keys_of
from stickslip.model import (
    Delay,
    ElasticBody,
    FromSliding,
    Gaussian,
    Prestressed,
    Slider,
)
from stickslip.model.activation import ACTIVATIONS
from stickslip.model.ageing import AGEING_MODELS
from stickslip.model.delays import DELAYS, OnArrest
from stickslip.model.distributions import DISTRIBUTIONS, Distribution
from stickslip.model.drive import USUAL_DISTANCE
from stickslip.model.methods import METHODS
from stickslip.model.parameters import parameter_named
from stickslip.model.quantities import read_quantity
from stickslip.model.rig import Rig
from stickslip.model.units import engineering, si_unit

Made = TypeVar("Made")
Document = dict[str, Any]


class RigWriter:
    """Writes the records of a rig as the tables of a file."""

    def __init__(self, rig: Rig, digits: int | None) -> None:
        self.rig, self.digits, self.scales = rig, digits, rig.scales

    def document(self, damping_ratio: bool | None) -> Document:
        """The content of the file."""
        rig = self.rig
        found: Document = {"name": rig.name}
        if self.scales is None:
            found["units"] = "natural"
        if rig.source:
            found["source"] = rig.source
        if isinstance(rig.slider, ElasticBody):
            found |= self._body(rig.slider)
        else:
            found["slider"] = self._slider(damping_ratio)
        found["interface"] = self._interface()
        found["drive"] = self._drive()
        found["simulation"] = self._simulation()
        if feasible := self.rig.operation.feasible:
            found["feasible"] = {
                name: [self._quantity(end, parameter_named(name).unit) for end in ends] for name, *ends in feasible
            }
        assumed = {key: item.how for key, item in rig.assumed.items() if not item.default}
        if assumed:
            found["assumed"] = assumed
        if rig.fitted:
            found["fitted"] = {
                key: {"interval": one.interval, "how": one.how, "draws": list(one.draws)}
                for key, one in rig.fitted.items()
            }
        return found

    def _refuse(self, what: str) -> InputError:
        return InputError(f"rig {self.rig.name!r}: {what} cannot be written into a rig file")

    def _slider(self, damping_ratio: bool | None) -> Document:
        slider = self.rig.slider
        if not isinstance(slider, Slider):
            raise self._refuse(f"the impedance {shown(slider)} in place of a Slider")
        found = {
            "mass": self._quantity(slider.mass, "f_s time^2/x_s"),
            "stiffness": self._quantity(slider.stiffness, "k"),
        }
        short = float(f"{slider.damping_ratio:.4g}")
        if damping_ratio is None:
            damping_ratio = slider.mass > 0 and 2.0 * short * slider.frequency == slider.damping
        if damping_ratio and slider.mass > 0:
            return found | {"damping_ratio": short if self.digits is None else self._number(slider.damping_ratio)}
        return found | {"damping": self._quantity(slider.damping, "1/time")}

    def _body(self, body: ElasticBody) -> Document:
        kind = str(name_of(body))
        found: Document = {}
        for name, key in rig_keys.TABLES[kind].items():
            value = getattr(body, name, None)  # section and material became springs and masses
            if value is not None and value != key.default:
                found[name] = self._quantity(value, key.unit) if key.unit else value
        return {kind: found}

    @property
    def _blocks(self) -> int:
        """Blocks that share the strength of the interface."""
        return self.rig.slider.size if isinstance(self.rig.slider, ElasticBody) else 1

    def _interface(self) -> Document:
        interface, found = self.rig.interface, {}
        known = ("temperature", "sliding_force", "newborn", "track_scatter", "on_arrest", "areas")
        interface.allow(known, "a rig file")
        if self.scales is not None:
            strength, blocks = self._scale("force"), self._blocks
            found["contact_strength"] = self._quantity(blocks, "f_s", lambda si: si / blocks == strength)
            found["breaking_displacement"] = self._quantity(1.0, "x_s", lambda si: si == self._scale("stretching"))
        found["thresholds"] = self._record("distribution", interface.thresholds, DISTRIBUTIONS)
        # A default that was taken is left out, so that it is taken, and told of, again.
        if self.digits is not None or interface.initial != Gaussian(mean=0.0, std=0.01):
            found["initial"] = self._record("distribution", interface.initial, DISTRIBUTIONS)
        if self.digits is not None or interface.delay != Delay(0.0):
            found["delay"] = self._delay()
        if interface.sliding_force:
            blocks, force = self._blocks, interface.sliding_force
            size = 1.0 if self.scales is None else self.scales.force
            if self.scales is None:
                blocks = 1
            found["sliding_force"] = self._quantity(blocks * force, "f_s", lambda si: si / blocks / size == force)
        if interface.newborn is not None:
            found["newborn"] = self._record("distribution", interface.newborn, DISTRIBUTIONS)
        if interface.track_scatter:
            found["track_scatter"] = self._number(interface.track_scatter)
        if interface.areas is not None:
            found["areas"] = interface.areas
        if interface.ageing is not None:
            found["ageing"] = self._record("model", interface.ageing, AGEING_MODELS)
        if interface.temperature is not None:
            found["temperature"] = self._record("kind", interface.temperature, ACTIVATIONS)
        return found

    def _scale(self, name: str) -> float:
        return float(getattr(self.scales, name))

    def _record(self, word: str, record: Any, kinds: Mapping[str, type]) -> Document:
        name = next((name for name, kind in kinds.items() if type(record) is kind), None)
        if name is None:
            raise self._refuse(f"{shown(record)}, which has no name among {', '.join(kinds)},")
        found: Document = {word: name}
        for field, key in keys_of(type(record)).items():
            value = getattr(record, field, None)  # a time in place of a rate is a property
            if rig_keys.by_time(type(record)) and field == "time":
                value = rig_keys.time_of(record)
            if value is None or value == -math.inf:
                continue
            if isinstance(value, tuple):
                found[field] = [self._number(item) for item in value]
            elif isinstance(value, Distribution):
                found[field] = self._record("distribution", value, DISTRIBUTIONS)
            elif key.unit:
                same = (lambda si: self._rate(record, si)) if rig_keys.by_time(type(record)) else None
                found[field] = self._quantity(value, key.unit, same)
            else:
                found[field] = self._number(value)
        return found

    def _rate(self, record: Any, si: float) -> bool:
        time = si if self.scales is None else si / self.scales.unit("time")
        return bool(rig_keys.rate_of(type(record), time) == record.rate)

    def _delay(self) -> Any:
        delay = self.rig.interface.delay
        if isinstance(delay, Delay):
            return "never" if math.isinf(delay.time) else self._quantity(delay.time, "time")
        if isinstance(delay, OnArrest):
            return "on arrest"
        found = self._record("model", delay, DELAYS)
        return {key: value for key, value in found.items() if (key, value) != ("model", "random")}  # as without

    def _drive(self) -> Document:
        pieces = self.rig.drive.pieces
        if any(piece.until is not None for piece in pieces):
            raise self._refuse("a drive with conditions")
        if len(pieces) > 1 or pieces[0].start != pieces[0].end:
            return {
                "pieces": [
                    {
                        "start": self._velocity(piece.start),
                        "end": self._velocity(piece.end),
                        "duration": self._quantity(piece.duration, "time"),
                    }
                    for piece in pieces
                ]
            }
        velocity, duration = pieces[0].start, pieces[0].duration
        found = {"velocity": self._speeds(velocity)}
        if self.digits is None and velocity and duration == USUAL_DISTANCE / abs(velocity):
            return found  # a default, too
        if velocity:
            size = 1.0 if self.scales is None else self.scales.unit("x_s")
            distance = self._quantity(
                abs(velocity) * duration, "x_s", lambda si: si / size / abs(velocity) == duration, or_none=True
            )
            if distance is not None:
                return found | {"distance": distance}
        return found | {"duration": self._quantity(duration, "time")}

    def _speeds(self, velocity: float) -> Any:
        operation = self.rig.operation
        if operation.between is not None:
            return {name: self._velocity(end) for name, end in zip(("from", "to"), operation.between, strict=True)}
        return [self._velocity(speed) for speed in operation.speeds] or self._velocity(velocity)

    def _velocity(self, value: float) -> Any:
        """A velocity; the fastest one of a drive is also what the unit of time comes from."""
        if self.scales is None:
            return self._quantity(value, "x_s/time")
        size, x_s, time = self.scales.unit("x_s/time"), self.scales.stretching, self.scales.time
        both = self._quantity(
            value, "x_s/time", lambda si: si / size == value and (not si or x_s / abs(si) == time), or_none=True
        )
        return both if both is not None else self._quantity(value, "x_s/time")

    def _simulation(self) -> Document:
        method, start, output = self.rig.method, self.rig.start, self.rig.output
        if isinstance(start, FromSliding) and start != FromSliding():
            raise self._refuse("a start with a perturbation, or with blocks at rest,")
        name = next((name for name, kind in METHODS.items() if type(method) is kind), None)
        if name is None or getattr(method, "memoryless", False):
            raise self._refuse(f"the method {shown(method)}")
        keys = rig_keys.fields_of_method(type(method))
        found: Document = {"method": name, **{key: getattr(method, field) for field, key in keys.items()}}
        if isinstance(start, Prestressed):
            found["start"] = self._prestressed(start)
        else:
            found["start"] = "sliding" if isinstance(start, FromSliding) else "from rest"
        if output.interval is not None:
            found["interval"] = self._quantity(output.interval, "time")
        return found

    def _prestressed(self, start: Prestressed) -> Document:
        stretching: Any = start.stretching
        if isinstance(stretching, tuple):
            alike = [(value, len(list(group))) for value, group in groupby(stretching)]
            if 2 * len(alike) <= len(stretching):
                stretching = [{"blocks": blocks, "stretching": self._number(value)} for value, blocks in alike]
            else:
                stretching = [self._number(value) for value in stretching]
        found = {"stretching": self._number(stretching)}
        if start.push:
            found["push"] = self._quantity(start.push, "f_s")
        if start.pushed_blocks != 1:
            found["pushed_blocks"] = start.pushed_blocks
        return found

    # -------------------------------------------------- numbers

    def _number(self, value: Any) -> Any:
        if isinstance(value, float) and self.digits is not None:
            return float(f"{value:.{self.digits}g}")
        return value

    def _quantity(
        self, value: float, unit: str, same: Callable[[float], bool] | None = None, *, or_none: bool = False
    ) -> Any:
        """A natural value as it stands in a file: the shortest text that reads back as the same.

        Parameters
        ----------
        value : float
        unit : str
            Its natural unit.
        same : callable, optional
            Whether a value in the units of the file is the same; by default, whether it is `value` in natural units.
        or_none : bool
            Return None if no text reads back as the same; by default the nearest that there is.
        """
        size = 1.0 if self.scales is None else self.scales.unit(unit)
        if self.scales is None or unit == "1":
            if self.digits is not None:
                return self._number(value)
            return next((at for at in _roundings(value) if (same or value.__eq__)(at)), None if or_none else value)
        name = si_unit(unit)
        if self.digits is not None:
            return engineering(value * size, name, self.digits)
        fits = same or (lambda si: si / size == value)
        for text in _texts(value * size, name):
            if fits(read_quantity(text, name, text)):
                return text
        return None if or_none else f"{value * size!r} {name}"


def _roundings(value: float) -> list[float]:
    """A number with few digits, with more, and its neighbours."""
    near = [math.nextafter(value, way) for way in (math.inf, -math.inf)]
    return [*(float(f"{value:.{digits}g}") for digits in (4, 8, 12, 15)), value, *near]


def _texts(value: float, unit: str) -> list[str]:
    """A quantity in words of few digits, of more, and of all; then its neighbours."""
    low, high = (math.nextafter(value, way) for way in (-math.inf, math.inf))
    exact = [value, low, high, math.nextafter(low, -math.inf), math.nextafter(high, math.inf)]
    return [engineering(value, unit, digits) for digits in range(4, 17)] + [f"{one!r} {unit}" for one in exact]
