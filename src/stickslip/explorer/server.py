"""The server: the pages, and one websocket for each window, which carries all its
questions.

The server computes nothing itself: questions go to `workers`. Nothing is kept between
questions: the page sends the whole rig, or the whole trace, each time, so windows
cannot disturb or see each other. Each websocket has a lane for each kind of question;
in a lane the newest question wins, and older ones are dropped.
"""

import asyncio
import hmac
import json
import os
import secrets
import socket
import threading
from collections import Counter
from collections.abc import Callable, Collection
from contextlib import asynccontextmanager, suppress
from functools import partial
from multiprocessing import forkserver
from pathlib import Path
from typing import Any, NamedTuple

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketClose, WebSocketDisconnect

from stickslip import io
from stickslip.errors import InputError, refused
from stickslip.explorer import PORT, documents, workers
from stickslip.explorer.plain import Plain
from stickslip.explorer.workers import ANSWERS, SLOW, Crew, Job

HOST = "127.0.0.1"

_HEADERS = {
    # plotly.js writes styles into the elements that it makes
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
}


class Limits(NamedTuple):
    """Limits on the questions of one visitor."""

    run: float  # longest run, in estimated seconds; longer ones are cut short
    quick: float  # time limit of a quick question, in seconds
    # the same for slow questions (a map, mitigations, a fit with intervals); the table
    # of a fit is kept
    slow: float
    trace: int  # most bytes of a measured trace
    table: bool  # whether a fit may make the table of simulations that it needs
    together: int  # slow questions of one window at a time
    windows: int  # windows from one address


ALONE = Limits(
    run=documents.LONGEST,
    quick=60,
    slow=3600,
    trace=50_000_000,
    table=True,
    together=3,
    windows=100,
)
SHARED = Limits(
    run=1.0, quick=20, slow=60, trace=5_000_000, table=False, together=1, windows=60
)
_MOST_WINDOWS = 120


def run(
    rig: Path | None, port: int | None, ready: Callable[[str], None] | None, share: bool
) -> None:
    """Serve until interrupted; see `stickslip.explorer.serve`."""
    begin = (
        documents.first_document() if rig is None else documents.of(io.read_rig(rig))
    )
    host = _own_address() if share else HOST
    token = secrets.token_urlsafe(24) if share else ""
    with _listen(host, port) as listening:
        number = listening.getsockname()[1]
        config = uvicorn.Config(
            application(begin, number, host=host, token=token),
            ws="websockets-sansio",
            # larger messages are closed without words, so leave room to refuse in words
            ws_max_size=(SHARED if share else ALONE).trace
            + 2 * documents.LARGEST_REQUEST,
            ws_ping_timeout=120.0,  # a large trace in transit may delay the pong
            log_level="warning",
            access_log=False,
            headers=[*_HEADERS.items()],
            server_header=False,
            timeout_graceful_shutdown=2,
        )
        if ready is not None:
            ready(f"http://{host}:{number}/{token + '/' if token else ''}")
        with suppress(KeyboardInterrupt):  # the usual way to stop it
            uvicorn.Server(config).run(sockets=[listening])


def _own_address() -> str:
    """Return the address of this machine on its local network; nothing is sent to find
    it.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
            address = str(probe.getsockname()[0])
        except OSError:
            address = HOST
    if address.startswith("127."):
        raise InputError(
            "--share: this machine is on no network; without --share the app is served "
            "to itself alone"
        )
    return address


def _listen(host: str, port: int | None) -> socket.socket:
    """Bind to a single address: the loopback interface, or the one on the local
    network.
    """
    for candidate in (PORT, 0) if port is None else (port,):
        try:
            return socket.create_server((host, candidate))
        except OSError as error:
            reason = os.strerror(error.errno or 0).lower()
    raise InputError(
        f"--port {port}: cannot be used ({reason}); choose another, or 0 for any free "
        "one"
    )


class _Shared:
    """State shared by all windows: the workers, the limits, and the number of windows
    from each address.
    """

    def __init__(self, begin: documents.Document, limits: Limits) -> None:
        self.limits = limits
        cores = os.cpu_count() or 1
        self.quick = Crew("quick", max(2, cores))
        # More workers than cores: the system divides the time between them, so that a
        # long search does not delay another window's map.
        self.slow = Crew("slow", max(4, 2 * cores), niceness=10)
        # A bar is shown on the page Fronts; the other pages have a rig with one slider.
        mine = (
            {"document": documents.first_document(), "chain": begin}
            if "chain" in begin
            else {"document": begin}
        )
        self.hello = json.dumps(
            {
                "kind": "hello",
                **mine,
                "largest": limits.trace,
                **documents.page_content(),
            }
        )
        self.windows: Counter[str] = Counter()  # by address


def application(
    begin: documents.Document, port: int, *, host: str = HOST, token: str = ""
) -> ASGIApp:
    """Return the app that begins with a document and is served at an address, behind a
    token if there is one.
    """
    shared = _Shared(begin, SHARED if token else ALONE)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> Any:
        threading.Thread(target=forkserver.ensure_running, daemon=True).start()
        yield
        shared.quick.close()
        shared.slow.close()

    routes = [
        WebSocketRoute("/session", partial(_session, shared)),
        Mount("/plotly", StaticFiles(packages=[("plotly", "package_data")])),
        Mount("/", StaticFiles(directory=Path(__file__).parent / "static", html=True)),
    ]
    root = f"/{token}/" if token else "/"
    return _Guard(
        Starlette(routes=[Mount(root, routes=routes)], lifespan=lifespan),
        host,
        port,
        root,
    )


class _Guard:
    """Refuses requests without the token, with a foreign host name (DNS rebinding) or
    from a page of another site.
    """

    def __init__(self, app: ASGIApp, host: str, port: int, root: str) -> None:
        self._app = app
        self._root = root.encode()
        names = (HOST, "localhost", "[::1]") if host == HOST else (host,)
        self._hosts = {f"{name}:{port}" for name in names} | (
            set(names) if port == 80 else set()
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on the requests of our own pages, and refuse others."""
        refusal: ASGIApp = PlainTextResponse(
            "This server answers its own pages only.\n", 403
        )
        if scope["type"] == "websocket":
            refusal = WebSocketClose(1008)  # before the handshake: status 403
        await (
            self._app
            if scope["type"] == "lifespan" or self._is_ours(scope)
            else refusal
        )(scope, receive, send)

    def _is_ours(self, scope: Scope) -> bool:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        origins = headers.getlist("origin")
        # A browser sends the origin of every websocket.
        ours = [origin.removeprefix("http://") for origin in origins] or hosts * (
            scope["type"] == "http"
        )
        root = scope["path"].encode()[: len(self._root)]
        named = len(hosts) == len(ours) == 1 and {*hosts, *ours} <= self._hosts
        return named and hmac.compare_digest(root, self._root)


class _Lane:
    """Questions of one kind from one window, of which the newest wins."""

    def __init__(
        self,
        kind: str,
        shared: _Shared,
        turns: asyncio.Semaphore,
        send: Callable[[str], None],
    ) -> None:
        self._kind = kind
        self._limits = shared.limits
        self._turns = turns
        self._send = send
        self._slow = kind in SLOW
        self._crew = shared.slow if self._slow else shared.quick
        self._newest = threading.Event()  # set when the question is dropped
        self._free = asyncio.Lock()

    def drop(self) -> None:
        """Abandon the work in progress."""
        self._newest.set()

    async def ask(self, request: Plain) -> None:
        """Answer a question, unless a newer one arrives."""
        self.drop()
        self._newest = dropped = threading.Event()
        limits = self._limits
        mine = {"kind": self._kind, "id": request.get("id")}

        def reply(content: Plain) -> None:
            self._send(json.dumps(mine | content, allow_nan=False))

        async with self._free, self._turns:
            asked = {**request, "seconds": limits.run, "table": limits.table}
            await self._crew.work(
                Job(self._kind, asked, limits.slow if self._slow else limits.quick),
                reply,
                dropped,
            )


async def _session(shared: _Shared, websocket: WebSocket) -> None:
    """Serve one window from its first to its last question, if there is room for it."""
    host = websocket.client.host if websocket.client else ""
    windows = shared.windows
    if windows[host] >= shared.limits.windows or windows.total() >= _MOST_WINDOWS:
        await websocket.close(1013)  # try again later
        return
    windows[host] += 1
    try:
        await websocket.accept()
        await _serve(shared, websocket)
    finally:
        windows[host] -= 1


async def _serve(shared: _Shared, websocket: WebSocket) -> None:
    loop = asyncio.get_running_loop()
    outgoing: asyncio.Queue[str] = asyncio.Queue()

    def send(text: str) -> None:  # from any thread
        with suppress(RuntimeError):  # the loop is gone
            loop.call_soon_threadsafe(outgoing.put_nowait, text)

    async def deliver() -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:  # endless: until the window closes
                await websocket.send_text(await outgoing.get())

    turns = {
        True: asyncio.Semaphore(shared.limits.together),
        False: asyncio.Semaphore(len(ANSWERS)),
    }
    lanes = {kind: _Lane(kind, shared, turns[kind in SLOW], send) for kind in ANSWERS}
    tasks: set[asyncio.Task[None]] = {asyncio.create_task(deliver())}
    send(shared.hello)
    try:
        # endless: until the window closes
        while (message := await websocket.receive())["type"] == "websocket.receive":
            try:
                request = _question(message, lanes, shared.limits.trace)
            except InputError as error:
                send(
                    json.dumps(
                        {"kind": "error", "id": None, **workers.errors(str(error))}
                    )
                )
                continue
            lane = lanes[request["kind"]]
            if request.get("drop"):
                lane.drop()
                continue
            task = asyncio.create_task(lane.ask(request))
            tasks.add(task)
            # asyncio prints the error that ended the task on the terminal
            task.add_done_callback(tasks.discard)
    finally:
        for lane in lanes.values():
            lane.drop()
        for task in tuple(tasks):
            task.cancel()


def _question(message: Message, kinds: Collection[str], largest: int) -> Plain:
    """Read a question: a table with its kind and number; if a file is attached, the
    question is the first line.
    """
    text = message.get("text")
    content = b""
    if text is None:
        text, _, content = message["bytes"].partition(b"\n")
    if len(content) > largest:
        raise InputError(
            f"this file has {len(content) / 1e6:.3g} MB, more than {largest / 1e6:g}"
        )
    request = documents.from_json(text)
    asked: Plain = request if isinstance(request, dict) else {}
    kind = asked.get("kind")
    number = asked.get("id")
    if not isinstance(kind, str) or kind not in kinds:
        known = f"this question is not known; there are {', '.join(kinds)}"
        raise refused("kind", kind, known)
    if number is not None and type(number) is not int:
        raise refused("id", number, "must be a whole number")
    return {**asked, "content": content}
