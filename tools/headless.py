"""A server of the explorer and a headless browser: for its tests, its benchmark and
the pictures in the docs.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import chromium

from stickslip import explorer

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_PLAYWRIGHT = find_spec("playwright") is not None
CHROMIUM = chromium.find() if _PLAYWRIGHT else None
WHY_NOT = (
    (
        "no chromium on this machine; on Debian: apt-get install chromium (or name one "
        "with CHROMIUM=/path)"
    )
    if _PLAYWRIGHT
    else "playwright is not installed"
)
FLAGS = (
    "--no-sandbox",  # chromium has no sandbox as root, as in CI
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)
PATIENCE = 120_000
"""Longest wait for a page, in milliseconds: on a slow, busy machine kernels compile in
that time.
"""
_START = "import sys; from stickslip.cli import main; sys.exit(main(sys.argv[1:]))"

# Sets an input as a person does, and waits until the trace is drawn; the time is that
# of the page's own clock, in ms.
MOVE = """
([selector, value]) => new Promise((resolve, reject) => {
  const input = document.querySelector(selector);
  const begun = performance.now();
  let asked = Infinity;
  const drawn = (event) => {
    if (event.detail.id < asked) return;
    document.removeEventListener("drawn", drawn);
    requestAnimationFrame(() => setTimeout(() => resolve({
      took: performance.now() - begun, kind: document.querySelector("#regime").textContent }), 0));
  };
  document.addEventListener("drawn", drawn);
  document.addEventListener("complained", () => reject(new Error("the page refuses the value")), { once: true });
  input.value = value;
  input.dispatchEvent(new Event("input", { bubbles: true }));
  input.dispatchEvent(new Event("change", { bubbles: true }));
  asked = Number(document.body.dataset.asked);
})
"""  # noqa: E501


@dataclass(frozen=True)
class Server:
    """A running explorer."""

    url: str
    process: subprocess.Popen[str]
    lines: list[str]

    @property
    def host(self) -> str:
        return self.url.split("/")[2]

    @property
    def port(self) -> int:
        return int(self.host.rpartition(":")[2])

    @property
    def path(self) -> str:
        return "/" + self.url.split("/", 3)[3]

    def processes(self) -> list[int]:
        """Return the server and its worker processes."""
        parents = {}
        for status in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                parents[int(status.parent.name)] = int(
                    status.read_text().rpartition(")")[2].split()[1]
                )
        found = [self.process.pid]
        for pid in found:
            found += [child for child, parent in parents.items() if parent == pid]
        return found

    def memory(self) -> float:
        """Return their memory in MB, with shared memory counted once."""
        total = 0.0
        for pid in self.processes():
            with suppress(OSError):
                rollup = Path(f"/proc/{pid}/smaps_rollup").read_text()
                total += next(
                    float(line.split()[1])
                    for line in rollup.splitlines()
                    if line.startswith("Pss:")
                )
        return total / 1024


@contextmanager
def server(*arguments: str) -> Iterator[Server]:
    """Start the explorer as a user does, on a free port."""
    command = [
        sys.executable,
        "-c",
        _START,
        "explore",
        "--no-browser",
        "--port",
        "0",
        *arguments,
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        lines: list[str] = []
        try:
            while "http://" not in (line := process.stdout.readline()):
                lines.append(line)
                if process.poll() is not None:
                    raise RuntimeError("the server did not start: " + "".join(lines))
            lines.clear()
            reader = threading.Thread(
                target=lambda: lines.extend(process.stdout or ()), daemon=True
            )
            reader.start()
            yield Server(
                next(word for word in line.split() if word.startswith("http://")),
                process,
                lines,
            )
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
    # A server prints its address and the shared link; any further output is an error.
    reader.join(5)
    printed = "".join(lines).removeprefix(f"{explorer.EXPOSED}\n")
    assert not printed, "the server printed: " + printed
    assert process.returncode == 0


class Session:
    """A session of the explorer without a browser."""

    def __init__(self, websocket: Any) -> None:
        self.websocket = websocket
        self.count = 0
        assert json.loads(websocket.recv(timeout=60))["kind"] == "hello"

    def send(self, message: str | bytes) -> dict[str, Any]:
        """Send any message; return the last answer to it."""
        self.websocket.send(message)
        while True:
            answer: dict[str, Any] = json.loads(self.websocket.recv(timeout=60))
            if answer.get("done") or "errors" in answer:
                return answer

    def ask(self, kind: str, document: dict[str, Any], **more: Any) -> dict[str, Any]:
        """Ask a question about a rig; return the last answer to it."""
        self.count += 1
        return self.send(
            json.dumps({"kind": kind, "id": self.count, "document": document, **more})
        )


@contextmanager
def session(server: Server) -> Iterator[Session]:
    """Open a session as a window does."""
    from websockets.sync.client import connect

    host = f"{server.host}{server.path}"
    options: dict[str, Any] = {
        "origin": f"http://{server.host}",
        "max_size": None,
        "open_timeout": 30,
    }
    # A test that does not read does not answer pings either.
    with connect(f"ws://{host}session", ping_interval=None, **options) as websocket:
        yield Session(websocket)


@contextmanager
def browser() -> Iterator[Browser]:
    """Start a headless browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield started
        started.close()


@contextmanager
def window(
    browser: Browser, server: Server, fragment: str = "", **options: Any
) -> Iterator[Page]:
    """Open the app in a window of its own; it must contact no other host and log no
    error.
    """
    context = browser.new_context(
        **{
            "viewport": {"width": 1280, "height": 800},
            "color_scheme": "light",
            "reduced_motion": "reduce",
        }
        | options
    )
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    faults: list[str] = []
    page.on(
        "console",
        lambda message: (
            faults.append(message.text)
            if message.type in ("error", "warning")
            else None
        ),
    )
    page.on("pageerror", lambda error: faults.append(str(error)))

    def check(url: str) -> None:
        if not url.startswith(
            (
                server.url,
                server.url.replace("http", "ws", 1),
                "data:",
                f"blob:{server.url}",
            )
        ):
            faults.append(f"asked for {url}")

    page.on("request", lambda request: check(request.url))
    page.on("websocket", lambda socket: check(socket.url))
    page.goto(server.url + fragment)
    page.wait_for_selector("#field-slider-stiffness", state="attached")
    if page.is_visible("#waiting"):  # a rig from a link is computed after a click
        page.click("#go")
    page.wait_for_selector("#friction:has-text('F')", state="attached")
    yield page
    context.close()
    assert not faults, faults
