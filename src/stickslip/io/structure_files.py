"""Reading of structures in rig files: `slider.modes`, `slider.matrices`,
`slider.state_space` and `controller`.
"""

import math
import re
from collections.abc import Mapping
from typing import Any

from stickslip.errors import InputError, refused
from stickslip.io import rig_keys
from stickslip.io.tables import Tables, Values, at
from stickslip.model.body import Mass
from stickslip.model.structure import (
    ControlledAxis,
    Matrices,
    Modes,
    StateSpace,
    Structure,
    cascade,
)

KEYS_OF_MODES = {
    "masses": "mass",
    "stiffnesses": "stiffness",
    "dampings": "damping",
    "contact": "contact",
    "drive": "drive",
}
"""Keys of each of `slider.modes`, by the field of `Modes` that holds them."""
_HERTZ = {"Hz": "1/s", "kHz": "1/ms", "MHz": "1/us"}


def structure_kind(document: Mapping[str, Any]) -> str:
    """Return the kind of the slider of a file, of those in `rig_keys.OF_SLIDER`; empty
    for a mass on a spring.
    """
    if "controller" in document:
        return "controller"
    if "force" in rig_keys.within(document, "drive"):
        return "force"
    slider = rig_keys.within(document, "slider")
    return next((kind for kind in rig_keys.STRUCTURES if kind in slider), "")


def structure_of(
    file: Tables, kind: str, slider: Values, controller: object
) -> Structure | Mass:
    """Return the structure that a file describes, in the units of the file."""
    if kind == "force":
        return _mass(**slider)
    if kind == "controller":
        return _axis(file, slider, controller)
    place = f"slider.{kind}"
    spring = slider.get("stiffness", 0.0)
    if kind == "modes":
        return _modes(file, slider[kind], spring)
    values = file.whole(slider[kind], rig_keys.STRUCTURES[kind], place)
    with at(place):
        if kind == "matrices":
            return Matrices(**values, stiffness=spring)
        return StateSpace(**values)


def _mass(mass: float, damping: float, stiffness: float) -> Mass:
    if stiffness:
        raise InputError(
            "slider.stiffness: drive.force pulls a mass without a spring; leave one of "
            "them out",
            "slider.stiffness",
        )
    with at("slider"):
        return Mass(mass=mass, damping=damping)


def _axis(file: Tables, slider: Values, controller: object) -> ControlledAxis:
    values = file.whole(
        controller,
        rig_keys.TABLES["controller"],
        "controller",
        rig_keys.RULES["controller"],
    )
    gains = [values.pop(name, None) for name in ("kpp", "kv", "kiv")]
    if None not in gains:
        values |= dict(zip(("kp", "ki", "kd"), cascade(*gains), strict=True))
    with at("controller"):
        return ControlledAxis(**slider, **values)


def _modes(file: Tables, content: object, spring: float) -> Modes:
    """Return the modes of a list of tables; a frequency may be in hertz."""
    place = "slider.modes"
    if not isinstance(content, list) or not content:
        raise refused(place, content, "must be tables, each as in [[slider.modes]]")
    keys = rig_keys.STRUCTURES["modes"]
    rules = rig_keys.RULES["modes"]
    read = [
        file.whole(_without_hertz(mode), keys, f"{place}[{i}]", rules)
        for i, mode in enumerate(content)
    ]
    for mode in read:
        if "frequency" in mode:
            omega = 2.0 * math.pi * mode["frequency"]
            mode["stiffness"] = mode["mass"] * omega**2
        if "damping_ratio" in mode:
            own = math.sqrt(mode["stiffness"] / mode["mass"])
            mode["damping"] = 2.0 * mode["damping_ratio"] * own
    fields: dict[str, Any] = {
        field: tuple(mode.get(key, mode["contact"]) for mode in read)
        for field, key in KEYS_OF_MODES.items()
    }
    with at(place, KEYS_OF_MODES):
        return Modes(**fields, stiffness=spring)


def _without_hertz(mode: object) -> object:
    """Return a mode with a frequency in hertz converted to a unit such as 1/s."""
    given = mode.get("frequency") if isinstance(mode, Mapping) else None
    if not isinstance(mode, Mapping) or not isinstance(given, str):
        return mode
    found = re.fullmatch(r"(.*[\d.]) *([kM]?Hz)", given)
    if found is None:
        return mode
    return {**mode, "frequency": f"{found[1]} {_HERTZ[found[2]]}"}
