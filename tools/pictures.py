"""Draw the pictures that are kept in git, except those of the browser: `python
tools/pictures.py docs/images`.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from stickslip.cli import main
from stickslip.io.rig_files import example_file


def draw(folder: Path) -> None:
    """Run the commands given in the pages."""
    with tempfile.TemporaryDirectory() as place:
        rig, slow, fast, store = (
            Path(place) / name
            for name in ("rig.toml", "slow.nc", "fast.nc", "phase.sqlite")
        )
        text = example_file("precision_stage").read_text()
        for speed, file in (("1 mm/s", fast), ("0.5 mm/s", slow)):
            rig.write_text(text.replace('velocity = "1 mm/s"', f'velocity = "{speed}"'))
            run("simulate", rig, "-o", file)
        run("plot", slow, folder / "smooth_and_stick_slip.png", "--beside", fast)
        run("map", "precision_stage", "-o", folder / "stage_map.png")
        run("sweep", example_file("phase_diagram"), "--store", store)
        run("plot", store, folder / "phase_diagram.png", "--bistable")


def run(*arguments: str | Path) -> None:
    """Run a command; exit if it fails."""
    if code := main(list(map(str, arguments))):
        sys.exit(code)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
