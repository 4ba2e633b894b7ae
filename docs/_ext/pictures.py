"""Pictures that the pages show of what they print, made in `docs/made` each time the
pages are built.
"""

from __future__ import annotations

import contextlib
import re
import tempfile
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

PAGES = Path(__file__).parents[1]
MADE = PAGES / "made"


def make(folder: Path = MADE) -> None:
    """Draw them."""
    import stickslip as ss

    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
        Path("stage.toml").write_text(blocks("howto/predict.md", "toml")[0])
        for rig, name in (
            (ss.example("pmma_slider"), "start_predict"),
            (ss.read_rig("stage.toml"), "stage_predict"),
        ):
            ss.plot.save(ss.predict(rig).plot(), folder / f"{name}.png")
        known: dict[str, Any] = {}
        with contextlib.redirect_stdout(None):
            for block in blocks("theory/elastic.md", "python"):
                exec(block, known)
                if "front_curve.png" in block:
                    break
        Path("front_curve.png").replace(folder / "front_curve.png")


def blocks(page: str, language: str) -> list[str]:
    """Code of a page."""
    text = (PAGES / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def setup(app: Sphinx) -> dict[str, Any]:
    # before `house` takes the kernels apart
    app.connect("builder-inited", lambda _app: make(), priority=100)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
