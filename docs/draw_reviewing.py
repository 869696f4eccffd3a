"""Draws the pictures of review.md from the sample office, with a viewer without a window.

    python -m docs.draw_reviewing [docs/images]

Needs something to draw with, such as Debian's mesa-vulkan-drivers; look at them before they are committed.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image

from stopgo.recordings.viewing.headless import REDRAW_S, container, must_be_drawable, outermost, viewer

OFFICE = "recordings/samples/office.dxf"
SETTLED_S = 10.0
"""What the viewer tells of itself in its window is gone by then."""
COLOURS = 64
WIDTH = 1000
PICTURES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "review-candidates": ("Planning", "stage_step", {"sequence": 2}),
    "review-choice": ("Planning", "stage_step", {"sequence": 7}),
    "review-why": ("Stops", "stop", {"sequence": 5}),
}
"""The tab that each shows, and at which time of which timeline."""


def draw(into: Path) -> None:
    """Plan the office, and write a picture of each."""
    must_be_drawable()
    with TemporaryDirectory() as temporary:
        command = [sys.executable, "-m", "stopgo", "plan", OFFICE, "-o", temporary]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        shot = Path(temporary, "shot.png")
        with viewer([Path(temporary, "plan.rrd")], size="1400x800") as client:
            time.sleep(SETTLED_S)
            for name, (tab, timeline, moment) in PICTURES.items():
                _bring_to_front(client, tab)
                client.set_time(timeline, play_state="paused", **moment)
                time.sleep(4 * REDRAW_S)
                client.save_screenshot(str(shot))
                _write_small(shot, into / f"{name}.png")


def _bring_to_front(client: Any, tab: str) -> None:
    parts = client.get_blueprint().blueprint
    tabs = str(outermost(parts))
    for part in container(parts, tabs)["contents"]:
        if container(parts, f"/{part}").get("display_name") == tab:
            container(parts, tabs)["active_tab"] = part
    client.set_blueprint(parts, of="recording")


def _write_small(shot: Path, path: Path) -> None:
    with Image.open(shot) as image:
        small = image.convert("RGB").resize((WIDTH, round(image.height * WIDTH / image.width)))
        small.quantize(COLOURS).save(path, optimize=True)


if __name__ == "__main__":
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))
