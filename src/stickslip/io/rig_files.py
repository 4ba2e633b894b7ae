"""Rig files: TOML, in SI or natural units, to records of the model and back.

The records of the model check the values of a file; `stickslip.io.rig_keys` defines its
keys. Stretchings of distributions are relative to ``interface.breaking_displacement``.
"""

import os
import re
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from stickslip.errors import InputError, instance, shortened
from stickslip.io.curve_files import friction_points
from stickslip.io.files import FileName
from stickslip.io.rig_reader import from_document as from_document
from stickslip.io.rig_writer import Document
from stickslip.io.rig_writer import to_document as to_document
from stickslip.io.tables import read_toml
from stickslip.model.rig import Rig

EXAMPLES = Path(__file__).parents[1] / "examples"
"""Folder of the rigs that come with the package."""


def example_names() -> tuple[str, ...]:
    """Return the names of the rigs that come with the package, without the sweeps."""
    files = sorted(EXAMPLES.glob("*.toml"))
    return tuple(
        file.stem for file in files if "[axes]" not in file.read_text(encoding="utf-8")
    )


def example_file(name: str) -> Path:
    """Return the path of the file of a rig or sweep that comes with the package, such
    as ``"pmma_slider"``.
    """
    instance("example: name", name, str, "the name of an example")
    known = sorted(f.stem for f in EXAMPLES.glob("*.toml"))
    if name not in known:
        raise InputError(
            f"{shortened(name)}: no such file or example; examples are "
            f"{', '.join(known)}"
        )
    return EXAMPLES / f"{name}.toml"


def example(name: str) -> Rig:
    """Return a rig that comes with the package, such as ``"brake_pad"``.

    Raises
    ------
    InputError
        If there is no rig of that name; the message lists all.
    """
    return read_rig(example_file(name))


def read_rig(path: FileName | Mapping[str, Any]) -> Rig:
    """Read a rig from a TOML file, or from a mapping with the content of one.

    Without a file of that name, it may also be the name of an example that comes with
    the package, such as ``"brake_pad"``.

    Raises
    ------
    InputError
        If the file is missing, empty, binary or no TOML, has an unknown key, or an
        impossible value; the message names file, key, value and remedy.

    Examples
    --------
    >>> rig = ss.read_rig("brake_pad")
    >>> rig.value("velocity")
    0.02
    """
    if isinstance(path, Mapping):
        return from_document(path)
    instance(
        "read_rig: path",
        path,
        (str, os.PathLike),
        "a file, the name of an example, or a mapping",
    )
    return from_document(content_of(Path(path)), Path(path).name)


def content_of(
    path: Path,
    kind: str = "rig file",
    example: str = "`stickslip new pmma_slider`",
    change: Callable[[Document], None] | None = None,
) -> Document:
    """Return the content of a file or, if there is no such file, of the example of that
    name, after a change, with the points of a friction curve that it names.
    """
    if not path.suffix and not path.exists():
        path = example_file(str(path))
    content = read_toml(path, kind, example)
    if change is not None:
        change(content)
    interface = content.get("interface")
    if isinstance(interface, dict) and isinstance(interface.get("friction"), str):
        interface["friction"] = friction_points(path.parent / interface["friction"])
    return content


def to_toml(rig: Rig, *, own: bool = False) -> str:
    """Return the text of a file from which `read_rig` makes the same rig.

    With `own`, the text has four digits, and the keys by which the rig was given.

    Raises
    ------
    InputError
        If the rig has a part that cannot be written into a file.
    """
    import tomli_w

    document = to_document(rig, digits=4, own=True) if own else to_document(rig)

    # tomli_w writes each number of a list into a line of its own
    def wrapped(numbers: re.Match[str]) -> str:
        return textwrap.fill(
            f"[{' '.join(numbers[1].split()).removesuffix(',')}]",
            110,
            subsequent_indent="    ",
        )

    return re.sub(r"\[\n((?: {4}[-+.\de]+,\n)+)\]", wrapped, tomli_w.dumps(document))
