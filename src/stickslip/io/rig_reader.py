"""The reader of rig files: the scales first, then each record in natural units; every mistake in one line."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial, reduce
from typing import Any

from stickslip.io import rig_keys
from stickslip.io.keys import Key, toml
from stickslip.io.rig_keys import COEFFICIENTS, MATERIAL, SCALES, SHAPE, START, TABLES, keys_of
from stickslip.io.tables import MistakesError, Tables
from stickslip.model import Delay, FromRest, FromSliding, Interface, Output, Prestressed, Slider
from stickslip.model.body import BODIES
from stickslip.model.delays import DelayModel, OnArrest
from stickslip.model.drive import USUAL_DISTANCE, Drive, constant, ramp
from stickslip.model.methods import METHODS, Start
from stickslip.model.newborn import half_distance
from stickslip.model.operation import Operation
from stickslip.model.parameters import BY_NAME
from stickslip.model.records import declared
from stickslip.model.rig import Assumption, Fitted, Rig
from stickslip.model.units import Scales, si_unit

Values = dict[str, Any]
"""The values of a table: quantities in the units of the file, tables in it as they stand."""

_START = "simulation.start"
_MOST_DRAWS = 10_000
"""Draws of a fitted value: their 90 % interval is then known to 1 % of its width, and predictions take seconds."""
_SPEEDS = toml(["1 mm/s", "10 mm/s"]) + " or " + toml({"from": "1 mm/s", "to": "50 mm/s"})


def from_document(document: Mapping[str, Any], place: str = "rig") -> Rig:
    """Make a rig of the content of a file; `place` begins the message of an error.

    The error names every mistake: key, value, remedy; its `mistakes` are told apart, each with its key as `place`.
    """
    reader = _Reader(document)
    try:
        return reader.rig()
    except MistakesError:
        raise reader.file.in_one_line(place) from None


class _Reader:
    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self.file = Tables(natural=document.get("units") == "natural")
        self.scales: Scales | None = None
        self.body = next((name for name in reversed(["slider", *BODIES]) if name in document), "slider")

    def rig(self) -> Rig:
        """The rig that the file describes."""
        file = self.file
        bodies = {name: Key({}) for name in BODIES}
        top = file.table(self.document, {**bodies, **rig_keys.TOP})
        slider, interface, drive, simulation = self._tables(top)
        # What cannot be read is noted, and the rest is looked through.
        parts = {
            name: file.part(partial(self._record, interface.get(name), f"interface.{name}"))
            for name in ("initial", "thresholds", "newborn")
        }
        file.part(partial(self._scale, slider, interface, drive, parts))
        for name in ("delay", "ageing", "temperature"):
            parts[name] = file.part(partial(self._record, interface.get(name), f"interface.{name}"))
        assumed, fitted = self._assumed(top.get("assumed", {})), self._fitted(top.get("fitted", {}))
        feasible = self._feasible(top.get("feasible", {}))
        prestress = self._prestress(simulation["start"]) if "start" in simulation else {}
        file.stop()

        method = METHODS[simulation["method"]]
        given = {"contacts": 10_000 if self.body == "slider" else 100} | self._natural(
            simulation, rig_keys.keys_of_simulation(simulation["method"])
        )
        of_method = {name: given[key] for name, key in rig_keys.fields_of_method(method).items() if key in given}
        body = self._body(slider)
        return Rig(
            interface=self._interface(interface, parts),
            slider=body,
            drive=self._drive(drive),
            operation=file.make("drive", lambda: Operation(**self._speeds_in_use(drive), feasible=feasible)),
            method=file.make("simulation", lambda: method(**of_method), {"count": "contacts"}),
            start=self._start(given["start"], prestress, body),
            output=file.make("simulation", lambda: Output(interval=given.get("interval"))),
            scales=None if file.natural else self.scales,
            name=top["name"],
            source=top["source"],
            assumed=assumed,
            fitted=fitted,
        )

    # -------------------------------------------------- tables, and what they exclude

    def _tables(self, top: Mapping[str, Any]) -> list[Values]:
        """The values of the tables of what slides, of the interface, the drive and the simulation."""
        file, kinds = self.file, [name for name in ("slider", *BODIES) if name in self.document]
        if len(kinds) > 1:
            file.wrong(kinds[1], f"give {' or '.join(kinds)}, not both")
        given = {name: top.get(name, {}) for name in (self.body, "interface", "drive", "simulation")}
        of_tables = {name: content if isinstance(content, Mapping) else {} for name, content in given.items()}
        method = of_tables["simulation"].get("method", TABLES["simulation"]["method"].default)
        keys = {**rig_keys.tables(), "simulation": rig_keys.keys_of_simulation(method)}
        if file.natural:
            keys["interface"] = {name: key for name, key in TABLES["interface"].items() if name not in SCALES}
            file.refused |= {f"interface.{name}": "leave it out, as it is 1 where units = 'natural'" for name in SCALES}
        values = {name: file.table(content, keys[name], name) for name, content in given.items()}
        for name, content in given.items():
            for rule in rig_keys.RULES.get(name, ()):
                file.choose(content, rule, TABLES[name], name)
        for name in ("contacts", "seed", "rtol"):
            methods = rig_keys.methods_with(name)
            if name in of_tables["simulation"] and method in [each for each in METHODS if each not in methods]:
                words = " or ".join(map(repr, methods))
                file.wrong(f"simulation.{name}", f"belongs to method = {words}; leave it out with {method!r}")
        self._check(values, of_tables[self.body])
        return list(values.values())

    def _check(self, values: Mapping[str, Values], body: Mapping[str, Any]) -> None:
        """Note what is wrong with what slides, and with the speeds of the drive, beyond each key and the rules."""
        file, drive = self.file, values["drive"]
        if "damping_ratio" in values[self.body] and values[self.body].get("mass") == 0:
            file.wrong("slider.mass", "is 0, and damping_ratio needs a mass above 0; give damping instead")
        if not body.keys().isdisjoint(MATERIAL.get(self.body, {}).values()):
            for name in SHAPE:
                if name not in body:
                    file.missing(f"{self.body}.{name}", TABLES[self.body][name])
        drive["pieces"] = file.part(partial(self._pieces, drive.get("pieces"), "drive.pieces"))
        drive |= file.part(partial(self._speeds, drive.get("velocity"), "drive.velocity")) or {}
        if drive.get("velocity") == 0 and "duration" not in drive:
            file.wrong("drive.velocity", "is 0; give a velocity above 0, or a duration")

    def _pieces(self, content: Any, place: str) -> list[Values] | None:
        """The pieces of a drive, in the units of the file."""
        if content is None:
            return None
        if not isinstance(content, list) or not content:
            self.file.refuse(place, content, "must be a list of at least one table")
        return [self.file.table(piece, rig_keys.PIECE, f"{place}[{i}]") for i, piece in enumerate(content)]

    def _speeds(self, content: Any, place: str) -> Values:
        """Of a list or a range of speeds, one that is simulated, and all of them, in the units of the file."""
        key = replace(TABLES["drive"]["velocity"], sign="above 0", also=(), required=True)
        if isinstance(content, list) and content:
            each = replace(key, example=[key.example])
            speeds = self.file.make("drive", lambda: each.read(content, place, natural=self.file.natural))
            return {"velocity": speeds[0], "speeds": speeds}
        if isinstance(content, Mapping):
            before = len(self.file.mistakes)
            ends = self.file.table(content, {"from": key, "to": key}, place)
            self.file.stop(before)
            if ends["from"] < ends["to"]:
                return {"velocity": math.sqrt(ends["from"] * ends["to"]), "between": tuple(ends.values())}
        if isinstance(content, (list, Mapping)):
            self.file.refuse(place, content, f"must be speeds, as in {_SPEEDS}")
        return {}

    # -------------------------------------------------- scales

    def _scale(self, slider: Values, interface: Values, drive: Values, parts: Values) -> None:
        """Find the scales, unless what they need could not be read; forces are per contact of a block."""
        file = self.file
        if file.natural:
            self.scales = Scales(force=1.0, stretching=1.0)
        if file.natural or file.mistakes:
            return
        if "normal_load" in interface:
            from stickslip.io.friction import thresholds_of

            coefficients = (interface[name] for name in COEFFICIENTS)
            parts["thresholds"], strength = file.make(
                "interface.mu_s", lambda: thresholds_of(*coefficients, parts["initial"])
            )
            interface["contact_strength"] = strength * interface["normal_load"]
        blocks = 1 if self.body == "slider" else self._body(slider, scaled=False).size
        for name in ("contact_strength", "sliding_force"):
            interface[name] /= blocks
        velocities = [piece[end] for piece in drive["pieces"] or () for end in ("start", "end")] or [drive["velocity"]]
        fastest, x_s = max(map(abs, velocities)), interface["breaking_displacement"]
        # The unit of time drops out of every result; this one keeps the numbers near 1.
        self.scales = file.make(
            "interface",
            lambda: Scales(force=interface["contact_strength"], stretching=x_s, time=x_s / fastest if fastest else 1.0),
            {"force": "contact_strength", "stretching": "breaking_displacement"},
        )

    def _in(self, value: Any, unit: str) -> Any:
        """A value of the file, or some, in natural units."""
        if self.scales is None:
            raise MistakesError  # they could not be read
        if isinstance(value, tuple):
            return tuple(self._in(each, unit) for each in value)
        return value / self.scales.unit(unit) if unit and isinstance(value, float) else value

    def _natural(self, values: Values, keys: Mapping[str, Key]) -> Values:
        """The values of a table in natural units."""
        return {name: self._in(value, keys[name].unit) for name, value in values.items() if name in keys}

    # -------------------------------------------------- records

    def _record(self, content: Any, place: str) -> Any:
        """The record that a table names, in natural units; a delay may be a time or a word."""
        file, name = self.file, place.rpartition(".")[2]
        if content is None:
            return None
        if name == "delay" and not isinstance(content, Mapping):
            of_word: dict[Any, DelayModel] = {"never": Delay(math.inf), "on arrest": OnArrest()}
            return of_word.get(content) or file.make(place, lambda: Delay(self._in(content, "time")))
        word, kinds = rig_keys.KINDS[name]
        if name == "delay":
            content = {word: "random", **content}
        kind: Any = file.kind(content, place, word, kinds, TABLES["interface"][name].example)
        keys, before = keys_of(kind), len(file.mistakes)
        written = {name: value for name, value in content.items() if name != word}
        values, instead = file.table(written, keys, place), rig_keys.INSTEAD.get(kind)
        if instead is not None:
            file.choose(written, instead.rule, keys, place)
        values = {
            name: self._record(value, f"{place}.{name}") if isinstance(value, Mapping) else value
            for name, value in values.items()
        }
        file.stop(before)
        if any(key.unit for key in keys.values()):  # distributions are read before the scales
            values = self._natural(values, keys)
        if rig_keys.by_time(kind):
            time = values.pop("time")
            return file.make(place, lambda: kind(rate=1.0, **values).with_time(time), {"rate": "time"})
        names: dict[str, str] = {}
        if instead is not None and set(instead.keys) <= set(values):
            made = file.make(place, partial(instead.made, *(values.pop(name) for name in instead.keys)))
            values |= dict(zip(instead.fields, made, strict=True))
            names = dict.fromkeys(instead.fields, next(iter(instead.keys)))
        return file.make(place, lambda: kind(**values), names)

    def _interface(self, interface: Values, parts: Values) -> Interface:
        values = self._natural(interface, TABLES["interface"]) | parts
        fields = {name: values[name] for name in Interface.__dataclass_fields__ if name in values}
        made = self.file.make("interface", lambda: Interface(**fields))
        if "v_half" not in interface:
            return made

        def delay() -> Delay:
            # By way of seconds, so that a file in SI units can hold exactly this delay.
            seconds = half_distance(made) / interface["v_half"] / self._in(1.0, "x_s")
            return Delay(self._in(seconds, "time"))

        return replace(made, delay=self.file.make("interface.v_half", delay))

    def _body(self, values: Values, *, scaled: bool = True) -> Any:
        """What slides, in natural units or in those of the file: the material becomes springs and masses of blocks."""
        length, width, height = (values.get(key, math.nan) for key in SHAPE)
        # A spring from a block to the top is as long as the bar is high, one from row to row as a row is wide.
        shape = {
            "coupling": width * height / length,
            "leaf": width * length / height,
            "shear": height * length / width,
            "mass": width * height * length,
        }
        # Products in the units of the file: what follows from the material can be written into it again, bit for bit.
        material = {direct: name for direct, name in MATERIAL.get(self.body, {}).items() if name in values}
        made = values | {direct: values[name] * shape[direct] for direct, name in material.items()}
        made = self._natural(made, rig_keys.tables()[self.body]) if scaled else made
        if "damping_ratio" in made:
            held = self.file.make("slider", lambda: Slider(stiffness=made["stiffness"], mass=made["mass"], damping=0.0))
            made["damping"] = 2.0 * made["damping_ratio"] * held.frequency
        kind: Any = BODIES.get(self.body, Slider)
        return self.file.make(self.body, lambda: kind(**{name: made[name] for name in declared(kind) if name in made}))

    def _drive(self, drive: Values) -> Drive:
        if drive["pieces"]:
            pieces = [self._natural(piece, rig_keys.PIECE) for piece in drive["pieces"]]
            return reduce(
                Drive.then,
                [self.file.make(f"drive.pieces[{i}]", partial(ramp, **piece)) for i, piece in enumerate(pieces)],
            )
        given = self._natural(drive, TABLES["drive"])
        velocity, key = given["velocity"], next((key for key in ("duration", "distance") if key in given), "velocity")
        duration = given["duration"] if key == "duration" else given.get("distance", USUAL_DISTANCE) / abs(velocity)
        return self.file.make(f"drive.{key}", lambda: constant(velocity, duration))

    def _speeds_in_use(self, drive: Values) -> Values:
        """The speeds at which the rig works, in natural units."""
        return {name: self._in(drive[name], "x_s/time") for name in ("speeds", "between") if name in drive}

    # -------------------------------------------------- the start of a run

    def _prestress(self, content: Any) -> Values:
        """The values of a prestressed start; none for another one."""
        if not isinstance(content, Mapping):
            return {}
        if self.body == "slider":
            self.file.wrong(_START, f'as a table is for {" or ".join(BODIES)}; write "from rest" or "sliding"')
        return self.file.table(content, START, _START)

    def _start(self, word: Any, prestress: Values, body: Any) -> Start:
        if not prestress:
            return FromSliding() if word == "sliding" else FromRest()
        values = self._natural(prestress, START)
        if isinstance(values["stretching"], list):
            values["stretching"] = self._profile(values["stretching"], body.size)
        return self.file.make(_START, lambda: Prestressed(**values))

    def _profile(self, content: list[Any], size: int) -> tuple[float, ...]:
        """The stretching of each block, from a list of numbers or of runs of blocks alike."""
        runs, place, key = [], f"{_START}.stretching", START["stretching"]
        for i, item in enumerate(content):
            run = item if isinstance(item, Mapping) else {"blocks": 1, "stretching": item}
            runs.append(self.file.table(run, {"blocks": Key(20, required=True), "stretching": key}, f"{place}[{i}]"))
            if runs[-1].get("blocks", 1) < 1:
                self.file.wrong(f"{place}[{i}].blocks", "must be at least 1")
        self.file.stop()
        if (total := sum(run["blocks"] for run in runs)) != size:
            self.file.wrong(place, f"is of {total} blocks, but there are {size}; give one number, or one for each")
            self.file.stop()
        return tuple(run["stretching"] for run in runs for _ in range(run["blocks"]))

    # -------------------------------------------------- what is said of the rig

    def _feasible(self, content: object) -> tuple[tuple[str, float, float], ...]:
        """The ranges within which parameters could be set, in natural units."""
        units = {name: "" if each.unit == "1" else each.unit for name, each in BY_NAME.items()}
        examples: dict[str, Any] = {name: f"2 {si_unit(unit)}" if unit else 1.0 for name, unit in units.items()}
        keys = {name: Key([examples[name]] * 2, unit=unit, sign="above 0") for name, unit in units.items()}
        found = []
        for name, ends in self.file.table(content, keys, "feasible").items():
            if len(ends) != 2 or ends[0] > ends[1]:
                self.file.wrong(f"feasible.{name}", "must be two values, the lowest first")
            elif self.scales is not None:
                found.append((name, *self._in(ends, units[name])))
        return tuple(found)

    def _of_paths(self, content: object, table: str, key: Key) -> Values:
        """The values of a table whose keys are paths of keys of the file."""
        given = [str(path) for path in content] if isinstance(content, Mapping) else []
        known = {path: key for path in given if rig_keys.is_path(path)}
        strange = "names no key of a rig file; write it as 'interface.delay'"
        self.file.refused |= {f"{table}.{path}": strange for path in given if path not in known}
        return self.file.table(content, known, table)

    def _assumed(self, content: object) -> dict[str, Assumption]:
        """What the file marks as assumed, then the defaults that were taken; each with its value."""
        marked = self._of_paths(content, "assumed", Key("text"))
        found = {path: Assumption(self._value_at(path), how) for path, how in marked.items()}
        given = self.document.get("interface")
        for name, key in TABLES["interface"].items():
            here = isinstance(given, Mapping) and (name in given or (name == "delay" and "v_half" in given))
            if key.measure and not here and f"interface.{name}" not in found:
                value = "0 s" if key.unit and not self.file.natural else toml(key.default)
                found[f"interface.{name}"] = Assumption(value, key.measure, default=True)
        return found

    def _fitted(self, content: object) -> dict[str, Fitted]:
        """What the file marks as fitted, each with its value, interval and draws."""
        found: dict[str, Fitted] = {}
        for path, entry in self._of_paths(content, "fitted", Key({})).items():
            values = self.file.table(entry, rig_keys.FITTED, f"fitted.{path}")
            draws = values.get("draws", ())
            if len(draws) > _MOST_DRAWS:
                self.file.wrong(f"fitted.{path}.draws", f"more than {_MOST_DRAWS} values; give every tenth, say")
            key = rig_keys.key_at(path, self.document)
            if key and draws and not key.takes(min(draws)):
                self.file.wrong(f"fitted.{path}.draws", f"holds {min(draws):g}; {path} must be {key.sign}")
            if len(values) == len(rig_keys.FITTED):
                found[path] = Fitted(self._value_at(path), **values)
        if len({len(one.draws) for one in found.values() if one.draws}) > 1:
            counts = ", ".join(f"{len(one.draws)} of {path}" for path, one in found.items())
            self.file.wrong("fitted", f"draws belong together, but there are {counts}; give as many of each")
        return found

    def _value_at(self, path: str) -> str:
        """What stands at a path of the file; empty if nothing does."""
        node: Any = self.document
        for part in path.split("."):
            node = node.get(part, "") if isinstance(node, Mapping) else ""
        return node if isinstance(node, str) else toml(node)
