"""Values that the command line sets in a rig: ``--set drive.velocity="2 mm/s"``."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from stickslip.errors import InputError, shortened
from stickslip.io.files import FileName
from stickslip.io.rig_files import content_of, read_rig
from stickslip.io.rig_keys import RULES, TABLES, TOP
from stickslip.io.rig_reader import from_document
from stickslip.io.rig_writer import Document
from stickslip.model.rig import Rig


def read_rig_with(path: FileName, settings: Sequence[str]) -> Rig:
    """Read a rig from a file or an example, with other values of some of its keys.

    Each setting is ``table.key=value``. A key replaces its alternatives:
    ``slider.damping`` replaces ``slider.damping_ratio``.

    Raises
    ------
    InputError
        If a setting has no key or no value, or the changed file describes no rig.

    Examples
    --------
    >>> from stickslip.io.settings import read_rig_with
    >>> rig = read_rig_with("brake_pad", ["drive.velocity=2 mm/s"])
    >>> rig.value("velocity")
    0.002
    """
    if not settings:
        return read_rig(path)

    def change(document: Document) -> None:
        for setting in settings:
            _set(document, setting)

    document = content_of(Path(path), change=change)
    return from_document(document, f"{Path(path).name} with --set")


def _set(document: Document, setting: str) -> None:
    """Set one value in the content of a file."""
    key, sign, text = (part.strip() for part in setting.partition("="))
    *tables, name = key.split(".")
    if not (sign and text and all([*tables, name])):
        raise InputError(
            f"--set {shortened(setting)}: must be a key of the file and its value, "
            'such as drive.velocity="2 mm/s"'
        )
    if not tables and name not in TOP:
        homes = [f"{each}.{name}" for each in document if name in TABLES.get(each, ())]
        if homes:
            raise InputError(
                f"--set {shortened(setting)}: did you mean {' or '.join(homes)}?"
            )
    place = document
    for table in tables:
        place = place.setdefault(table, {})
        if not isinstance(place, dict):
            raise InputError(f"--set {shortened(setting)}: {table!r} is no table")
    for other in _replaced(tables, name):
        place.pop(other, None)
    place[name] = _value(text)


def _replaced(tables: Sequence[str], name: str) -> set[str]:
    """Return the keys of the same table that a key replaces."""
    replaced = set[str]()
    for rule in RULES.get(".".join(tables), ()):
        if name in rule.names:
            others = [keys for keys in rule.alternatives if name not in keys]
            replaced.update(*others)
    return replaced


def _value(text: str) -> Any:
    """Return the number, list or table of a TOML text; any other text unchanged."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
