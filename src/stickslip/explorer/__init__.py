"""The browser app: see sliding turn into stick-slip.

`serve` starts it; the command is ``stickslip explore``.

It needs the extra ``pip install stickslip[explorer]`` and asks no other host for
anything.

- `server`: pages and sessions in which the newest request wins, and refusals.
- `workers`: processes that compute, bounded and killed if they do not stop; `warm` is
  loaded before they are made.
- `simulate`, `stability`, `traces`, `fronts`: a page each: a request in, `plain` data
  for the page out; no state.
- `documents`: rigs as the page holds them (the content of a rig file): presets,
  parameters varied, errors by field.
- ``static/``: the page.
"""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from stickslip.errors import InputError, whole

NEEDS = ("plotly", "starlette", "uvicorn", "websockets")
"""Packages that the extra brings."""

PORT = 8317  # port taken by default; if it is in use, any free one


EXPOSED = """\
Shared with this network until you stop it: whoever has this link can simulate on this machine, in runs of about a
second and searches of at most a minute each, and have force traces of up to 5 MB read. Visitors see the rig that you
opened it with, none of your files, and no rig or trace of another visitor. The link is the only lock, and it is sent in
the clear (http): give it to people in the room, not to the internet."""  # noqa: E501
"""Warning that ``--share`` prints: the rights of visitors, and their limits."""


def serve(
    rig: Path | None = None,
    *,
    port: int | None = None,
    ready: Callable[[str], None] | None = None,
    share: bool = False,
) -> None:
    """Serve the app until interrupted, on the loopback interface unless it is shared
    (`EXPOSED`).

    `rig` is a file to begin with, port 0 any free one; `ready` is called with the
    address once the server listens.
    """
    if missing := [name for name in NEEDS if find_spec(name) is None]:
        raise InputError(
            f"explore: needs {', '.join(missing)}; pip install 'stickslip[explorer]'"
        )
    from stickslip.explorer import server

    if port is not None:
        port = whole("--port", port, at_least=0, at_most=65_535)
    server.run(rig, port, ready, share)
