"""The loopback server: pages, one websocket for each window, and what is refused.

Nothing is kept between requests: the page sends the whole rig each time, so windows cannot disturb each other. On each
websocket there is a lane for each kind of question; in a lane the newest question wins, and older ones are dropped.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import asynccontextmanager, suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from stickslip.errors import InputError, UndecidedError, shown
from stickslip.explorer import PORT, answers, documents
from stickslip.io import rig_files as rigs

HOST = "127.0.0.1"
LONGEST = 60.0
"""Seconds after which a run is given up."""

_STATIC = Path(__file__).parent / "static"
_POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; object-src 'none'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)  # plotly.js writes styles into the elements that it makes
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
}
_ANSWERS: dict[str, Callable[[answers.Plain, answers.Watch], Iterator[answers.Plain]]] = {
    "run": answers.run,
    "stretchings": answers.stretchings,
    "edit": answers.edit,
    "chart": answers.chart,
    "band": answers.band,
    "advice": answers.advice,
}
_SLOW = ("chart", "band", "advice")


def run(rig: Path | None, port: int | None, ready: Callable[[str], None] | None) -> None:
    """Serve until interrupted; see `stickslip.explorer.serve`."""
    begin = documents.first() if rig is None else documents.of(rigs.read_rig(rig))
    with _listen(port) as listening:
        number = listening.getsockname()[1]
        config = uvicorn.Config(
            application(begin, number),
            ws="websockets-sansio",
            ws_max_size=16 * documents.LARGEST_REQUEST,  # up to here the answer says what is wrong
            log_level="warning",
            server_header=False,
            timeout_graceful_shutdown=2,
        )
        if ready is not None:
            ready(f"http://{HOST}:{number}/")
        with suppress(KeyboardInterrupt):  # the usual way to stop it
            uvicorn.Server(config).run(sockets=[listening])


def _listen(port: int | None) -> socket.socket:
    """Bind to the loopback interface only."""
    for candidate in (PORT, 0) if port is None else (port,):
        try:
            return socket.create_server((HOST, candidate))
        except OSError as error:
            reason = os.strerror(error.errno or 0).lower()
    raise InputError(f"--port {port}: cannot be used ({reason}); choose another, or 0 for any free one")


def application(begin: documents.Document, port: int) -> ASGIApp:
    """Return the app that begins with a document and is reached on a port of the loopback interface."""
    pools = {"quick": ThreadPoolExecutor(4, "quick"), "slow": ThreadPoolExecutor(2, "slow")}

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> Any:
        threading.Thread(target=_warm, args=(begin,), daemon=True).start()
        yield
        for pool in pools.values():
            pool.shutdown(wait=False, cancel_futures=True)

    app = Starlette(
        routes=[
            Route("/", _page),
            Route("/plotly.min.js", _plotly),
            Mount("/static", StaticFiles(directory=_STATIC)),
            Route("/download/{form}", partial(_download, pools["quick"]), methods=["POST"]),
            Route("/trace", partial(_trace, pools["slow"]), methods=["POST"]),
            WebSocketRoute("/session", partial(_session, pools, begin)),
        ],
        lifespan=lifespan,
    )
    return _Guard(app, port)


def _warm(begin: documents.Document) -> None:
    """Load the kernels before the first move of a slider."""
    for method in ("contacts", "master equation"):
        document = json.loads(json.dumps(begin))
        document["simulation"] = {**document.get("simulation", {}), "method": method, "contacts": 100}
        with suppress(Exception):  # the first question will tell
            for _ in answers.run({"document": document}, lambda _share: None):
                pass


# ---------------------------------------------------------------------------------------------------------------------
# What is refused
# ---------------------------------------------------------------------------------------------------------------------


class _Guard:
    """Refuses requests under a foreign name (DNS rebinding) or from a page of another site; adds headers of safety."""

    def __init__(self, app: ASGIApp, port: int) -> None:
        self._app = app
        self._hosts = {f"{name}:{port}" for name in (HOST, "localhost", "[::1]")}
        if port == 80:
            self._hosts |= {HOST, "localhost", "[::1]"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what comes from our own pages."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        origin = headers.get("origin")
        # A browser names the origin of every websocket, and of everything that is not a plain read.
        ours = origin.removeprefix("http://") in self._hosts if origin else scope["type"] == "http"
        if headers.get("host") not in self._hosts or len(headers.getlist("host")) != 1 or not ours:
            if scope["type"] == "websocket":
                await send({"type": "websocket.close", "code": 1008})  # before the handshake: status 403
            else:
                await PlainTextResponse("This server answers its own pages only.\n", 403)(scope, receive, send)
            return

        async def safely(message: Message) -> None:
            if message["type"] == "http.response.start":
                found = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    found[name] = value
            await send(message)

        await self._app(scope, receive, safely)


# ---------------------------------------------------------------------------------------------------------------------
# Pages and files
# ---------------------------------------------------------------------------------------------------------------------


async def _page(_request: Request) -> Response:
    return FileResponse(_STATIC / "index.html")


async def _plotly(_request: Request) -> Response:
    spec = find_spec("plotly")
    assert spec is not None
    assert spec.origin is not None
    return FileResponse(Path(spec.origin).parent / "package_data" / "plotly.min.js", media_type="text/javascript")


async def _download(pool: Executor, request: Request) -> Response:
    form = request.path_params["form"]
    if form not in answers.FORMATS:
        return _refused(404, InputError(f"{form}: there are {', '.join(answers.FORMATS)}"))
    document: object = None
    try:
        document = documents.from_json(await _body(request, documents.LARGEST_REQUEST))
        work = partial(answers.download, document, form, _patience())
        content = await asyncio.get_running_loop().run_in_executor(pool, work)
    except _REFUSALS as error:
        return _refused(400, error)
    except ClientDisconnect:
        return Response(status_code=400)
    return Response(content, media_type=answers.FORMATS[form])


async def _trace(pool: Executor, request: Request) -> Response:
    try:
        content = await _body(request, answers.LARGEST_TRACE)
        name = Path(request.query_params.get("name", "trace")).name[:100] or "trace"
        asked = request.query_params.get("width", "")
        width = min(max(int(asked), 100), 4_000) if asked.isdecimal() and len(asked) < 6 else 1_000
        work = partial(answers.trace, content, name, dict(request.query_params), width)
        found = await asyncio.get_running_loop().run_in_executor(pool, work)
    except _REFUSALS as error:
        return _refused(200, error)  # what is wrong with a file is the answer; 400 would be a fault of the page
    except ClientDisconnect:
        return Response(status_code=400)
    return JSONResponse(found)


async def _body(request: Request, most: int) -> bytes:
    """Read the body of a request, and no more of it than allowed."""
    announced = request.headers.get("content-length", "")
    if re.fullmatch("[0-9]{1,18}", announced) and int(announced) > most:
        raise InputError(answers.too_large(int(announced)))
    content = bytearray()
    async for chunk in request.stream():
        content += chunk
        if len(content) > most:
            raise InputError(answers.too_large(len(content)))
    return bytes(content)


_REFUSALS = (InputError, UndecidedError, MemoryError, ArithmeticError, np.linalg.LinAlgError)
"""What a question may end in without a fault of ours: the numbers of a document can be as far apart as they like."""


def _refused(status: int, error: Exception) -> Response:
    return JSONResponse({"errors": _complaints(error)}, status_code=status)


def _complaints(error: Exception) -> list[dict[str, str]]:
    if isinstance(error, MemoryError):
        return [{"key": "", "message": "not enough memory for this case; take fewer contacts"}]
    if not isinstance(error, (InputError, UndecidedError)):
        return [{"key": "", "message": f"cannot be computed, its numbers are too far apart ({type(error).__name__})"}]
    return documents.complaints(error)


def _patience() -> answers.Watch:
    """Watch that gives a run up in the end."""
    begun = time.monotonic()

    def watch(_share: float) -> None:
        if time.monotonic() - begun > LONGEST:
            raise InputError(f"given up after {LONGEST:g} s; take a shorter run, or fewer contacts")

    return watch


# ---------------------------------------------------------------------------------------------------------------------
# Sessions
# ---------------------------------------------------------------------------------------------------------------------


class _DroppedError(Exception):
    """Nobody waits for this work any more."""


class _Lane:
    """Questions of one kind from one window: the newest wins."""

    def __init__(self, kind: str, pool: Executor, send: Callable[[str], None]) -> None:
        self._kind, self._pool, self._send = kind, pool, send
        self._newest = threading.Event()  # set: dropped
        self._free = asyncio.Lock()

    def drop(self) -> None:
        """Give up the work under way."""
        self._newest.set()

    async def ask(self, request: answers.Plain) -> None:
        """Answer a question unless a newer one comes in."""
        self.drop()
        self._newest = dropped = threading.Event()
        async with self._free:
            if not dropped.is_set():
                await asyncio.get_running_loop().run_in_executor(self._pool, self._answer, request, dropped)

    def _answer(self, request: answers.Plain, dropped: threading.Event) -> None:
        """Work in a thread, sending what comes out of it."""
        told = time.monotonic()
        patience = _patience()

        def watch(share: float) -> None:
            nonlocal told
            now = time.monotonic()
            if dropped.is_set():
                raise _DroppedError
            if self._kind not in _SLOW:
                patience(share)
            if now - told > 0.2:
                told = now
                reply({"progress": share})

        def reply(content: answers.Plain) -> None:
            self._send(json.dumps({"kind": self._kind, "id": request.get("id"), **content}, allow_nan=False))

        try:
            for content in _ANSWERS[self._kind](request, watch):
                if dropped.is_set():
                    return
                reply(content)
            reply({"done": True})
        except _DroppedError:
            return
        except _REFUSALS as error:
            reply({"errors": _complaints(error)})
        except Exception as error:  # the page is to stay alive whatever happens
            reply({"errors": [{"key": "", "message": f"this failed: {type(error).__name__}: {error}"}]})
            raise


async def _session(pools: Mapping[str, Executor], begin: documents.Document, websocket: WebSocket) -> None:
    """Serve one window from its first to its last question."""
    await websocket.accept()
    loop = asyncio.get_running_loop()
    outgoing: asyncio.Queue[str] = asyncio.Queue()

    def send(text: str) -> None:  # from any thread
        with suppress(RuntimeError):  # the loop is gone
            loop.call_soon_threadsafe(outgoing.put_nowait, text)

    async def deliver() -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await websocket.send_text(await outgoing.get())

    lanes = {kind: _Lane(kind, pools["slow" if kind in _SLOW else "quick"], send) for kind in _ANSWERS}
    tasks: set[asyncio.Task[None]] = {asyncio.create_task(deliver())}
    send(json.dumps({"kind": "hello", "document": begin, "presets": documents.presets()}))
    try:
        while (message := await websocket.receive())["type"] == "websocket.receive":
            try:
                request = _question(message.get("text"), lanes)
            except InputError as error:
                send(json.dumps({"kind": "error", "id": None, "errors": [{"key": "", "message": str(error)}]}))
                continue
            lane = lanes[request["kind"]]
            if request.get("drop"):
                lane.drop()
                continue
            task = asyncio.create_task(lane.ask(request))
            tasks.add(task)
            task.add_done_callback(partial(_forget, tasks))
    finally:
        for lane in lanes.values():
            lane.drop()
        for task in tuple(tasks):
            task.cancel()


def _question(text: str | None, kinds: Collection[str]) -> answers.Plain:
    """Read a question: a table with its kind and its number."""
    if text is None:
        raise InputError("this message is binary; questions are JSON text")
    request = documents.from_json(text)
    kind, number = (request.get("kind"), request.get("id")) if isinstance(request, dict) else (None, None)
    if not isinstance(request, dict) or not isinstance(kind, str) or kind not in kinds:
        raise InputError(f"kind = {shown(kind)}: this question is not known; there are {', '.join(kinds)}")
    if number is not None and (not isinstance(number, int) or isinstance(number, bool)):
        raise InputError(f"id = {shown(number)}: must be a whole number")
    return request


def _forget(tasks: set[asyncio.Task[None]], task: asyncio.Task[None]) -> None:
    """Let go of a task that is done; an error in it was told to the page and is worth a line on the terminal."""
    tasks.discard(task)
    if not task.cancelled() and (error := task.exception()) is not None:
        asyncio.get_running_loop().call_exception_handler({"message": "an answer failed", "exception": error})
