"""The server: pages, one websocket for each window, and what is refused.

It computes nothing itself: questions go to `workers`. Nothing is kept between requests: the page sends the whole rig
each time, so windows cannot disturb or see each other. On each websocket there is a lane for each kind of question; in
a lane the newest question wins, and older ones are dropped.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import os
import re
import secrets
import socket
import threading
from collections import Counter
from collections.abc import AsyncGenerator, Awaitable, Callable, Collection, Iterator
from contextlib import aclosing, asynccontextmanager, contextmanager, suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from stickslip.errors import InputError, shown
from stickslip.explorer import PORT, answers, documents, simulate, traces, workers
from stickslip.explorer.plain import Plain
from stickslip.explorer.workers import Crew, Job
from stickslip.io import rig_files as rigs

HOST = "127.0.0.1"

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


class Limits(NamedTuple):
    """What one visitor may ask for: seconds, bytes, and how many at the same time."""

    run: float  # seconds of a run, by estimate; longer ones are cut short
    quick: float  # seconds after which a run, or a file on its way, is given up
    slow: float  # as much of a map, a bistable band, mitigations
    trace: int  # bytes of a measured trace
    fit: float  # seconds of a fit with intervals; a table of simulations that was begun is kept
    table: bool  # whether a fit may make that table
    together: int  # maps, bands and searches for mitigations of one window
    windows: int  # from one address
    files: int  # traces, fits and downloads from one address


ALONE = Limits(
    run=documents.LONGEST,
    quick=60.0,
    slow=600.0,
    trace=traces.LARGEST_TRACE,
    fit=3600.0,
    table=True,
    together=3,
    windows=100,
    files=4,
)
SHARED = Limits(run=1.0, quick=20.0, slow=60.0, trace=5_000_000, fit=60.0, table=False, together=1, windows=60, files=4)
_MOST_WINDOWS = 120


def run(rig: Path | None, port: int | None, ready: Callable[[str], None] | None, share: bool) -> None:
    """Serve until interrupted; see `stickslip.explorer.serve`."""
    begin = documents.first() if rig is None else documents.of(rigs.read_rig(rig))
    host = _own_address() if share else HOST
    token = secrets.token_urlsafe(24) if share else ""
    with _listen(host, port) as listening:
        number = listening.getsockname()[1]
        config = uvicorn.Config(
            application(begin, number, host=host, token=token),
            ws="websockets-sansio",
            ws_max_size=2 * documents.LARGEST_REQUEST
            if share
            else 16 * documents.LARGEST_REQUEST,  # else told in words
            log_level="warning",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=2,
        )
        if ready is not None:
            ready(f"http://{host}:{number}/{token + '/' if token else ''}")
        with suppress(KeyboardInterrupt):  # the usual way to stop it
            uvicorn.Server(config).run(sockets=[listening])


def _own_address() -> str:
    """The address of this machine on its local network; nothing is sent to find it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
            address = str(probe.getsockname()[0])
        except OSError:
            address = HOST
    if address.startswith("127."):
        raise InputError("--share: this machine is on no network; without --share the app is served to itself alone")
    return address


def _listen(host: str, port: int | None) -> socket.socket:
    """Bind to one address only: the loopback interface, or that on the local network."""
    for candidate in (PORT, 0) if port is None else (port,):
        try:
            return socket.create_server((host, candidate))
        except OSError as error:
            reason = os.strerror(error.errno or 0).lower()
    raise InputError(f"--port {port}: cannot be used ({reason}); choose another, or 0 for any free one")


class _House:
    """What all requests share: workers, limits, and a count of who is in."""

    def __init__(self, begin: documents.Document, limits: Limits) -> None:
        self.limits = limits
        cores = os.cpu_count() or 1
        self.quick = Crew("quick", max(2, cores))
        # More than there are cores: the system shares them out, so that a long search holds up nobody's map.
        self.slow = Crew("slow", max(4, 2 * cores), niceness=10)
        # A bar is shown on the page Fronts; the other pages have a rig with one slider.
        mine = {"document": documents.first(), "chain": begin} if "chain" in begin else {"document": begin}
        offered = {"presets": documents.presets(), "bars": documents.bars()}
        self.hello = json.dumps({"kind": "hello", **mine, **offered, **documents.words()})
        self.windows: Counter[str] = Counter()
        self.files: Counter[str] = Counter()

    @contextmanager
    def let_in(self, count: Counter[str], most: int, connection: HTTPConnection) -> Iterator[bool]:
        """Count a visitor by the address; whether there is room."""
        who = connection.client.host if connection.client else ""
        room = count[who] < most and count.total() < _MOST_WINDOWS
        count[who] += room
        try:
            yield room
        finally:
            count[who] -= room
            count += Counter()  # forget those that have left


def application(begin: documents.Document, port: int, *, host: str = HOST, token: str = "") -> ASGIApp:
    """Return the app that begins with a document, and is reached at an address, behind a token if there is one."""
    house = _House(begin, SHARED if token else ALONE)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> Any:
        threading.Thread(target=workers.start, daemon=True).start()
        warming = asyncio.create_task(house.quick.begin(Job("run", ({"document": documents.first()},), 60.0)))
        yield
        warming.cancel()
        house.quick.close()
        house.slow.close()

    app = Starlette(
        routes=[
            Route("/", _page),
            Route("/plotly.min.js", _plotly),
            Mount("/static", StaticFiles(directory=_STATIC)),
            *(Route(path, _Files(house, ask), methods=[method]) for path, method, ask in _FILES),
            WebSocketRoute("/session", partial(_session, house)),
        ],
        lifespan=lifespan,
    )
    return _Guard(app, host, port, token)


# ---------------------------------------------------------------------------------------------------------------------
# What is refused
# ---------------------------------------------------------------------------------------------------------------------


class _Guard:
    """Refuses requests without the token, under a foreign name (DNS rebinding) or from a page of another site.

    It adds headers of safety to all answers.
    """

    def __init__(self, app: ASGIApp, host: str, port: int, token: str) -> None:
        self._app, self._token = app, token
        names = (HOST, "localhost", "[::1]") if host == HOST else (host,)
        self._hosts = {f"{name}:{port}" for name in names}
        if port == 80:
            self._hosts |= set(names)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what comes from our own pages."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        origins = headers.getlist("origin")
        # A browser names the origin of every websocket, and of everything that is not a plain read.
        ours = origins[0].removeprefix("http://") in self._hosts if origins else scope["type"] == "http"
        path = self._without_token(scope["path"])
        single = len(headers.getlist("host")) == 1 and len(origins) < 2
        if headers.get("host") not in self._hosts or not single or not ours or path is None:
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

        await self._app({**scope, "path": path, "raw_path": path.encode()}, receive, safely)

    def _without_token(self, path: str) -> str | None:
        """The path behind the token; None if the token is not there."""
        if not self._token:
            return path
        given, slash, rest = path[1:].partition("/")
        matches = hmac.compare_digest(given.encode(), self._token.encode())
        return f"/{rest}" if matches and slash else None


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


async def _sample(house: _House, request: Request) -> Response:
    return await _file(house, request, Job("sample", (), house.limits.quick), "text/csv")


async def _download(house: _House, request: Request) -> Response:
    form, limits = request.path_params["form"], house.limits
    if form not in simulate.FORMATS:
        raise HTTPException(404, f"{form}: there are {', '.join(simulate.FORMATS)}")
    try:
        asked = documents.from_json(await _body(request, documents.LARGEST_REQUEST, limits.quick))
    except InputError as error:
        raise HTTPException(400, str(error)) from None
    asked = asked if isinstance(asked, dict) else {}
    what = (asked.get("document", asked), form, asked.get("duration"), limits.run)
    return await _file(house, request, Job("download", what, limits.quick), simulate.FORMATS[form])


async def _trace(house: _House, request: Request) -> Response:
    asked = request.query_params.get("width", "")
    width = min(max(int(asked), 100), 4_000) if re.fullmatch("[0-9]{1,5}", asked) else 1_000
    job = Job("trace", (*await _measured(house, request), width), house.limits.quick)
    return JSONResponse(await _first(_replies(house.quick, job, request)))


async def _fit(house: _House, request: Request) -> Response:
    """Answers line by line, each of them JSON: a fit can take minutes."""
    content, name, options = await _measured(house, request)
    limits, crew = house.limits, house.quick
    job = Job("fit", (content, name, options, limits.run), limits.quick)
    if options.pop("intervals", ""):
        job, crew = Job("posterior", (content, name, options, limits.table), limits.fit), house.slow
    lines = (json.dumps(reply, allow_nan=False) + "\n" async for reply in _replies(crew, job, request))
    return StreamingResponse(lines, media_type="application/x-ndjson")


async def _measured(house: _House, request: Request) -> tuple[bytes, str, dict[str, str]]:
    """A measured trace as it was sent, its name, and what else was asked."""
    content = await _body(request, house.limits.trace, house.limits.quick)
    name = Path(request.query_params.get("name", "trace")).name[:100] or "trace"
    return content, name, dict(request.query_params)


_FILES = (
    ("/sample.csv", "GET", _sample),
    ("/download/{form}", "POST", _download),
    ("/trace", "POST", _trace),
    ("/fit", "POST", _fit),
)


class _Files:
    """Answers requests for files, counted before any of one is read and until the last of the answer is sent."""

    def __init__(self, house: _House, answer: Callable[[_House, Request], Awaitable[Response]]) -> None:
        self._house, self._answer = house, answer

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, if there is room."""
        request = Request(scope, receive)
        with self._house.let_in(self._house.files, self._house.limits.files, request) as room:
            try:
                if not room:
                    raise HTTPException(429, "too many files at once from this address; try again in a moment")
                response = await self._answer(self._house, request)
            except InputError as error:  # what is wrong with a file is the answer; 400 would be a fault of the page
                response = JSONResponse(workers.errors(str(error)))
            except HTTPException as refused:
                response = JSONResponse(workers.errors(refused.detail), refused.status_code)
            except ClientDisconnect:
                return
            await response(scope, receive, send)


async def _file(house: _House, request: Request, job: Job, media: str) -> Response:
    """A file, or what is wrong."""
    reply = await _first(_replies(house.quick, job, request))
    return JSONResponse(reply, 400) if isinstance(reply, dict) else Response(reply, media_type=media)


async def _first(replies: AsyncGenerator[Any]) -> Any:
    """The answer, where there is but one."""
    async with aclosing(replies):
        async for reply in replies:
            if not isinstance(reply, dict) or not reply.keys() & {"progress", "done"}:
                return reply
    return _CLOSING


async def _replies(crew: Crew, job: Job, request: Request) -> AsyncGenerator[Any]:
    """What a worker answers, until it is done, nobody reads any more, or the explorer closes."""
    dropped, replies = threading.Event(), asyncio.Queue[Any]()
    loop = asyncio.get_running_loop()

    def hand_on(reply: Any) -> None:  # from another thread
        loop.call_soon_threadsafe(replies.put_nowait, reply)

    work = asyncio.create_task(crew.work(job, hand_on, dropped))
    try:
        while True:
            try:
                reply = await asyncio.wait_for(replies.get(), 0.5)
            except TimeoutError:
                if await request.is_disconnected():
                    return
                if not work.done() or replies.qsize():
                    continue
                reply = _CLOSING
            yield reply
            if isinstance(reply, dict) and (reply.get("done") or "errors" in reply):
                return
    finally:
        dropped.set()
        work.cancel()


async def _body(request: Request, most: int, seconds: float) -> bytes:
    """Read the body of a request, no more of it and no longer than allowed."""
    announced = request.headers.get("content-length", "")
    if re.fullmatch("[0-9]{1,18}", announced) and int(announced) > most:
        raise InputError(traces.too_large(int(announced), most))
    content = bytearray()
    try:
        async with asyncio.timeout(seconds):
            async for chunk in request.stream():
                content += chunk
                if len(content) > most:
                    raise InputError(traces.too_large(len(content), most))
    except TimeoutError:
        raise InputError(f"what was sent did not arrive within {seconds:g} s; send it again") from None
    return bytes(content)


_CLOSING = workers.errors("this was not finished: the explorer is closing")


# ---------------------------------------------------------------------------------------------------------------------
# Sessions
# ---------------------------------------------------------------------------------------------------------------------


class _Lane:
    """Questions of one kind from one window: the newest wins."""

    def __init__(self, kind: str, house: _House, turns: asyncio.Semaphore, send: Callable[[str], None]) -> None:
        self._kind, self._house, self._turns, self._send = kind, house, turns, send
        self._newest = threading.Event()  # set: dropped
        self._free = asyncio.Lock()

    def drop(self) -> None:
        """Give up the work under way."""
        self._newest.set()

    async def ask(self, request: Plain) -> None:
        """Answer a question unless a newer one comes in."""
        self.drop()
        self._newest = dropped = threading.Event()
        slow, limits = self._kind in answers.SLOW, self._house.limits
        crew, seconds = (self._house.slow, limits.slow) if slow else (self._house.quick, limits.quick)
        async with self._free, self._turns:
            step: int | None = 0
            while step is not None and not dropped.is_set():
                job = Job(self._kind, ({**request, "seconds": limits.run, "step": step},), seconds)
                goes_on = threading.Event()
                await crew.work(job, partial(self._reply, request.get("id"), goes_on), dropped)
                step = step + 1 if goes_on.is_set() else None

    def _reply(self, number: object, goes_on: threading.Event, content: Plain) -> None:
        """Send an answer on; one that goes on is not done with its step."""
        if content.get("going_on"):
            goes_on.set()
        if not (content.get("done") and goes_on.is_set()):
            self._send(json.dumps({"kind": self._kind, "id": number, **content}, allow_nan=False))


async def _session(house: _House, websocket: WebSocket) -> None:
    """Serve one window from its first to its last question."""
    with house.let_in(house.windows, house.limits.windows, websocket) as room:
        if room:
            await websocket.accept()
            await _serve(house, websocket)
        else:
            await websocket.close(1013)  # try again later


async def _serve(house: _House, websocket: WebSocket) -> None:
    loop = asyncio.get_running_loop()
    outgoing: asyncio.Queue[str] = asyncio.Queue()

    def send(text: str) -> None:  # from any thread
        with suppress(RuntimeError):  # the loop is gone
            loop.call_soon_threadsafe(outgoing.put_nowait, text)

    async def deliver() -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await websocket.send_text(await outgoing.get())

    turns = {True: asyncio.Semaphore(house.limits.together), False: asyncio.Semaphore(len(answers.QUICK))}
    kinds = (*answers.QUICK, *answers.SLOW)
    lanes = {kind: _Lane(kind, house, turns[kind in answers.SLOW], send) for kind in kinds}
    tasks: set[asyncio.Task[None]] = {asyncio.create_task(deliver())}
    send(house.hello)
    try:
        while (message := await websocket.receive())["type"] == "websocket.receive":
            try:
                request = _question(message.get("text"), lanes)
            except InputError as error:
                send(json.dumps({"kind": "error", "id": None, **workers.errors(str(error))}))
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


def _question(text: str | None, kinds: Collection[str]) -> Plain:
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
