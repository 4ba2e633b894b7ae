"""The contacts of a rig as a functional mock-up unit: FMI 2.0, co-simulation, in C.

`element.c` is the element of `stickslip.kernels.element` in C; this module writes its
tables and the description of the unit, and compiles it.
"""

import hashlib
import io
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from string import Template
from xml.sax.saxutils import quoteattr

from stickslip.errors import InputError, printable
from stickslip.kernels.element import ElementState
from stickslip.model import Contacts, Rig
from stickslip.model.units import engineering
from stickslip.simulation.engines.base import Beginning, engine_of
from stickslip.structures.contacts import element_of

_COUNT = 1000  # number of contacts if the rig has another method
_MOST = 100_000  # most contacts: tables of more take minutes to compile
_STEP = 0.01  # proposed step, in breaking displacements of travel
_SECONDS = 300.0  # longest time of the compiler, which usually takes two seconds
_COMPILER = "gcc"
_FLAGS = "-std=c99", "-O2", "-ffp-contract=off"  # without fused operations
_LIBRARY = "-fPIC", "-shared", "-fvisibility=hidden"
_PLACES = {"linux": "linux64/stickslip.so", "darwin": "darwin64/stickslip.dylib"}


def check(rig: Rig) -> None:
    """Raise `InputError` for a mechanism that a unit does not support, and without a
    compiler.
    """
    who = "an FMU"
    rig.interface.allow(rig.interface.mechanisms - {"ageing", "activation"}, who)
    method = _method(rig)
    engine_of(rig.interface, method)
    if method.count > _MOST:
        raise InputError(
            f"simulation.contacts = {method.count}: an FMU takes up to {_MOST}; give "
            "fewer"
        )
    if shutil.which(_COMPILER) is None:
        raise InputError(
            f"{_COMPILER}: is not installed, and an FMU is compiled; install it, as in "
            "`apt install gcc`"
        )


def unit_of(rig: Rig) -> bytes:
    """Return the bytes of the unit, with the number of contacts of the rig, and their
    seed.
    """
    velocity = rig.natural.velocity
    beginning = Beginning(rig.interface, None, velocity, rig.start)
    state = element_of(beginning, _method(rig))
    tables = _tables(rig, state)
    source = resources.files(__package__) / "element.c"
    code = source.read_text(encoding="utf-8")
    guid = hashlib.sha256((code + tables).encode()).hexdigest()[:32]
    tables = f'#define GUID "{guid}"\n{tables}'
    template = resources.files(__package__) / "modelDescription.xml"
    description = Template(template.read_text(encoding="utf-8")).substitute(
        guid=guid,
        name=quoteattr(printable(rig.name)),
        step=repr(_STEP * rig.unit("length") / rig.velocity),
        count=state.contacts.size,
        far=engineering(rig.unit("length"), "m"),
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (
            ("modelDescription.xml", description.encode()),
            (f"binaries/{_PLACES[sys.platform]}", _compiled(code, tables)),
        ):
            # a fixed date, so that the same rig gives the same bytes
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16  # else unzip makes an unreadable file
            archive.writestr(entry, content)
    return file.getvalue()


def _method(rig: Rig) -> Contacts:
    return rig.method if isinstance(rig.method, Contacts) else Contacts(_COUNT)


def _number(value: float) -> str:
    """Return a number in C, exact to the bit."""
    if value != value:
        return "NAN"
    if abs(value) == float("inf"):
        return "INFINITY" if value > 0 else "-INFINITY"
    return float(value).hex()


def _array(name: str, values: Iterable[float], width: int = 0) -> str:
    """Return a constant array in C; with a width, as rows of that many numbers."""
    each = [_number(value) for value in values] or ["0.0"] * max(width, 1)
    rows = [", ".join(each)]
    if width:
        starts = range(0, len(each), width)
        rows = [f"{{{', '.join(each[i : i + width])}}}" for i in starts]
    of_rows = f"[{width}]" if width else ""
    body = ",\n".join(rows)
    return f"static const double {name}[]{of_rows} = {{\n{body}\n}};\n"


def _tables(rig: Rig, state: ElementState) -> str:
    """Return the constants of a unit in C."""
    draws = state.draws
    quantiles = draws.quantiles
    beyond = draws.beyond
    numbers = {
        "LENGTH": rig.unit("length"),
        "TIME": rig.unit("time"),
        "FORCE": rig.unit("force"),
        "STIFFNESS": rig.unit("stiffness"),
        "FARTHEST": 1e4,
        "DELAY_TIME": draws.delay,
        "SLIDING_FORCE": draws.sliding_force,
        "BEYOND_INVERSE": beyond.inverse,
        "BEYOND_LOW": beyond.low,
        "BEYOND_TOP": beyond.top,
    }
    counts = {
        "CONTACTS": state.contacts.size,
        "BEYOND_CELLS": len(beyond.pieces) // 2,
        "STRETCHED": draws.stretched,
        "ON_ARREST": draws.on_arrest,
        "TRACKS": draws.tracks,
        "AREAS": draws.areas,
        "KEPT": draws.kept,
    }
    first = ", ".join(map(str, quantiles.first.tolist()))
    return "".join(
        [
            *(f"#define {name} ({_number(v)})\n" for name, v in numbers.items()),
            *(f"#define {name} {int(count)}\n" for name, count in counts.items()),
            f"static const int FIRST[] = {{{first}}};\n",
            _array("EDGES", quantiles.edges.tolist()),
            _array("PIECES", quantiles.pieces.ravel().tolist(), 9),
            _array("BEYOND", beyond.pieces.ravel().tolist(), 8),
            _array("BEGIN", state.memory.tolist()),
        ]
    )


def _compiled(code: str, tables: str) -> bytes:
    """Return the bytes of the compiled library."""
    with tempfile.TemporaryDirectory(prefix="stickslip-") as name:
        folder = Path(name)
        (folder / "element.c").write_text(code)
        (folder / "tables.h").write_text(tables)
        line = [_COMPILER, *_FLAGS, *_LIBRARY, "element.c", "-o", "unit", "-lm"]
        try:
            subprocess.run(
                line,
                cwd=folder,
                check=True,
                capture_output=True,
                text=True,
                timeout=_SECONDS,
            )
        except subprocess.CalledProcessError as error:
            first = error.stderr.strip().splitlines() or ["no message"]
            raise InputError(f"{_COMPILER}: fails: {first[0]}") from None
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputError(f"{_COMPILER}: cannot be run ({error})") from None
        return (folder / "unit").read_bytes()
