"""Find or install a browser for the tests that need one: `python tools/chromium.py`,
called by `make browser`.

A chromium of the system is preferred, then the one that playwright downloads, then
Debian's package if this user may install it. Without any, the tests that need one are
skipped, and the last line of the run says so.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys


def find() -> str | None:
    """Return the path of a chromium: the one that ``CHROMIUM`` names, the system's,
    or playwright's own.
    """
    named = os.environ.get("CHROMIUM")
    if named:
        return named
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return path
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        return None
    with sync_playwright() as playwright:
        path = playwright.chromium.executable_path
    return path if path and os.path.exists(path) else None


def install() -> None:
    """Try playwright's download, then Debian's package; both may be unavailable."""
    commands = [[sys.executable, "-m", "playwright", "install", "chromium"]]
    if shutil.which("apt-get") and os.geteuid() == 0:
        commands += [
            ["apt-get", "update", "-qq"],
            [
                "apt-get",
                "install",
                "-y",
                "-qq",
                "--no-install-recommends",
                "chromium",
                "fonts-dejavu-core",
            ],
        ]
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    for command in commands:
        if find() is not None:
            return
        try:
            subprocess.run(
                command,
                env=environment,
                capture_output=True,
                stdin=subprocess.DEVNULL,
                timeout=600,
            )
        except (OSError, subprocess.TimeoutExpired):
            continue


if __name__ == "__main__":
    if find() is None:
        print(
            "No browser here yet: trying to install chromium for the tests of the "
            "explorer"
        )
        install()
