"""The browser app: see sliding turn into stick-slip. `serve` starts it; the command is ``stickslip explore``.

It needs the extra ``pip install stickslip[explorer]`` and asks no other host for anything.

- `server`: the loopback server, what it refuses, and the sessions in which the newest request wins.
- `answers`: a request in, plain data for the page out; no state.
- `documents`: rigs as the page holds them (the content of a rig file): presets, parameters varied, errors by field.
- ``static/``: the page.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from stickslip.errors import InputError, whole

NEEDS = ("plotly", "starlette", "uvicorn", "websockets")
"""Packages that the extra brings."""

PORT = 8317
"""Port taken by default; if it is in use, any free one."""


def serve(rig: Path | None = None, *, port: int | None = None, ready: Callable[[str], None] | None = None) -> None:
    """Serve the app on the loopback interface until interrupted.

    Parameters
    ----------
    rig : Path, optional
        A rig file to begin with.
    port : int, optional
        0 for any free one.
    ready : callable, optional
        Called with the address once the server listens.

    Raises
    ------
    InputError
        If the extra is not installed, the rig file cannot be used, or the port is in use.
    """
    if missing := [name for name in NEEDS if find_spec(name) is None]:
        raise InputError(f"explore: needs {', '.join(missing)}; pip install 'stickslip[explorer]'")
    from stickslip.explorer import server

    if port is not None:
        port = whole("--port", port, at_least=0, at_most=65_535)
    server.run(rig, port, ready)
