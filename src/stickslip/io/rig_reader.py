"""The reader of rig files: tables of keys in, records of the model out, every mistake on the way in one line."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial, reduce
from typing import Any, TypeVar

from stickslip.errors import InputError, shown, together
from stickslip.io import rig_keys
from stickslip.io.bodies import BODIES, body_from, missing, size_of, start_from, wrong
from stickslip.io.keys import Key, toml
from stickslip.io.rig_keys import keys_of
from stickslip.model import (
    Delay,
    FromRest,
    FromSliding,
    Interface,
    Method,
    Output,
    Slider,
    Start,
)
from stickslip.model.activation import ACTIVATIONS, Activation, Bell
from stickslip.model.ageing import AGEING_MODELS, AgeingModel
from stickslip.model.delays import DELAYS, DelayModel, OnArrest
from stickslip.model.distributions import DISTRIBUTIONS, Distribution, Empirical
from stickslip.model.drive import USUAL_DISTANCE, Drive, constant, ramp
from stickslip.model.methods import METHODS
from stickslip.model.newborn import half_distance
from stickslip.model.operation import Operation
from stickslip.model.parameters import Parameter, parameter_named
from stickslip.model.records import declared
from stickslip.model.rig import Assumption, Fitted, Rig
from stickslip.model.units import Scales, si_unit

Made = TypeVar("Made")


class MistakesError(Exception):
    """What stands in the file cannot be read on."""


class _MissingError(InputError):
    """A key is missing; the example is a value that it could have."""

    def __init__(self, place: str, example: Any) -> None:
        super().__init__(f"{place}: is missing; write, for example, {place} = {toml(example)}", place)
        self.example = toml(example)


_MOST_EACH = 40
"""Mistakes that are told each at its key, too: a form has no more; a file of thousands is no rig file."""


def in_one_line(mistakes: list[InputError], place: str) -> InputError:
    """One error for every mistake in a file, as far as a line reaches."""
    missing = [mistake for mistake in mistakes if isinstance(mistake, _MissingError)]
    lines = [str(mistake) for mistake in mistakes if not isinstance(mistake, _MissingError)]
    if len(missing) == 1:
        lines.append(str(missing[0]))
    elif missing:
        examples = ", ".join(f"{mistake.place} = {mistake.example}" for mistake in missing)
        lines.append(f"missing, here with example values: {examples}")
    key = mistakes[0].place if len(mistakes) == 1 else ""
    return InputError(f"{place}: {together(lines)}", key, tuple(mistakes) if len(mistakes) <= _MOST_EACH else ())


class Reader:
    """Reads the tables of a file one after the other, and notes every mistake on the way."""

    def __init__(self, *, natural: bool) -> None:
        self.natural = natural
        self.mistakes: list[InputError] = []

    # -------------------------------------------------- tables and values

    def wrong(self, place: str, what: str) -> None:
        """Note a mistake."""
        self.mistakes.append(InputError(f"{place}: {what}", place))

    def table(self, content: object, keys: Mapping[str, Key], place: str = "") -> dict[str, Any]:
        """Values of a table, quantities in SI units or natural ones; tables in it as they stand."""
        if not isinstance(content, Mapping):
            self.mistakes.append(InputError(f"{place} = {shown(content)}: must be a table, as in [{place}]", place))
            return {}
        path = f"{place}." if place else ""
        for name in content:
            if name not in keys:
                self.wrong(path + str(name)[:60], self._unknown(path, str(name), keys))
        found: dict[str, Any] = {}
        for name, key in keys.items():
            if name not in content:
                if key.required and not key.is_table:
                    self.mistakes.append(_MissingError(path + name, self._example(key)))
                elif key.required:
                    found[name] = {}
                elif key.default is not None:
                    found[name] = key.default
            elif key.is_left(content[name]):
                found[name] = content[name]
            else:
                try:
                    found[name] = key.read(content[name], path + name, natural=self.natural)
                except InputError as error:
                    self.mistakes.append(error)
        return found

    def _example(self, key: Key) -> Any:
        return 1.0 if self.natural and key.unit else key.example

    def _unknown(self, path: str, name: str, keys: Mapping[str, Key]) -> str:
        if renamed := rig_keys.RENAMED.get(path + name):
            return renamed
        near = difflib.get_close_matches(name, keys, n=1, cutoff=0.5)
        return f"unknown key; did you mean {near[0]!r}?" if near else f"unknown key; known here: {', '.join(keys)}"

    def make(self, place: str, make: Callable[[], Made], names: Mapping[str, str] | None = None) -> Made:
        """Make a record; its complaint about a field becomes one about the key, which `names` may name."""
        try:
            return make()
        except InputError as error:
            field = error.place.partition(".")[2]
            key = (names or {}).get(field, field)
            self.mistakes.append(error.at(f"{place}.{key}" if key else place))
            raise MistakesError from None

    def stop(self) -> None:
        """Read no further if there was a mistake."""
        if self.mistakes:
            raise MistakesError

    # -------------------------------------------------- parts of a rig

    def rig(self, document: Mapping[str, Any]) -> Rig:
        """The rig that a file describes."""
        document, speeds, between = self._speeds(document)
        top = self.table(document, rig_keys.TOP)
        kind = self._kind_of_slider(document)
        elastic = kind in BODIES
        slider, interface, drive, simulation = self._tables(top, kind)
        if elastic:
            self._check_body(kind, document[kind])
        else:
            self._check_slider(slider, document)
        self._check_strength(interface, document)
        self._check_drive(drive, document)
        parts = self._parts(interface, document)
        pieces = self._part(self.pieces, drive.get("pieces"), "drive.pieces")
        assumed = self._assumed(top.get("assumed", {}), document)
        fitted = self._fitted(top.get("fitted", {}), document)
        feasible = self._feasible(top.get("feasible", {}))
        prestress = self._prestress(simulation, elastic=elastic)
        self.stop()

        if _of_coefficients(interface):
            from stickslip.io.friction import thresholds_of

            parts["thresholds"], strength = self.make(
                "interface.mu_s", lambda: thresholds_of(interface["mu_s"], interface["mu_k"], parts["initial"])
            )
            interface["contact_strength"] = strength * interface["normal_load"]
        if elastic and not self.natural:  # forces are per contact of a block
            for name in ("contact_strength", "sliding_force"):
                interface[name] /= size_of(kind, slider)
        scales = None if self.natural else self._scales(interface, drive, pieces)

        def natural(value: float, unit: str) -> float:
            return value if scales is None else value / scales.unit(unit)

        if scales is not None:
            parts["delay"] = _in(parts["delay"], natural)
        operation = self.make(
            "drive",
            lambda: Operation(
                speeds=tuple(natural(speed, "x_s/time") for speed in speeds),
                between=tuple(natural(speed, "x_s/time") for speed in between) if between else None,
                feasible=tuple((p.name, natural(a, p.unit), natural(b, p.unit)) for p, a, b in feasible),
            ),
        )
        made = self._interface(interface, parts, natural)
        start: Start = FromSliding() if simulation["start"] == "sliding" else FromRest()
        if elastic:
            body = self.make(kind, lambda: body_from(kind, slider, natural))
            if prestress:
                start = self.make(_START, lambda: start_from(prestress, body, natural))
        count = simulation.get("contacts", 100 if elastic else 10_000)
        return Rig(
            operation=operation,
            name=top["name"],
            source=top["source"],
            interface=made,
            slider=body if elastic else self._slider(slider, natural),
            drive=self._drive(drive, pieces, natural),
            method=self.make(
                "simulation",
                lambda: method_from(simulation | {"contacts": count}),
                {"count": "contacts"},
            ),
            start=start,
            output=self.make(
                "simulation",
                lambda: Output(interval=natural(simulation["interval"], "time") if "interval" in simulation else None),
            ),
            scales=scales,
            assumed=assumed,
            fitted=fitted,
        )

    def _kind_of_slider(self, document: Mapping[str, Any]) -> str:
        """Which table describes what slides."""
        kinds = [name for name in ("slider", *BODIES) if name in document] or ["slider"]
        if len(kinds) > 1:
            self.wrong(kinds[1], f"give {' or '.join(kinds)}, not both")
        return kinds[-1]

    def _tables(self, top: Mapping[str, Any], kind: str) -> Iterator[dict[str, Any]]:
        """The values of the tables of what slides, of the interface, the drive and the simulation."""
        given = top.get("simulation", {})
        method = given.get("method") if isinstance(given, Mapping) else None
        keys = {**rig_keys.TABLES, "simulation": rig_keys.keys_of_simulation(method)}
        made = METHODS.get(str(method or rig_keys.SIMULATION["method"].default))
        if isinstance(given, Mapping) and "rtol" in given and made and "rtol" not in rig_keys.fields_of_method(made):
            self.wrong("simulation.rtol", "belongs to the master equation and population; leave it out")
        return (self.table(top.get(name, {}), keys[name], name) for name in (kind, "interface", "drive", "simulation"))

    def _parts(self, interface: Mapping[str, Any], document: Mapping[str, Any]) -> dict[str, Any]:
        """The parts of the interface that are tables of their own; what contradicts another is noted."""
        coefficients = _of_coefficients(interface)
        read = {
            "initial": self.distribution,
            "thresholds": self.distribution,
            "delay": self.delay,
            "newborn": self.distribution,
            "ageing": self.ageing,
            "temperature": self.temperature,
        }
        given = {"delay": 0.0, **interface}
        parts = {name: self._part(reader, given.get(name), f"interface.{name}") for name, reader in read.items()}
        content = document.get("interface")
        written: Mapping[str, Any] = content if isinstance(content, Mapping) else {}
        if "thresholds" not in interface and not (coefficients or _of_coefficients(written)):
            self.mistakes.append(_MissingError("interface.thresholds", rig_keys.INTERFACE["thresholds"].example))
        if coefficients and "thresholds" in interface:
            self.wrong("interface.thresholds", "leave it out beside mu_s and mu_k, which say how wide it is")
        if coefficients and "newborn" in interface:
            self.wrong(
                "interface.newborn", "leave it out beside mu_s and mu_k, or give contact_strength in their place"
            )
        if "areas" in interface and (coefficients or "v_half" in interface):
            self.wrong(
                "interface.areas", "leave it out beside mu_s, mu_k and v_half, which are read as of equal contacts"
            )
        if "delay" in written and "v_half" in written:
            self.wrong("interface", "give delay or v_half, not both")
        return parts

    def _interface(
        self, interface: Mapping[str, Any], parts: Mapping[str, Any], natural: Callable[[float, str], float]
    ) -> Interface:
        """The interface, its scales known."""
        ageing, temperature = parts["ageing"], parts["temperature"]
        made: Interface = self.make(
            "interface",
            lambda: Interface(
                thresholds=parts["thresholds"],
                initial=parts["initial"],
                delay=parts["delay"],
                ageing=None if ageing is None else ageing(natural),
                temperature=None if temperature is None else temperature(natural),
                sliding_force=natural(interface["sliding_force"], "f_s"),
                newborn=parts["newborn"],
                track_scatter=interface["track_scatter"],
                areas=interface.get("areas"),
            ),
        )
        if "v_half" not in interface:
            return made

        def delay() -> Delay:
            # By way of seconds, so that a file in SI units can hold exactly this delay.
            seconds = half_distance(made) / interface["v_half"] / natural(1.0, "x_s")
            return Delay(natural(seconds, "time"))

        return replace(made, delay=self.make("interface.v_half", delay))

    def _part(self, read: Callable[[Any, str], Made], content: Any, place: str) -> Any:
        """A part of the file, or None where it cannot be read: the mistake is noted, and the others are looked for."""
        try:
            return None if content is None else read(content, place)
        except MistakesError:
            return None

    def _speeds(self, document: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[float], tuple[float, float] | None]:
        """The file with one velocity in place of a list or range of them; the list, and the range, as in the file."""
        drive = document.get("drive")
        given = drive.get("velocity") if isinstance(drive, Mapping) else None
        if not isinstance(drive, Mapping) or not isinstance(given, (list, Mapping)):
            return document, [], None
        key = replace(rig_keys.DRIVE["velocity"], sign="above 0")

        def read(content: Mapping[str, Any]) -> list[float]:
            return [key.read(value, f"drive.velocity{name}", natural=self.natural) for name, value in content.items()]

        example = toml(["1 mm/s", "10 mm/s"]) + " or " + toml({"from": "1 mm/s", "to": "50 mm/s"})
        between: tuple[float, float] | None = None
        try:
            if isinstance(given, list):
                speeds = read({f"[{i}]": value for i, value in enumerate(given)})
                first = given[0] if given else None
            else:
                low, high = read({f".{name}": given.get(name) for name in ("from", "to")})
                speeds, between = [], (low, high)
                middle = math.sqrt(low * high)
                first = middle if self.natural else f"{middle!r} m/s"
            if first is None or (between and between[0] >= between[1]) or (set(given) - {"from", "to"} and between):
                raise InputError(f"drive.velocity = {shown(given)}: must be speeds, as in {example}", "drive.velocity")
        except InputError as error:
            self.mistakes.append(error)
            raise MistakesError from None
        return {**document, "drive": {**drive, "velocity": first}}, speeds, between

    def _feasible(self, content: object) -> list[tuple[Parameter, float, float]]:
        """The ranges within which parameters could be set, as in the file."""
        found: list[tuple[Parameter, float, float]] = []
        if not isinstance(content, Mapping):
            self.wrong("feasible", 'must be a table, as in [feasible] stiffness = ["1 MN/m", "10 MN/m"]')
            return found
        for name, given in content.items():
            place = f"feasible.{name}"
            try:
                parameter = parameter_named(str(name), place="feasible")
                if not isinstance(given, list) or len(given) != 2:
                    raise InputError(f"{place} = {shown(given)}: must be two values, lowest and highest", place)
                key = Key("", f"2 {si_unit(parameter.unit)}", unit=parameter.unit, sign="above 0")
                key = Key("", 1.0, sign="above 0") if parameter.unit == "1" else key
                low, high = (key.read(item, f"{place}[{i}]", natural=self.natural) for i, item in enumerate(given))
                if low > high:
                    raise InputError(f"{place} = {shown(given)}: the lowest value comes first", place)
                found.append((parameter, low, high))
            except InputError as error:
                self.mistakes.append(error)
        return found

    def _check_slider(self, slider: dict[str, Any], document: Mapping[str, Any]) -> None:
        given = document.get("slider", {})
        if not isinstance(given, Mapping):
            return
        if not {"damping", "damping_ratio", "relative_damping"} & set(given):
            self.mistakes.append(_MissingError("slider.damping_ratio", rig_keys.SLIDER["damping_ratio"].example))
        elif "damping" in given and "damping_ratio" in given:
            self.wrong("slider", "needs one of damping (eta of Eq. (11)) and damping_ratio (zeta), not both")
        elif "damping_ratio" in given and slider.get("mass") == 0:
            self.wrong("slider.mass", "is 0, and damping_ratio needs a mass above 0; give damping instead")

    def _check_body(self, kind: str, given: object) -> None:
        if isinstance(given, Mapping):
            for place, what in wrong(kind, given):
                self.wrong(place, what)
            for key in missing(kind, given, natural=self.natural):
                self.mistakes.append(_MissingError(f"{kind}.{key}", self._example(rig_keys.TABLES[kind][key])))

    def _prestress(self, simulation: Mapping[str, Any], *, elastic: bool) -> dict[str, Any]:
        """The values of a prestressed start; none for another one."""
        if not isinstance(simulation.get("start"), Mapping):
            return {}
        if not elastic:
            self.wrong(_START, f'as a table is for {" or ".join(BODIES)}; write "from rest" or "sliding"')
        return self.table(simulation["start"], rig_keys.START, _START)

    def _check_strength(self, interface: dict[str, Any], document: Mapping[str, Any]) -> None:
        given = document.get("interface", {})
        if not isinstance(given, Mapping) or "friction_coefficient" in given:
            return  # told of already
        interface = {name: given[name] for name in given if name in rig_keys.INTERFACE}
        by_load = [name for name in ("normal_load", "mu_s", "mu_k") if name in interface]
        if self.natural:
            for name in (*by_load, "contact_strength", "breaking_displacement"):
                if name in interface:
                    self.wrong(f"interface.{name}", "leave it out, as it is 1 where units = 'natural'")
            return
        if "contact_strength" in interface and by_load:
            self.wrong("interface", f"give contact_strength, or {', '.join(by_load)}, not both")
        elif by_load:
            for name in {"normal_load", "mu_s", "mu_k"} - set(by_load):
                self.mistakes.append(_MissingError(f"interface.{name}", rig_keys.INTERFACE[name].example))
        for name in ("contact_strength", "breaking_displacement"):
            if name not in interface and not (name == "contact_strength" and by_load):
                self.mistakes.append(_MissingError(f"interface.{name}", rig_keys.INTERFACE[name].example))

    def _check_drive(self, drive: dict[str, Any], document: Mapping[str, Any]) -> None:
        given = document.get("drive", {})
        if not isinstance(given, Mapping):
            return
        if "velocity" not in given and "pieces" not in given:
            self.mistakes.append(_MissingError("drive.velocity", self._example(rig_keys.DRIVE["velocity"])))
        elif "velocity" in given and "pieces" in given:
            self.wrong("drive", "needs either velocity, or pieces (each with start, end and duration)")
        elif "pieces" in given and ("distance" in given or "duration" in given):
            self.wrong("drive", "leave distance and duration out beside pieces, which have durations of their own")
        elif "distance" in given and "duration" in given:
            self.wrong("drive", "needs distance or duration, not both")
        elif drive.get("velocity") == 0 and "duration" not in given:
            self.wrong("drive.velocity", "is 0; give a velocity above 0, or a duration")

    def distribution(self, content: Any, place: str) -> Distribution:
        """The distribution that a table names."""
        kind = self._kind(content, place, "distribution", DISTRIBUTIONS, rig_keys.INTERFACE["thresholds"].example)
        before = len(self.mistakes)
        values = self.table(_without(content, "distribution"), keys_of(kind), place)
        two_ways = kind is Empirical and ("samples" in values) == ("edges" in values and "weights" in values)
        if two_ways and len(self.mistakes) == before:
            self.wrong(place, "needs either samples, or edges and weights")
        values = {
            name: self.distribution(value, f"{place}.{name}") if isinstance(value, Mapping) else value
            for name, value in values.items()
        }
        if len(self.mistakes) > before:
            raise MistakesError
        if "samples" in values:
            return self.make(place, lambda: Empirical.from_samples(values["samples"]))
        made: Distribution = self.make(place, lambda: kind(**values))
        return made

    def _kind(
        self, content: Any, place: str, word: str, kinds: Mapping[str, type], example: Mapping[str, Any]
    ) -> type[Any]:
        """The record that a table names."""
        if not isinstance(content, Mapping):
            written = f"{place} = {shown(content)}: must be a table, such as {toml(example)}"
            self.mistakes.append(InputError(written, place))
        elif content.get(word) not in tuple(kinds):
            key = f"{place}.{word}"
            given = f"{key} = {shown(content[word])}" if word in content else key
            known = f"must be one of the known {word}s {', '.join(map(repr, kinds))}, as in {toml(example)}"
            self.mistakes.append(InputError(f"{given}: {known}", key))
        else:
            return kinds[str(content[word])]
        raise MistakesError

    def delay(self, content: Any, place: str) -> DelayModel:
        """A delay whose times are in the units of the file."""
        if content == "never":
            return Delay(math.inf)
        if content == "on arrest":
            return OnArrest()
        if not isinstance(content, Mapping):
            return self.make(place, lambda: Delay(content))
        kind = self._kind({"model": "random", **content}, place, "model", DELAYS, rig_keys.DELAY)
        before = len(self.mistakes)
        values = self.table(_without(content, "model"), rig_keys.keys_of_delay(kind), place)
        if len(self.mistakes) > before:
            raise MistakesError
        made: DelayModel = self.make(place, lambda: kind(**values))
        return made

    def ageing(self, content: Any, place: str) -> Callable[[Callable[[float, str], float]], AgeingModel]:
        """A model of ageing, to be made when the unit of time is known."""
        kind = self._kind(content, place, "model", AGEING_MODELS, rig_keys.INTERFACE["ageing"].example)
        before = len(self.mistakes)
        keys = keys_of(kind)
        values = self.table(_without(content, "model"), keys, place)
        if len(self.mistakes) > before:
            raise MistakesError

        def made(natural: Callable[[float, str], float]) -> AgeingModel:
            fields = {
                name: natural(value, keys[name].unit) if keys[name].unit else value for name, value in values.items()
            }
            if rig_keys.by_time(kind):
                fields["rate"] = rig_keys.rate_of(kind, fields.pop("time"))
            model: AgeingModel = self.make(place, lambda: kind(**fields), {"rate": "time"})
            return model

        return made

    def temperature(self, content: Any, place: str) -> Callable[[Callable[[float, str], float]], Activation]:
        """Thermal activation, to be made when the scales are known."""
        example = rig_keys.INTERFACE["temperature"].example
        kind = self._kind(content, place, "kind", ACTIVATIONS, example)
        before = len(self.mistakes)
        keys = rig_keys.BELL if kind is Bell else keys_of(kind)
        values = self.table(_without(content, "kind"), keys, place)
        physical = [name for name, key in keys.items() if key.si]
        given = [name for name in physical if name in content]
        if kind is Bell and len(self.mistakes) == before:
            if "width" in content and given:
                self.wrong(place, f"give width, or {', '.join(physical)}, not both")
            elif "width" not in content:
                for name in physical:
                    if name not in content:
                        self.mistakes.append(_MissingError(f"{place}.{name}", keys[name].example))
        if len(self.mistakes) > before:
            raise MistakesError

        def made(natural: Callable[[float, str], float]) -> Activation:
            fields = {
                name: natural(value, keys[name].unit) if keys[name].unit else value
                for name, value in values.items()
                if name not in physical
            }
            if given:
                energy = values["shear_strength"] * values["activation_volume"]
                fields["width"] = rig_keys.BOLTZMANN * values["temperature"] / energy
            activation: Activation = self.make(
                place, lambda: kind(**fields), {"width": "temperature"} if given else None
            )
            return activation

        return made

    def pieces(self, content: Any, place: str) -> list[dict[str, float]]:
        """The pieces of a drive, in the units of the file."""
        if not isinstance(content, list) or not content:
            self.mistakes.append(InputError(f"{place} = {shown(content)}: must be a list of at least one table", place))
            raise MistakesError
        before = len(self.mistakes)
        found = [self.table(piece, rig_keys.PIECE, f"{place}[{i}]") for i, piece in enumerate(content)]
        if len(self.mistakes) > before:
            raise MistakesError
        return found

    def _assumed(self, content: object, document: Mapping[str, Any]) -> dict[str, Assumption]:
        """What the file marks as assumed, then the defaults that were taken; each with its value."""
        found: dict[str, Assumption] = {}
        if not isinstance(content, Mapping):
            self.mistakes.append(InputError(f"assumed = {shown(content)}: must be a table, as in [assumed]", "assumed"))
            return found
        text = Key("", "text")
        for path, how in content.items():
            try:
                rig_keys.check_path(path)
                words = text.read(how, f"assumed.{path}", natural=True)
            except InputError as error:
                self.mistakes.append(error)
            else:
                found[path] = Assumption(_value_at(document, path), words)
        given = document.get("interface")
        for name, key in rig_keys.INTERFACE.items():
            here = isinstance(given, Mapping) and (name in given or (name == "delay" and "v_half" in given))
            if key.measure and not here and f"interface.{name}" not in found:
                value = "0 s" if key.unit and not self.natural else _plainly(key.default)
                found[f"interface.{name}"] = Assumption(value, key.measure, default=True)
        return found

    def _fitted(self, content: object, document: Mapping[str, Any]) -> dict[str, Fitted]:
        """What the file marks as fitted, each with its value, interval and draws."""
        found: dict[str, Fitted] = {}
        if not isinstance(content, Mapping):
            self.mistakes.append(InputError(f"fitted = {shown(content)}: must be a table, as in [fitted]", "fitted"))
            return found
        for path, entry in content.items():
            try:
                rig_keys.check_path(path, "fitted")
            except InputError as error:
                self.mistakes.append(error)
                continue
            values = self.table(entry, rig_keys.FITTED, f"fitted.{path}")
            if len(values.get("draws", ())) > _MOST_DRAWS:
                self.wrong(f"fitted.{path}.draws", f"more than {_MOST_DRAWS} values; give every tenth, say")
            if len(values) == len(rig_keys.FITTED):
                found[path] = Fitted(_value_at(document, path), **values)
        if len({len(one.draws) for one in found.values() if one.draws}) > 1:
            counts = ", ".join(f"{len(one.draws)} of {path}" for path, one in found.items())
            self.wrong("fitted", f"draws belong together, but there are {counts}; give as many of each")
        return found

    def _scales(
        self, interface: dict[str, Any], drive: dict[str, Any], pieces: list[dict[str, float]] | None
    ) -> Scales:
        velocities = [drive.get("velocity", 0.0)] if pieces is None else [p[end] for p in pieces for end in _ENDS]
        fastest = max(map(abs, velocities))
        x_s = interface["breaking_displacement"]
        # The unit of time drops out of every result; this one keeps the numbers near 1.
        time = x_s / fastest if fastest else 1.0
        return self.make(
            "interface",
            lambda: Scales(force=interface["contact_strength"], stretching=x_s, time=time),
            {"force": "contact_strength", "stretching": "breaking_displacement"},
        )

    def _slider(self, slider: dict[str, Any], natural: Callable[[float, str], float]) -> Slider:
        mass, stiffness = natural(slider["mass"], "f_s time^2/x_s"), natural(slider["stiffness"], "k")
        held = self.make("slider", lambda: Slider(stiffness=stiffness, mass=mass, damping=0.0))
        if "damping" in slider:
            damping = natural(slider["damping"], "1/time")
        else:
            damping = 2.0 * slider["damping_ratio"] * held.frequency
        return self.make("slider", lambda: replace(held, damping=damping))

    def _drive(
        self,
        drive: dict[str, Any],
        pieces: list[dict[str, float]] | None,
        natural: Callable[[float, str], float],
    ) -> Drive:
        if pieces is not None:
            made = []
            for i, piece in enumerate(pieces):
                start, end = (natural(piece[name], "x_s/time") for name in _ENDS)
                ends = partial(ramp, start, end, natural(piece["duration"], "time"))
                made.append(self.make(f"drive.pieces[{i}]", ends))
            return reduce(Drive.then, made)
        velocity = natural(drive["velocity"], "x_s/time")
        if "duration" in drive:
            return self.make("drive.duration", lambda: constant(velocity, natural(drive["duration"], "time")))
        distance = natural(drive["distance"], "x_s") if "distance" in drive else USUAL_DISTANCE
        given = "distance" if "distance" in drive else "velocity"
        return self.make(f"drive.{given}", lambda: constant(velocity, distance / abs(velocity)))


_ENDS = ("start", "end")
_START = "simulation.start"
_MOST_DRAWS = 10_000
"""Draws of a fitted value: their 90 % interval is then known to 1 % of its width, and predictions take seconds."""


def method_from(simulation: Mapping[str, Any]) -> Method:
    """Make the method that a table names, of those of its keys that are fields of it."""
    kind = METHODS[simulation["method"]]
    found = {name: simulation[key] for name, key in rig_keys.fields_of_method(kind).items() if key in simulation}
    made: Method = kind(**found)
    return made


def _of_coefficients(interface: Mapping[str, Any]) -> bool:
    """Whether static and kinetic friction say how strong the contacts are."""
    return "mu_s" in interface and "mu_k" in interface


def _without(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in content.items() if key != name}


def _in(delay: Made, natural: Callable[[float, str], float]) -> Made:
    """A delay in natural units."""
    kind: Any = type(delay)
    times = {
        name: natural(getattr(delay, name), mark.unit)
        for name, (_, mark) in declared(kind).items()
        if mark is not None and mark.unit != "1"
    }
    return replace(delay, **times)  # type: ignore[type-var]


def _value_at(document: Mapping[str, Any], path: str) -> str:
    """What stands at a path in a document; empty if nothing does."""
    node: Any = document
    for part in path.split("."):
        if not isinstance(node, Mapping) or part not in node:
            return ""
        node = node[part]
    return _plainly(node)


def _plainly(value: Any) -> str:
    return value if isinstance(value, str) else toml(value)
