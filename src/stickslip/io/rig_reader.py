"""The reader of rig files: each record in the units of the file, then the whole rig in natural ones.

Every mistake is noted, and told in one line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial, reduce
from typing import Any

from stickslip.io import rig_keys
from stickslip.io.keys import Key, toml
from stickslip.io.rig_keys import COEFFICIENTS, MATERIAL, SCALES, SHAPE, TABLES, keys_of
from stickslip.io.tables import MistakesError, Tables
from stickslip.model import Delay, FromRest, FromSliding, Interface, Output, Prestressed, Slider
from stickslip.model.body import BODIES
from stickslip.model.delays import DelayModel, OnArrest
from stickslip.model.drive import USUAL_DISTANCE, Drive, constant, ramp
from stickslip.model.methods import METHODS, Start
from stickslip.model.newborn import half_distance
from stickslip.model.parameters import BY_NAME, converted_ranges
from stickslip.model.records import converted, declared
from stickslip.model.rig import Assumption, Fitted, Operation, Rig
from stickslip.model.units import Scales, si_unit

Values = dict[str, Any]
"""The values of a table, in the units of the file; tables in it as they stand."""

_START = "simulation.start"
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
        self.body = next((name for name in reversed(["slider", *BODIES]) if name in document), "slider")
        self.length = 1.0  # of the breaking displacement, in the units of the file

    def rig(self) -> Rig:
        """The rig that the file describes."""
        file = self.file
        top = file.table(self.document, {**{name: Key({}) for name in BODIES}, **rig_keys.TOP})
        tables = [self._table(name, top.get(name, {})) for name in (self.body, "interface", "drive", "simulation")]
        slider, interface, drive, simulation = tables
        self._check_body(slider)
        # What cannot be read is noted, and the rest is looked through.
        self.length = interface.get("breaking_displacement", 1.0)
        parts = {
            name: file.part(partial(self._record, interface[name], f"interface.{name}"))
            for name in rig_keys.KINDS
            if name in interface
        }
        pulled, speeds = file.part(partial(self._drive, drive)) or (constant(0.0, 1.0), {})
        feasible = self._feasible(top.get("feasible", {}))
        assumed, fitted = self._assumed(top.get("assumed", {})), self._fitted(top.get("fitted", {}))
        file.stop()

        body = self._body(slider)
        blocks = 1 if self.body == "slider" else body.size
        start = self._start(simulation["start"], blocks)
        blocks = 1 if file.natural else blocks  # forces are those of all blocks in SI files only
        scales = self._scales(interface, parts, pulled, blocks)
        rig = Rig(
            interface=self._interface(interface | parts, blocks),
            slider=body,
            drive=pulled,
            operation=file.make(
                "drive", lambda: Operation(**speeds, feasible=converted_ranges(feasible, scales.natural))
            ),
            method=self._method(simulation),
            start=start,
            output=file.make("simulation", lambda: Output(interval=simulation.get("interval"))),
            scales=None if file.natural else scales,
            name=top["name"],
            source=top["source"],
            assumed=assumed,
            fitted=fitted,
        )
        rig = file.make("rig", lambda: converted(rig, scales.natural))
        return self._with_what_follows(rig, scales, slider | interface | drive)

    def _with_what_follows(self, rig: Rig, scales: Scales, values: Values) -> Rig:
        """The rig with what the file gives by numbers that belong together, found in natural units."""
        if "damping_ratio" in values:
            damping = 2.0 * values["damping_ratio"] * rig.slider.frequency
            rig = self.file.make("slider", lambda: replace(rig, slider=replace(rig.slider, damping=damping)))
        if "v_half" in values:
            # By way of seconds, so that a file in SI units can hold exactly this delay.
            path = self.file.make("interface.v_half", partial(half_distance, rig.interface))
            seconds = path / values["v_half"] / scales.natural(1.0, "x_s")
            delay = Delay(scales.natural(seconds, "time"))
            rig = replace(rig, interface=replace(rig.interface, delay=delay))
        if "velocity" in values and "duration" not in values:
            distance = scales.natural(values["distance"], "x_s") if "distance" in values else USUAL_DISTANCE
            velocity = rig.drive.pieces[0].start
            rig = replace(rig, drive=constant(velocity, distance / abs(velocity)))
        return rig

    # -------------------------------------------------- tables, and what they exclude

    def _table(self, name: str, content: object) -> Values:
        """The values of a table of the file, looked through for keys that exclude each other."""
        file, keys = self.file, rig_keys.tables()[name]
        left_out: dict[str, str] = {}
        if name == "simulation" and isinstance(content, Mapping):
            keys, left_out = rig_keys.keys_of_simulation(content.get("method", keys["method"].default))
        if name == "interface" and file.natural:
            left_out = dict.fromkeys(SCALES, "leave it out, as it is 1 where units = 'natural'")
            keys = {key: each for key, each in keys.items() if key not in SCALES}
        file.refused |= {f"{name}.{key}": why for key, why in left_out.items()}
        values = file.table(content, keys, name)
        for rule in rig_keys.RULES.get(name, ()):
            file.choose(content, rule, keys, name)
        return values

    def _whole(self, content: object, keys: Mapping[str, Key], place: str) -> Values:
        """The values of a table without mistakes."""
        before = len(self.file.mistakes)
        values = self.file.table(content, keys, place)
        self.file.stop(before)
        return values

    # -------------------------------------------------- records in the units of the file

    def _record(self, content: Any, place: str) -> Any:
        """The record that a table names; a delay may be a time or a word."""
        file, name = self.file, place.rpartition(".")[2]
        if name == "delay" and not isinstance(content, Mapping):
            of_word: dict[Any, DelayModel] = {"never": Delay(math.inf), "on arrest": OnArrest()}
            return of_word.get(content) or file.make(place, lambda: Delay(content))
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
        if rig_keys.by_time(kind):
            time = values.pop("time")
            return file.make(place, lambda: kind(rate=1.0, **values).with_time(time), {"rate": "time"})
        names: dict[str, str] = {}
        if instead is not None and instead.keys.keys() <= values.keys():
            given = [values.pop(name) for name in instead.keys]
            made = file.make(place, partial(instead.made, *given, length=self.length))
            values |= dict(zip(instead.fields, made, strict=True))
            names = dict.fromkeys(instead.fields, next(iter(instead.keys)))
        return file.make(place, lambda: kind(**values), names)

    def _interface(self, values: Values, blocks: int) -> Interface:
        fields = {name: value for name, value in values.items() if name in Interface.__dataclass_fields__}
        fields["sliding_force"] = values["sliding_force"] / blocks
        return self.file.make("interface", lambda: Interface(**fields))

    def _body(self, values: Values) -> Any:
        """What slides, its springs and masses of blocks made of the material; without a damping that is a ratio."""
        length, width, height = (values.get(key, math.nan) for key in SHAPE)
        # A spring from a block to the top is as long as the bar is high, one from row to row as a row is wide.
        shape = {
            "coupling": width * height / length,
            "leaf": width * length / height,
            "shear": height * length / width,
            "mass": width * height * length,
        }
        # In the units of the file: what follows from the material can be written into it again, bit for bit.
        material = {direct: name for direct, name in MATERIAL.get(self.body, {}).items() if name in values}
        made = {"damping": 0.0} | values | {direct: values[name] * shape[direct] for direct, name in material.items()}
        kind: Any = BODIES.get(self.body, Slider)
        return self.file.make(self.body, lambda: kind(**{name: made[name] for name in declared(kind) if name in made}))

    def _check_body(self, values: Values) -> None:
        """Note what is wrong with what slides beyond each key and the rules."""
        kinds = [name for name in ("slider", *BODIES) if name in self.document]
        if len(kinds) > 1:
            self.file.wrong(kinds[1], f"give {' or '.join(kinds)}, not both")
        if "damping_ratio" in values and values.get("mass") == 0:
            self.file.wrong("slider.mass", "is 0, and damping_ratio needs a mass above 0; give damping instead")
        if not values.keys().isdisjoint(MATERIAL.get(self.body, {}).values()):
            for name in SHAPE:
                if name not in values:
                    self.file.missing(f"{self.body}.{name}", TABLES[self.body][name])

    def _drive(self, values: Values) -> tuple[Drive, Values]:
        """The drive, and the speeds at which the rig works; how long it goes follows where it is not given."""
        file, content = self.file, values.get("pieces")
        if content is not None:
            if not isinstance(content, list) or not content:
                file.refuse("drive.pieces", content, "must be a list of at least one table")
            read = [self._whole(piece, rig_keys.PIECE, f"drive.pieces[{i}]") for i, piece in enumerate(content)]
            pieces = [file.make(f"drive.pieces[{i}]", partial(ramp, **piece)) for i, piece in enumerate(read)]
            return reduce(Drive.then, pieces), {}
        velocity, speeds = self._speeds(values.get("velocity"), "drive.velocity")
        if velocity == 0 and "duration" not in values:
            file.wrong("drive.velocity", "is 0; give a velocity above 0, or a duration")
        if velocity is None or (velocity == 0 and "duration" not in values):
            raise MistakesError
        return file.make("drive", lambda: constant(velocity, values.get("duration", 1.0))), speeds

    def _speeds(self, content: Any, place: str) -> tuple[float | None, Values]:
        """Of a list or a range of speeds one that is simulated, and all of them."""
        key = replace(TABLES["drive"]["velocity"], sign="above 0", also=(), required=True)
        if isinstance(content, list) and content:
            each = replace(key, example=[key.example])
            speeds = self.file.make("drive", lambda: each.read(content, place, natural=self.file.natural))
            return speeds[0], {"speeds": speeds}
        if isinstance(content, Mapping):
            low, high = self._whole(content, {"from": key, "to": key}, place).values()
            if low < high:
                return math.sqrt(low * high), {"between": (low, high)}
        if isinstance(content, (list, Mapping)):
            self.file.refuse(place, content, f"must be speeds, as in {_SPEEDS}")
        return content, {}

    def _method(self, values: Values) -> Any:
        kind = METHODS[values["method"]]
        given = {"contacts": 10_000 if self.body == "slider" else 100} | values
        fields = {name: given[key] for name, key in rig_keys.fields_of_method(kind).items() if key in given}
        return self.file.make("simulation", lambda: kind(**fields), {"count": "contacts"})

    def _start(self, content: Any, blocks: int) -> Start:
        if not isinstance(content, Mapping):
            return FromSliding() if content == "sliding" else FromRest()
        if self.body == "slider":
            self.file.refuse(_START, content, f"must be 'from rest' or 'sliding'; a table is for {' or '.join(BODIES)}")
        values, place = self._whole(content, rig_keys.START, _START), f"{_START}.stretching"
        if isinstance(profile := values["stretching"], list):
            runs = [item if isinstance(item, Mapping) else {"blocks": 1, "stretching": item} for item in profile]
            runs = [self._whole(run, rig_keys.RUN, f"{place}[{i}]") for i, run in enumerate(runs)]
            if (total := sum(run["blocks"] for run in runs)) != blocks:
                self.file.refuse(place, profile, f"is of {total} blocks, but there are {blocks}; give one for each")
            values["stretching"] = tuple(run["stretching"] for run in runs for _ in range(run["blocks"]))
        return self.file.make(_START, lambda: Prestressed(**values))

    # -------------------------------------------------- scales

    def _scales(self, interface: Values, parts: Values, drive: Drive, blocks: int) -> Scales:
        """The scales of the rig, forces per contact of a block; of coefficients of friction the thresholds, too."""
        if self.file.natural:
            return Scales(force=1.0, stretching=1.0)
        strength = interface.get("contact_strength")
        if strength is None:
            from stickslip.io.friction import thresholds_of

            coefficients = (interface[name] for name in COEFFICIENTS)
            find = partial(thresholds_of, *coefficients, parts["initial"])
            parts["thresholds"], share = self.file.make("interface.mu_s", find)
            strength = share * interface["normal_load"]
        fastest, x_s = max(abs(end) for piece in drive.pieces for end in (piece.start, piece.end)), self.length
        # The unit of time drops out of every result; this one keeps the numbers near 1.
        return self.file.make(
            "interface",
            lambda: Scales(force=strength / blocks, stretching=x_s, time=x_s / fastest if fastest else 1.0),
            {"force": "contact_strength", "stretching": "breaking_displacement"},
        )

    # -------------------------------------------------- what is said of the rig

    def _feasible(self, content: object) -> list[tuple[str, float, float]]:
        """The ranges within which parameters could be set."""
        units = {name: "" if each.unit == "1" else each.unit for name, each in BY_NAME.items()}
        examples: dict[str, Any] = {name: f"2 {si_unit(unit)}" if unit else 1.0 for name, unit in units.items()}
        keys = {name: Key([examples[name]] * 2, unit=unit, sign="above 0") for name, unit in units.items()}
        found = self.file.table(content, keys, "feasible")
        for name, ends in found.items():
            if len(ends) != 2 or ends[0] > ends[1]:
                self.file.wrong(f"feasible.{name}", "must be two values, the lowest first")
        return [(name, *ends) for name, ends in found.items()]

    def _of_paths(self, content: object, table: str, key: Key) -> Values:
        """The values of a table whose keys are paths of keys of the file."""
        given = [str(path) for path in content] if isinstance(content, Mapping) else []
        return self.file.table(content, dict.fromkeys(rig_keys.paths(given), key), table)

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
            with suppress(MistakesError):
                found[path] = Fitted(self._value_at(path), **self._whole(entry, rig_keys.FITTED, f"fitted.{path}"))
        return found

    def _value_at(self, path: str) -> str:
        """What stands at a path of the file; empty if nothing does."""
        node: Any = self.document
        for part in path.split("."):
            node = node.get(part, "") if isinstance(node, Mapping) else ""
        return node if isinstance(node, str) else toml(node)
