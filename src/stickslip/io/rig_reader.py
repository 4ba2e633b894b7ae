"""The reader of rig files: it makes each record in the units of the file, and then
converts the whole rig to natural units.

It collects all mistakes, and reports them in one line.
"""

import math
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial, reduce
from typing import Any

from stickslip.errors import InputError, pair, refused, shown
from stickslip.io import rig_keys
from stickslip.io.keys import Either, Key, Sign, natural_unit_of, toml
from stickslip.io.rig_keys import MATERIAL, RULES, SCALES, SHAPE, TABLES, keys_of
from stickslip.io.structure_files import structure_kind, structure_of
from stickslip.io.tables import MissingError, NotedError, Tables, Values, at
from stickslip.model import (
    Areas,
    Delay,
    FromRest,
    FromSliding,
    Interface,
    Output,
    Prestressed,
    Slider,
    TabulatedGrowth,
)
from stickslip.model.body import BODIES
from stickslip.model.delays import DelayModel, OnArrest
from stickslip.model.drive import USUAL_DISTANCE, Drive, constant, pull, ramp
from stickslip.model.measured_friction import MeasuredFriction
from stickslip.model.methods import METHODS, check_start
from stickslip.model.newborn import half_distance
from stickslip.model.parameters import BY_NAME, converted_ranges
from stickslip.model.quantities import read_quantity
from stickslip.model.records import converted, declared
from stickslip.model.rig import Assumption, Fitted, Operation, Rig
from stickslip.model.units import Scales, si_unit

_NUMBER = r"(\d*\.?\d+(?:e[-+]?\d+)?(?: \S+)?)"  # with or without a unit
_RANGE = re.compile(f"{_NUMBER} to {_NUMBER}")
_START = "simulation.start"
_SPEED = replace(TABLES["drive"]["velocity"], sign="above 0", also=(), required=True)
_SPEEDS = (
    toml(["1 mm/s", "10 mm/s"]) + " or " + toml({"from": "1 mm/s", "to": "50 mm/s"})
)


def from_document(document: Mapping[str, Any], place: str = "rig") -> Rig:
    """Return the rig that the content of a file describes.

    The message of an error begins with `place`, and names every mistake: key, value,
    remedy. Its `mistakes` are single errors, each with its key as `place`.
    """
    if "axes" in document:
        raise InputError(
            f"{place}: a sweep, not a rig; `stickslip sweep {place} --store "
            "results.sqlite` runs it"
        )
    reader = _Reader(document)
    rig: Rig | None = reader.file.part(reader.rig)
    if rig is None:
        raise reader.file.in_one_line(place)
    return rig


def _made(
    kind: Any, values: Values, place: str, names: Mapping[str, str] | None = None
) -> Any:
    """Make a record from those values of a table that are its fields."""
    with at(place, names):
        return kind(**{name: values[name] for name in declared(kind) if name in values})


def _damping_over_mass(content: Any) -> Any:
    """Return the table of a slider with a damping in N s/m divided by its mass; other
    tables are returned unchanged.
    """
    try:
        force_per_velocity = read_quantity(content["damping"], "kg/s", "")
        mass = read_quantity(content["mass"], "kg", "")
        rate = force_per_velocity / mass
    except (KeyError, TypeError, ZeroDivisionError, InputError):
        return content
    return {**content, "damping": f"{rate!r} 1/s"}


class _Reader:
    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self.file = Tables(natural=document.get("units") == "natural")
        self.body = next(
            (name for name in reversed([*BODIES]) if name in document),
            "slider",
        )
        self.kind = structure_kind(document)
        self.length = 1.0  # breaking displacement, in the units of the file
        self.viscosity = 0.0  # of one block, in the units of the file

    def rig(self) -> Rig:
        """Return the rig that the file describes."""
        file = self.file
        one_body = Either("slider", *BODIES)
        top = file.table(
            self.document,
            {**dict.fromkeys(BODIES, Key({})), **rig_keys.TOP},
            rules=(one_body,),
        )
        names = (self.body, "interface", "drive", "simulation")
        slider, interface, drive, simulation = (
            self._table(name, top.get(name, {})) for name in names
        )
        controller = top.get("controller")
        self._check_body(slider)
        if "mu_s" in interface and "normal_load" not in interface:
            file.missing("interface.normal_load", TABLES["interface"]["normal_load"])
        # A mistake is noted, and the other parts are still read to find all.
        self.length = interface.get("breaking_displacement", 1.0)
        for name in rig_keys.KINDS:
            if name in interface:
                interface[name] = file.part(
                    partial(self._record, interface[name], f"interface.{name}")
                )
        measured = file.part(partial(self._measured, interface))
        driven = file.part(partial(self._drive, drive, interface.get("normal_load")))
        feasible = self._feasible(top.get("feasible", {}))
        assumed = self._assumed(top.get("assumed", {}))
        fitted = self._fitted(top.get("fitted", {}))

        pulled, speeds = driven
        if self.kind:
            body = file.part(lambda: structure_of(file, self.kind, slider, controller))
            file.stop()
        else:
            body = self._body(slider)
        blocks = 1 if self.body == "slider" else body.size
        start = self._start(simulation["start"], blocks)
        with at(_START):
            check_start(start, body)
        # only in SI files, forces are those of all blocks
        blocks = 1 if file.natural else blocks
        measured = self._by_curve(interface, measured, blocks)
        scales = self._scales(interface, pulled, blocks)
        interface["sliding_force"] /= blocks
        if "normal_load" in interface:
            speeds["normal_load"] = interface["normal_load"] / blocks
        method = self._method(simulation)
        speeds["friction"] = measured
        speeds["feasible"] = converted_ranges(feasible, scales.natural)
        operation = _made(Operation, speeds, "drive")
        output = _made(Output, simulation, "simulation")
        contacts = _made(Interface, interface, "interface")
        with at("rig"):
            rig = Rig(
                interface=contacts,
                slider=body,
                drive=pulled,
                operation=operation,
                method=method,
                start=start,
                output=output,
                scales=None if file.natural else scales,
                assumed=assumed,
                fitted=fitted,
                given=tuple(
                    f"interface.{name}"
                    for name in ("mu_s", "mu_k", "v_half", "friction")
                    if name in interface
                ),
                name=top["name"],
                source=top["source"],
            )
            rig = converted(rig, scales.natural)
        return self._with_what_follows(rig, scales, slider | interface | drive)

    def _method(self, simulation: Values) -> Any:
        """Return the method of simulation; by default, a slider has more contacts than
        a block.
        """
        usual = 10_000 if self.body == "slider" else 100
        given = simulation | {"count": simulation.get("contacts", usual)}
        return _made(
            METHODS[simulation["method"]], given, "simulation", {"count": "contacts"}
        )

    def _with_what_follows(self, rig: Rig, scales: Scales, values: Values) -> Rig:
        """Return the rig with the values that follow from several keys: damping, delay,
        and the distance of the drive; computed in natural units.
        """
        if "damping_ratio" in values:
            with at("slider"):
                damping = 2.0 * values["damping_ratio"] * rig.slider.frequency
                rig = replace(rig, slider=replace(rig.slider, damping=damping))
        if self.viscosity > 0.0:
            slider = rig.slider
            if not hasattr(slider, "mass"):
                raise InputError(
                    "interface.viscosity: is a damping of a mass; leave it out, and "
                    "give the structure that damping",
                    "interface.viscosity",
                )
            if not slider.mass > 0.0:
                raise InputError(
                    "slider.mass: is 0, and a viscous force is a damping of a mass; "
                    "give one above 0",
                    "slider.mass",
                )
            viscous = scales.natural(self.viscosity, "f_s time/x_s") / slider.mass
            # computed in SI units, so that an SI file can hold exactly this damping
            damping = scales.si(slider.damping + viscous, "1/time")
            slider = replace(slider, damping=scales.natural(damping, "1/time"))
            rig = replace(rig, slider=slider)
        if "v_half" in values:
            with at("interface.v_half"):
                path = half_distance(rig.interface)
            # computed in seconds, so that an SI file can hold exactly this delay
            seconds = path / values["v_half"] / scales.natural(1.0, "x_s")
            rig = replace(
                rig,
                interface=replace(
                    rig.interface, delay=Delay(scales.natural(seconds, "time"))
                ),
            )
        if "velocity" in values and "duration" not in values:
            distance = (
                scales.natural(values["distance"], "x_s")
                if "distance" in values
                else USUAL_DISTANCE
            )
            velocity = rig.drive.velocity
            pieces = constant(velocity, distance / abs(velocity)).pieces
            rig = replace(rig, drive=replace(rig.drive, pieces=pieces))
        return rig

    def _table(self, name: str, content: object) -> Values:
        """Read the values of a table of the file, and note keys that exclude each
        other.
        """
        keys = rig_keys.tables()[name]
        if name == "simulation" and isinstance(content, Mapping):
            keys = rig_keys.keys_of_simulation(
                content.get("method", keys["method"].default)
            )
        rules = RULES.get(name, ())
        if name == "slider":
            keys = rig_keys.keys_of_slider(self.kind)
            rules = () if self.kind else rules
        given = rig_keys.within({name: content}, name)
        if name == "interface" and "friction" in given and "ageing" not in given:
            rules = RULES["friction"]
        if name == "interface" and self.file.natural:
            keys = {key: each for key, each in keys.items() if key not in SCALES}
        if name == self.body and not self.file.natural:
            content = _damping_over_mass(content)
        return self.file.table(content, keys, name, rules)

    def _record(self, content: Any, place: str) -> Any:
        """Make the record that a table names; a delay may also be a time or a word."""
        name = place.rpartition(".")[2]
        word, kinds = rig_keys.KINDS[name]
        if name == "delay" and not isinstance(content, Mapping):
            of_word: dict[Any, DelayModel] = {
                "never": Delay(math.inf),
                "on arrest": OnArrest(),
            }
            return of_word.get(content) or Delay(content)
        key = TABLES["interface"].get(name) or keys_of(Areas)[name]
        example = toml(key.example)
        if not isinstance(content, Mapping):
            raise refused(place, content, f"must be a table, such as {example}")
        named = content.get(word, {"delay": "random", "areas": ""}.get(name))
        if not isinstance(named, str) or named not in kinds:
            known = (
                f"must be one of the known {word}s {', '.join(map(repr, kinds))}, "
                f"as in {example}"
            )
            given = f"{place}.{word}" + (
                f" = {shown(named)}" if word in content else ""
            )
            raise InputError(f"{given}: {known}", f"{place}.{word}")
        kind: Any = kinds[named]
        written = {name: value for name, value in content.items() if name != word}
        keys = keys_of(kind)
        instead = rig_keys.INSTEAD.get(kind)
        values = self.file.whole(
            written, keys, place, [instead.rule] if instead else []
        )
        for name in [name for name in values if keys[name].is_table]:
            values[name] = self._record(values[name], f"{place}.{name}")
        if rig_keys.by_time(kind):
            time = values.pop("time")
            with at(place, {"rate": "time"}):
                return kind(rate=1.0, **values).with_time(time)
        names: dict[str, str] = {}
        if instead and values.keys() >= instead.keys.keys():
            others = {name: values[name] for name in instead.keys}
            with at(place):
                made = instead.make(self.length, **others)
            names = dict.fromkeys(made, next(iter(others)))
            values |= made
        return _made(kind, values, place, names)

    def _body(self, values: Values) -> Any:
        """Make the body, with springs and masses of blocks from the material; a damping
        ratio is applied later.
        """
        length, width, height = (values.get(key, math.nan) for key in SHAPE)
        # The spring from a block to the top is as long as the bar is high, that between
        # rows as long as a row is wide.
        shape = {
            "coupling": width * height / length,
            "leaf": width * length / height,
            "shear": height * length / width,
            "mass": width * height * length,
        }
        # in the units of the file, so that the result can be written into a file
        # exactly
        material = {
            direct: values[name] * shape[direct]
            for direct, name in MATERIAL.get(self.body, {}).items()
            if name in values
        }
        kind = BODIES.get(self.body, Slider)
        return _made(kind, {"damping": 0.0} | values | material, self.body)

    def _check_body(self, values: Values) -> None:
        """Note keys of the body that are wrong, or missing for the material."""
        if self.kind and self.body != "slider":
            place = "drive.force" if self.kind == "force" else "controller"
            self.file.wrong(place, "is of a slider; leave it out")
        if "damping_ratio" in values and values.get("mass") == 0:
            self.file.wrong(
                "slider.mass",
                "is 0, and damping_ratio needs a mass above 0; give damping instead",
            )
        if not values.keys().isdisjoint(MATERIAL.get(self.body, {}).values()):
            for name in SHAPE:
                if name not in values:
                    self.file.missing(f"{self.body}.{name}", TABLES[self.body][name])

    def _drive(self, values: Values, normal_load: float | None) -> tuple[Drive, Values]:
        """Return the drive and the speeds at which the rig works; a duration that is
        not given follows later.
        """
        drive, speeds = self._pulled(values)
        if "load" in values:
            load = self._load(values["load"], normal_load)
            with at("drive"):
                drive = drive.under(load)
        return drive, speeds

    def _load(self, content: Any, normal_load: float | None) -> Any:
        """Return a load over the usual one: a number, or a list of times and loads."""
        place = "drive.load"
        natural = self.file.natural
        own = TABLES["drive"]["load"]
        usual = TABLES["interface"]["normal_load"]
        if isinstance(content, list):
            time = replace(TABLES["drive"]["duration"], sign="at least 0")
            found = []
            for i, point in enumerate(content):
                where = f"{place}[{i}]"
                moment, load = pair(where, point, 'a time and a load, ["1 s", 1.5]')
                moment = time.read(moment, where, natural=natural)
                found.append((moment, self._load(load, normal_load)))
            return found
        if natural or not isinstance(content, str):
            return own.read(content, place, natural=natural)
        load = usual.read(content, place, natural=natural)
        if normal_load is None:
            raise MissingError("interface.normal_load", usual.example)
        return load / normal_load

    def _pulled(self, values: Values) -> tuple[Drive, Values]:
        """Return the drive without its load, and the speeds at which the rig works."""
        by_force = "force" in values
        place = "drive.force" if by_force else "drive.pieces"
        content = values.get("force" if by_force else "pieces")
        lasts = values.get("duration")
        if isinstance(content, float):
            if lasts is None:
                self.file.missing("drive.duration", TABLES["drive"]["duration"])
                raise NotedError("")
            with at("drive"):
                return pull(content, duration=lasts), {}
        if by_force or "pieces" in values:
            if not isinstance(content, list) or not content:
                raise refused(place, content, "must be a list of at least one table")
            if lasts is not None:
                raise refused(place, content, "has durations; leave drive.duration out")
            keys = rig_keys.FORCE if by_force else rig_keys.PIECE
            make: Callable[..., Drive] = pull if by_force else ramp
            read = [
                self.file.whole(piece, keys, f"{place}[{i}]")
                for i, piece in enumerate(content)
            ]
            with at(place):
                return reduce(Drive.then, [make(**piece) for piece in read]), {}
        if "velocity" not in values:
            raise NotedError("")
        velocity, speeds = self._speeds(values["velocity"], "drive.velocity")
        if velocity == 0 and "duration" not in values:
            raise InputError(
                "drive.velocity: is 0; give a velocity above 0, or a duration",
                "drive.velocity",
            )
        with at("drive"):
            return constant(velocity, values.get("duration", 1.0)), speeds

    def _speeds(self, content: Any, place: str) -> tuple[float, Values]:
        """Return the speed to simulate, and the speeds or the range that are given."""
        if isinstance(content, list) and content:
            several = replace(_SPEED, example=[_SPEED.example])
            speeds = several.read(content, place, natural=self.file.natural)
            return speeds[0], {"speeds": speeds}
        if isinstance(content, Mapping):
            ends = dict.fromkeys(("from", "to"), _SPEED)
            low, high = self.file.whole(content, ends, place).values()
            if low < high:
                return math.sqrt(low * high), {"between": (low, high)}
        if isinstance(content, (list, Mapping)):
            raise refused(place, content, f"must be speeds, as in {_SPEEDS}")
        return content, {}

    def _start(self, content: Any, blocks: int) -> Any:
        if not isinstance(content, Mapping):
            return FromSliding() if content == "sliding" else FromRest()
        if self.body == "slider":
            raise refused(
                _START,
                content,
                (
                    "must be 'from rest' or 'sliding'; a table is for "
                    f"{' or '.join(BODIES)}"
                ),
            )
        values = self.file.whole(content, rig_keys.START, _START)
        place = f"{_START}.stretching"
        if isinstance(profile := values["stretching"], list):
            runs = [
                item if isinstance(item, Mapping) else {"blocks": 1, "stretching": item}
                for item in profile
            ]
            runs = [
                self.file.whole(run, rig_keys.RUN, f"{place}[{i}]")
                for i, run in enumerate(runs)
            ]
            if (total := sum(run["blocks"] for run in runs)) != blocks:
                raise refused(
                    place,
                    profile,
                    f"is of {total} blocks, but there are {blocks}; give one for each",
                )
            values["stretching"] = tuple(
                run["stretching"] for run in runs for _ in range(run["blocks"])
            )
        return _made(Prestressed, values, _START)

    def _measured(self, interface: Values) -> MeasuredFriction | None:
        """Return the friction curve in the units of the file, without the viscous
        force; coefficients of friction are multiplied by the normal load.
        """
        if "friction" not in interface:
            return None
        place = "interface.friction"
        force = TABLES["interface"]["contact_strength"]
        points = interface["friction"]
        signs: tuple[Sign, Sign] = ("above 0", "at least 0")
        if isinstance(points, str):
            raise refused(place, points, "only a rig file may name a file of points")
        load = interface.get("normal_load", 1.0)
        found = []
        for i, point in enumerate(points):
            where = f"{place}[{i}]"
            if not isinstance(point, list) or len(point) not in (2, 3):
                example = toml(TABLES["interface"]["friction"].example[0])
                raise refused(where, point, f"must be a point, such as {example}")
            row = [_SPEED.read(point[0], where, natural=self.file.natural)]
            for value, sign in zip(point[1:], signs, strict=False):
                if isinstance(value, str):
                    key = replace(force, sign=sign)
                    row.append(key.read(value, where, natural=self.file.natural))
                elif "normal_load" not in interface and not self.file.natural:
                    raise MissingError(
                        "interface.normal_load",
                        TABLES["interface"]["normal_load"].example,
                    )
                else:
                    row.append(value)
            found.append(row)
        are_forces = {isinstance(each, str) for point in points for each in point[1:]}
        if len(are_forces) > 1:
            raise refused(place, points, "must be all forces, or all coefficients")
        measured = MeasuredFriction.of_points(found, place)
        if False in are_forces:
            measured = measured.scaled(load)
        return measured.without(interface.get("viscosity", 0.0))

    def _by_curve(
        self, interface: Values, measured: MeasuredFriction | None, blocks: int
    ) -> MeasuredFriction | None:
        """Add thresholds, growth and strength of the contacts that give a measured
        friction curve, and return that of a block without its viscous force.
        """
        self.viscosity = interface.get("viscosity", 0.0) / blocks
        if measured is None or "ageing" in interface:
            return None if measured is None else measured.scaled(1.0 / blocks)
        from stickslip.sliding.curve import curve_of
        from stickslip.sliding.rigid_motion import thresholds_or_even

        # the scales of a natural file are 1
        unit = 1.0 if self.file.natural else max(measured.forces)
        if "thresholds" not in interface:
            static = interface["mu_s"] * interface["normal_load"]
            with at("interface.mu_s"):
                interface["thresholds"], _ = thresholds_or_even(
                    static, measured.forces[0], interface["initial"]
                )
        with at("interface.friction"):
            curve = curve_of(
                replace(
                    measured.scaled(1.0 / unit),
                    velocities=tuple(v / self.length for v in measured.velocities),
                ),
                interface["thresholds"],
            )
        growth = curve.interface.ageing
        assert isinstance(growth, TabulatedGrowth)
        # the thresholds of the distribution are those of fully aged contacts
        oldest = 1.0 if self.file.natural else growth.strengths[-1]
        interface["ageing"] = TabulatedGrowth(
            tuple(age / oldest for age in growth.ages),
            tuple(strength / oldest for strength in growth.strengths),
        )
        interface["contact_strength"] = oldest * unit
        viscosity = curve.viscosity * unit / self.length
        self.viscosity += viscosity / blocks
        return measured.without(viscosity).scaled(1.0 / blocks)

    def _scales(self, interface: Values, drive: Drive, blocks: int) -> Scales:
        """Return the scales of the rig, with forces per block; if coefficients of
        friction are given, also add the thresholds that follow from them.
        """
        if self.file.natural:
            return Scales(force=1.0, stretching=1.0)
        strength = interface.get("contact_strength")
        if strength is None:
            from stickslip.sliding.rigid_motion import thresholds_or_even

            with at("interface.mu_s"):
                interface["thresholds"], strength = thresholds_or_even(
                    interface["mu_s"], interface["mu_k"], interface["initial"]
                )
            strength *= interface["normal_load"]
        fastest = max(map(abs, drive.velocities), default=0.0)
        x_s = self.length
        # The unit of time cancels in every result; this one keeps numbers near 1.
        with at(
            "interface",
            {"force": "contact_strength", "stretching": "breaking_displacement"},
        ):
            return Scales(
                force=strength / blocks,
                stretching=x_s,
                time=x_s / fastest if fastest else 1.0,
            )

    def _feasible(self, content: object) -> list[tuple[str, float, float]]:
        """Return the ranges within which parameters can be set on the machine."""
        keys = {}
        for name, parameter in BY_NAME.items():
            unit = "" if parameter.unit == "1" else parameter.unit
            keys[name] = Key(
                [f"2 {si_unit(unit)}" if unit else 1.0] * 2,
                unit=unit,
                sign="above 0",
            )
        found = self.file.table(content, keys, "feasible")
        for name, ends in found.items():
            if len(ends) != 2 or ends[0] > ends[1]:
                self.file.wrong(
                    f"feasible.{name}", "must be two values, the lowest first"
                )
        return [(name, *ends) for name, ends in found.items()]

    def _of_paths(self, content: object, table: str, key: Key) -> Values:
        """Read the values of a table whose keys are paths of keys of the file."""
        given = [str(path) for path in content] if isinstance(content, Mapping) else []
        return self.file.table(
            content, dict.fromkeys(rig_keys.paths(given), key), table
        )

    def _assumed(self, content: object) -> dict[str, Assumption]:
        """Return the assumptions that the file marks, and then the defaults used, each
        with its value.
        """
        marked = self._of_paths(content, "assumed", Key("text", also=("list",)))
        found = {
            path: self.file.part(partial(self._marked, path, how))
            for path, how in marked.items()
        }
        given = rig_keys.within(self.document, "interface")
        for name, key in TABLES["interface"].items():
            others = given.keys() & {"v_half", "friction"}
            here = name in given or (name == "delay" and others)
            path = f"interface.{name}"
            if key.measure and not here and path not in found:
                is_quantity = key.unit and not self.file.natural
                value = "0 s" if is_quantity else toml(key.default)
                found[path] = Assumption(value, key.measure, default=True)
        return found

    def _marked(self, path: str, between: str | list[Any]) -> Assumption:
        """Return an assumption of the file, which it marks by how to measure the value,
        or by the range in which this may lie.
        """
        if isinstance(between, str):
            found = _RANGE.fullmatch(between)
            if found is None:
                return Assumption(self._value_at(path), between)
            between = [end if " " in end else float(end) for end in found.groups()]
        value = self._at(path)
        place = f"assumed.{path}"
        unit = natural_unit_of(value) if isinstance(value, str) else ""
        if not unit and type(value) not in (int, float):
            other = (
                "is not in the file, so at its default; write it, too"
                if value == ""
                else "is no number"
            )
            raise refused(place, between, f"{path} {other}, or write how to measure it")
        key = Key(value if unit else 1.0, unit=unit, sign="above 0")
        own, *limits = (
            key.read(each, place, natural=self.file.natural)
            for each in (value, *between)
        )
        if len(limits) != 2 or limits[0] >= limits[1]:
            raise refused(place, between, "must be two values, the lowest first")
        return Assumption(
            self._value_at(path),
            "",
            between=tuple(between),
            factors=tuple(end / own for end in limits),
        )

    def _fitted(self, content: object) -> dict[str, Fitted]:
        """Return the fitted values of the file, with intervals and draws; stop if the
        file has any mistake.
        """
        entries = self._of_paths(content, "fitted", Key({})).items()
        read = {
            path: self.file.table(entry, rig_keys.FITTED, f"fitted.{path}")
            for path, entry in entries
        }
        for path, values in read.items():
            self._check_draws(path, values.get("draws", ()))
        self.file.stop()
        return {
            path: Fitted(self._value_at(path), **values)
            for path, values in read.items()
        }

    def _check_draws(self, path: str, draws: tuple[float, ...]) -> None:
        """Note the first draw that is not a possible value of its key."""
        key = rig_keys.key_at(path, self.document)
        place = f"fitted.{path}.draws"
        if key is None:
            self.file.wrong(place, f"{path} is no key of a rig file; leave it out")
            return
        whole = type(key.example) is int
        if not (key.unit or key.si or whole or type(key.example) is float):
            self.file.wrong(place, f"{path} is no number; leave its draws out")
            return
        own = None
        with suppress(InputError):  # is noted where the value itself is read
            own = key.read(self._at(path), place, natural=self.file.natural)
        sign = key.sign
        # 0 may be chosen, such as for no mass, but is never drawn
        if own != 0 and (sign or whole or path == "drive.velocity"):
            sign = "above 0"
        plain = replace(key, example=[1.0], sign=sign, choices=(), also=())
        self.file.part(partial(plain.read, [*draws], place, natural=True))

    def _at(self, path: str) -> Any:
        """Return the value at a path of the file; an empty text if there is none."""
        node: Any = self.document
        for part in path.split("."):
            node = node.get(part, "") if isinstance(node, Mapping) else ""
        return node

    def _value_at(self, path: str) -> str:
        """Return the value at a path of the file, as text."""
        node = self._at(path)
        return node if isinstance(node, str) else toml(node)
