"""The browser app, which shows sliding turn into stick-slip.

`serve` starts it; the command is ``stickslip explore``.

It needs the extra ``pip install stickslip[explorer]`` and sends no request to any other
host.

- `server`: pages, and sessions in which the newest request wins; refusals.
- `workers`: processes that compute, with limits, and are killed if they do not stop;
  `warm` is loaded before they are forked.
- `simulate`, `stability`, `traces`, `fronts`: one page each: they turn a request into
  `plain` data for the page, without state.
- `documents`: rigs in the form of the page (the content of a rig file): presets, varied
  parameters, errors by field.
- ``static/``: the page.
"""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from stickslip.errors import InputError, whole

NEEDS = ("plotly", "starlette", "uvicorn", "websockets")
"""Packages that the extra installs."""

PORT = 8317  # default port; if it is in use, any free one


EXPOSED = """\
Shared with this network until you stop it: whoever has this link can simulate on this machine, in runs of about a
second and searches of at most a minute each, and have force traces of up to 5 MB read. Visitors see the rig that you
opened it with, none of your files, and no rig or trace of another visitor. The link is the only lock, and it is sent in
the clear (http): give it to people in the room, not to the internet."""  # noqa: E501
"""Warning that ``--share`` prints: what visitors may do, and their limits."""


def serve(
    rig: Path | None = None,
    *,
    port: int | None = None,
    ready: Callable[[str], None] | None = None,
    share: bool = False,
) -> None:
    """Serve the app until interrupted, on the loopback interface unless it is shared
    (`EXPOSED`).

    `rig` is the file to begin with, port 0 any free port; `ready` is called with the
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
