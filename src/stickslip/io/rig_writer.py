"""The writer of rig files: each value becomes the shortest text that reads back the
same.
"""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from stickslip.errors import InputError, shown
from stickslip.io import rig_keys
from stickslip.io.keys import Keys
from stickslip.io.rig_keys import TABLES, keys_of
from stickslip.io.structure_files import KEYS_OF_MODES
from stickslip.model import (
    Delay,
    FromRest,
    FromSliding,
    Gaussian,
    Mass,
    Prestressed,
    Slider,
)
from stickslip.model.body import BODIES, ElasticBody
from stickslip.model.delays import OnArrest
from stickslip.model.drive import USUAL_DISTANCE
from stickslip.model.measured_friction import MeasuredFriction
from stickslip.model.methods import METHODS
from stickslip.model.newborn import half_distance
from stickslip.model.parameters import parameter_named
from stickslip.model.quantities import read_quantity
from stickslip.model.records import converted
from stickslip.model.rig import Rig
from stickslip.model.structure import (
    ControlledAxis,
    Matrices,
    Modes,
    StateSpace,
    Structure,
)
from stickslip.model.units import Scales, engineering, si_unit

Document = dict[str, Any]
_FOUR_DIGITS = 5e-5  # largest relative error of a number rounded to four digits


def to_document(
    rig: Rig,
    *,
    digits: int | None = None,
    damping_ratio: bool | None = None,
    own: bool = False,
) -> Document:
    """Return the content of a rig file with the given number of digits, by default as
    few as read back the same.

    The damping is written as its ratio if `damping_ratio` is true, by default if the
    ratio has few digits. With `own`, a rig that was given by coefficients of friction
    or `v_half` is written with these, in place of the values that follow from them.
    """
    writer = _Writer(rig, digits)
    found = {
        "name": rig.name,
        "units": "natural" if writer.natural else None,
        "source": rig.source,
        **writer.body(damping_ratio),
        "interface": writer.in_own_keys() if own else writer.interface(),
        "drive": writer.drive(),
        "simulation": writer.simulation(),
        "feasible": {
            name: writer.quantity(ends, parameter_named(name).unit)
            for name, *ends in rig.operation.feasible
        },
        "assumed": {
            key: [*item.between] or item.how
            for key, item in rig.assumed.items()
            if not item.default
        },
        "fitted": {
            key: {"interval": one.interval, "how": one.how, "draws": list(one.draws)}
            for key, one in rig.fitted.items()
        },
    }
    return {
        name: content for name, content in found.items() if content or name == "name"
    }


class _Writer:
    """Writer of the records of a rig as the tables of a file; quantities of a rig
    without scales are plain numbers.
    """

    def __init__(self, rig: Rig, digits: int | None) -> None:
        self.rig = rig
        self.digits = digits
        self.natural = rig.scales is None
        self.scales = rig.scales or Scales(force=1.0, stretching=1.0)
        # forces in SI units are those of all blocks
        self.blocks = 1 if self.natural else getattr(rig.slider, "size", 1)

    def _refuse(self, part: str) -> InputError:
        return InputError(
            f"rig {self.rig.name!r}: {part} cannot be written into a rig file"
        )

    def _name_of(self, record: Any, kinds: Mapping[str, type]) -> str:
        """Return the name of the kind of a record in a file."""
        names = {kind: name for name, kind in kinds.items()}
        if type(record) not in names:
            raise self._refuse(
                f"{shown(record)}, which has no name among {', '.join(kinds)},"
            )
        return names[type(record)]

    def _values(self, record: Any, keys: Keys, *, defaults: bool = True) -> Document:
        """Return the fields of a record for which its table has keys; without
        `defaults`, only those that differ from their default.
        """
        found: Document = {}
        usual = {field.name: field.default for field in fields(record)}
        for name, key in keys.items():
            value = getattr(record, name, None)
            if (
                value is None
                or value == -math.inf
                or (not defaults and value in (key.default, usual.get(name)))
            ):
                continue
            if is_dataclass(value):
                found[name] = self._named(name, value)
            elif name == "time" and rig_keys.by_time(type(record)):
                read_back = lambda si: (  # noqa: E731
                    converted(record.with_time(si), self.scales.natural) == record
                )
                found[name] = self.quantity(value, "time", read_back)
            else:
                found[name] = self.quantity(value, key.unit or "1")
        return found

    def _named(self, key: str, record: Any) -> Any:
        """Return a record as a table, or as the word or time that stands for it."""
        if isinstance(record, OnArrest):
            return "on arrest"
        if record == Delay(math.inf):
            return "never"
        if isinstance(record, Delay):
            return self.quantity(record.time, "time")
        word, kinds = rig_keys.KINDS[key]
        named = {word: self._name_of(record, kinds)} if word else {}
        kind: Any = type(record)
        return named | self._values(record, keys_of(kind))

    def body(self, damping_ratio: bool | None) -> Document:
        slider = self.rig.slider
        if isinstance(slider, Structure):
            return self._structure(slider)
        if isinstance(slider, Mass):
            return {"slider": self._values(slider, rig_keys.keys_of_slider("force"))}
        name = self._name_of(slider, {"slider": Slider} | BODIES)
        # section and material have become springs and masses
        found = self._values(slider, rig_keys.tables()[name], defaults=False)
        if name == "slider":
            short = float(f"{slider.damping_ratio:.4g}")
            if damping_ratio is None:
                damping_ratio = 2.0 * short * slider.frequency == slider.damping
            if self.digits is None:
                found["damping_ratio"] = short
            del found[
                "damping" if damping_ratio and slider.mass > 0 else "damping_ratio"
            ]
        return {name: found}

    def _structure(self, structure: Structure) -> Document:
        """Return a structure as the table `slider` from which it is made; for an axis,
        also its controller.
        """
        kind = self._name_of(
            structure,
            {
                "controller": ControlledAxis,
                "modes": Modes,
                "matrices": Matrices,
                "state_space": StateSpace,
            },
        )
        slider = self._values(structure, rig_keys.keys_of_slider(kind), defaults=False)
        if kind == "controller":
            written = self._values(structure, TABLES["controller"], defaults=False)
            return {"slider": slider, "controller": written}
        if isinstance(structure, Modes):
            columns = [getattr(structure, field) for field in KEYS_OF_MODES]
            modes = [self._mode(*row) for row in zip(*columns, strict=True)]
            return {"slider": slider | {"modes": modes}}
        written = self._values(structure, rig_keys.STRUCTURES[kind])
        return {"slider": slider | {kind: written}}

    def _mode(
        self,
        mass: float,
        stiffness: float,
        damping: float,
        contact: float,
        drive: float,
    ) -> Document:
        """Return a mode as a table; with few digits, by its frequency and damping
        ratio.
        """
        values = {"mass": mass}
        omega = math.sqrt(stiffness / mass)
        if self.digits is not None and omega:
            values["frequency"] = omega / (2.0 * math.pi)
            values["damping_ratio"] = 0.5 * damping / omega
        else:
            values |= {"stiffness": stiffness, "damping": damping}
        values["contact"] = contact
        if drive != contact:
            values["drive"] = drive
        keys = rig_keys.STRUCTURES["modes"]
        return {
            name: self.quantity(value, keys[name].unit or "1")
            for name, value in values.items()
        }

    def interface(self) -> Document:
        interface = self.rig.interface
        scales = self.scales
        blocks = self.blocks
        found = {}
        if not self.natural:
            found["contact_strength"] = self.quantity(
                blocks, "f_s", lambda si: si / blocks == scales.force
            )
            if load := self.rig.operation.normal_load:
                found["normal_load"] = self.quantity(blocks * load, "f_s")
            found["breaking_displacement"] = self.quantity(
                1.0, "x_s", lambda si: si == scales.stretching
            )
        # A default is left out, so that a reader uses and reports it again.
        found |= self._values(interface, TABLES["interface"], defaults=False)
        if self.digits is not None:
            found |= {
                name: self._named(name, getattr(interface, name))
                for name in ("initial", "delay")
            }
        if force := interface.sliding_force:
            read_back = lambda si: si / blocks / scales.force == force  # noqa: E731
            found["sliding_force"] = self.quantity(blocks * force, "f_s", read_back)
        if (measured := self.rig.operation.friction) is not None:
            found["friction"] = self._points(measured)
        return found

    def in_own_keys(self) -> Document:
        """Return the interface with the keys by which the rig was given."""
        rig = self.rig
        found = self.interface()
        contacts = rig.interface
        by_friction = self._coefficients() if "interface.mu_s" in rig.given else {}
        by_curve = "interface.friction" in rig.given and bool(contacts.ageing)
        if by_curve and rig.operation.friction is not None:
            del found["contact_strength"], found["ageing"], found["delay"]
            found["friction"] = self._points(self._present(rig.operation.friction))
        elif by_friction:
            del found["contact_strength"], found["thresholds"]
            found |= by_friction
        delay = contacts.delay
        if (
            "interface.v_half" in rig.given
            and isinstance(delay, Delay)
            and 0 < delay.time < math.inf
            and contacts.areas is None
        ):
            with suppress(InputError):  # after a change, the friction may never halve
                half = half_distance(contacts) / delay.time
                found["v_half"] = self.quantity(half, "x_s/time")
                del found["delay"]
        return found

    def _points(self, measured: MeasuredFriction) -> list[list[Any]]:
        whole = measured.scaled(self.blocks)
        columns = (
            self.quantity(whole.velocities, "x_s/time"),
            self.quantity(whole.forces, "f_s"),
            self.quantity(whole.errors, "f_s"),
        )
        return [list(point) for point in zip(*columns, strict=True)]

    def _present(self, measured: MeasuredFriction) -> MeasuredFriction:
        """Return the friction of the present contacts at the measured speeds."""
        from stickslip.sliding import kinetic_friction

        forces = kinetic_friction(self.rig.interface, np.array(measured.velocities))
        return replace(measured, forces=tuple(forces.tolist()))

    def _coefficients(self) -> Document:
        """Return the coefficients of friction from which thresholds and strength
        follow; empty if no coefficients give these.
        """
        from stickslip.sliding.rigid_motion import slow_friction, thresholds_of

        contacts = self.rig.interface
        load = self.rig.operation.normal_load
        thresholds = contacts.thresholds
        usual = contacts.newborn is None and contacts.areas is None
        if not (load and usual and type(thresholds) is Gaussian and not self.natural):
            return {}
        static, kinetic = slow_friction(thresholds, contacts.initial)
        for digits in range(4, 17):
            mu_s, mu_k = (
                float(f"{force / load:.{digits}g}") for force in (static, kinetic)
            )
            # the standard deviation amplifies an error of their ratio
            with suppress(InputError):
                again, strength = thresholds_of(mu_s, mu_k, contacts.initial)
                same = math.isclose(again.std, thresholds.std, rel_tol=_FOUR_DIGITS)
                if same and math.isclose(strength * load, 1.0, rel_tol=_FOUR_DIGITS):
                    alike = replace(thresholds, std=again.std) == again
                    return {"mu_s": mu_s, "mu_k": mu_k} if alike else {}
        return {}

    def drive(self) -> Document:
        drive = self.rig.drive
        if any(piece.until is not None for piece in drive.parts):
            raise self._refuse("a drive with conditions")
        load = [
            [self.quantity(point.time, "time"), self._number(point.load)]
            for point in drive.load
        ]
        found = self._pieces()
        return found | ({"load": load} if load else {})

    def _pieces(self) -> Document:
        drive = self.rig.drive
        if drive.force:
            return {
                "force": [self._values(each, rig_keys.FORCE) for each in drive.force]
            }
        first, *others = drive.pieces
        if others or first.start != first.end:
            pieces = [self._values(piece, rig_keys.PIECE) for piece in drive.pieces]
            return {"pieces": pieces}
        found: Document = {"velocity": self._velocity(first.start)}
        speed = abs(first.start)
        duration = first.duration
        if speed == 0:
            return found | {"duration": self.quantity(duration, "time")}
        if self.digits is None and duration == USUAL_DISTANCE / speed:
            return found  # a default, too
        read_back = lambda si: self.scales.natural(si, "x_s") / speed == duration  # noqa: E731
        return found | {"distance": self.quantity(speed * duration, "x_s", read_back)}

    def _velocity(self, velocity: float) -> Any:
        """Return a velocity as a file gives it: by the list of speeds that begins with
        it, or by the range whose middle it is, unless another velocity was set.
        """
        operation = self.rig.operation
        between = operation.between
        if between and math.isclose(math.sqrt(math.prod(between)), velocity):
            low, high = self.quantity(between, "x_s/time")
            return {"from": low, "to": high}
        begins = velocity in operation.speeds[:1]
        return self.quantity(operation.speeds if begins else velocity, "x_s/time")

    def simulation(self) -> Document:
        method = self.rig.method
        start = self.rig.start
        output = self.rig.output
        if isinstance(start, FromSliding) and start != FromSliding():
            raise self._refuse("a start with a perturbation, or with blocks at rest,")
        if isinstance(start, Prestressed) and not isinstance(
            self.rig.slider, ElasticBody
        ):
            raise self._refuse("a prestress of a slider that is not elastic")
        if getattr(method, "memoryless", False):
            raise self._refuse(f"the method {shown(method)}")
        kind: Any = type(method)
        written = self._values(method, keys_of(kind))
        found: Document = {"method": self._name_of(method, METHODS)}
        found |= {
            key: written[field]
            for field, key in rig_keys.fields_of_method(kind).items()
        }
        if isinstance(start, Prestressed):
            found["start"] = self._values(start, rig_keys.START, defaults=False)
        else:
            found["start"] = "from rest" if isinstance(start, FromRest) else "sliding"
        if output.interval is not None:
            found["interval"] = self.quantity(output.interval, "time")
        return found

    def _number(self, value: Any) -> Any:
        if isinstance(value, float) and self.digits is not None:
            return float(f"{value:.{self.digits}g}")
        return value

    def quantity(
        self, value: Any, unit: str, same: Callable[[float], bool] | None = None
    ) -> Any:
        """Return a natural value as a file holds it: the shortest text that reads back
        the same or, if none does, the nearest; for lists and matrices, item by item.

        `same` decides whether a value in SI units reads back the same; by default, it
        must do so in the given unit.
        """
        if isinstance(value, (tuple, list)):
            return [self.quantity(item, unit) for item in value]
        if self.natural or unit == "1":
            return self._number(value)
        scales = self.scales
        name = si_unit(unit)
        exact = scales.si(value, unit)
        if self.digits is not None:
            return engineering(exact, name, self.digits)
        near = [
            exact + steps * math.ulp(exact)
            for steps in ((0, -1, 1, -2, 2) if exact else ())
        ]
        texts = [
            *(engineering(exact, name, digits) for digits in range(4, 17)),
            *(f"{si!r} {name}" for si in near),
        ]
        same = same or (lambda si: scales.natural(si, unit) == value)
        read = {text: read_quantity(text, name, text) for text in texts}
        fit = [text for text in texts if same(read[text])]
        # the fastest velocity of a drive also defines the unit of time
        if unit == "x_s/time" and exact:
            x_s = scales.stretching
            fit.sort(key=lambda text: x_s / abs(read[text]) != scales.time)
        return fit[0] if fit else f"{exact!r} {name}"
