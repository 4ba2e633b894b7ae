"""Rig files: TOML in SI units (or natural ones) in, records of the model out, and back.

The records of the model are what a file is read into and checked by; what the keys of a
file mean stands in `stickslip.io.rig_keys`. Stretchings of distributions are relative
to ``interface.breaking_displacement``.
"""

import os
import re
import textwrap
from collections.abc import Mapping
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
    """Return the names of the rigs that come with the package, without sweeps, which
    name one.
    """
    files = sorted(EXAMPLES.glob("*.toml"))
    return tuple(
        file.stem for file in files if "[axes]" not in file.read_text(encoding="utf-8")
    )


def example_file(name: str) -> Path:
    """Return the file of a rig or sweep that comes with the package, such as
    ``"pmma_slider"``.
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
        If there is none of that name; the message lists them.
    """
    return read_rig(example_file(name))


def read_rig(path: FileName | Mapping[str, Any]) -> Rig:
    """Read a rig from a TOML file, or from a mapping of what a file would hold.

    The bare name of an example that comes with the package, such as ``"brake_pad"``, is
    read too where no file is called so.

    Raises
    ------
    InputError
        If the file is missing, empty, binary or no TOML, has an unknown key, or a value
        that cannot be; the message names file, key, value and remedy.

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
    path: Path, kind: str = "rig file", example: str = "`stickslip new pmma_slider`"
) -> Document:
    """Read the content of a file, or of the example of that name where there is no
    such file; a friction curve that it names is read, too.
    """
    if not path.suffix and not path.exists():
        path = example_file(str(path))
    content = read_toml(path, kind, example)
    interface = content.get("interface")
    if isinstance(interface, dict) and isinstance(interface.get("friction"), str):
        interface["friction"] = friction_points(path.parent / interface["friction"])
    return content


def to_toml(rig: Rig, *, own: bool = False) -> str:
    """Return the rig as the text of a file from which `read_rig` makes the same rig.

    With `own` it is in the keys that the rig was given by, and in four digits.

    Raises
    ------
    InputError
        If the rig has a part that no file can hold.
    """
    import tomli_w

    document = to_document(rig, digits=4, own=True) if own else to_document(rig)

    # which it writes each into a line of its own
    def wrapped(numbers: re.Match[str]) -> str:
        return textwrap.fill(
            f"[{' '.join(numbers[1].split()).removesuffix(',')}]",
            110,
            subsequent_indent="    ",
        )

    return re.sub(r"\[\n((?: {4}[-+.\de]+,\n)+)\]", wrapped, tomli_w.dumps(document))
