"""Draws the picture of exports.md: the layers over the sample office, as a CAD program shows them.

python -m docs.draw_exports [docs/images]
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import ezdxf
from ezdxf.addons.drawing import Frontend, RenderContext, layout, svg
from ezdxf.addons.drawing.config import BackgroundPolicy, Configuration
from ezdxf.document import Drawing

from stopgo.mission.document import Mission
from stopgo.mission.files.coverage_json import coverage_json
from stopgo.mission.files.exports import exported
from stopgo.mission.files.exports.format import FloorDrawing, Supplements
from stopgo.mission.files.exports.stretches import read_stretches
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Route
from stopgo.planner import plan
from stopgo.planner.floors import read_floor
from stopgo.planner.floors.dxf import metres_in

OFFICE = Path("recordings/samples/office.dxf")
THINNER = 0.2
"""Line weights are millimetres on a plot; the picture is far smaller than one."""


def draw(folder: Path) -> None:
    """Plan the office, export it over its drawing, and draw what is then in the file."""
    made = plan(read_floor(OFFICE), Settings())
    drawing = _layers(made.mission, made.route, folder)
    (folder / "exports-dxf.svg").write_text(_picture(drawing), encoding="utf-8")


def _layers(mission: Mission, route: Route, folder: Path) -> Drawing:
    coverage = folder / "coverage.json"
    coverage.write_bytes(coverage_json(route, mission))
    stretches = read_stretches(coverage, mission)
    coverage.unlink()
    unit = metres_in(ezdxf.readfile(OFFICE), source=OFFICE)
    floor = FloorDrawing(lambda: ezdxf.readfile(OFFICE), unit)
    data = exported(mission, "dxf", Supplements(floor=floor, coverage=stretches))
    return ezdxf.read(io.StringIO(data.decode(), newline=None))


def _picture(drawing: Drawing) -> str:
    backend = svg.SVGBackend()
    look = Configuration(lineweight_scaling=THINNER, background_policy=BackgroundPolicy.WHITE)
    Frontend(RenderContext(drawing), backend, config=look).draw_layout(drawing.modelspace())
    page = layout.Page(0, 0, layout.Units.mm, margins=layout.Margins.all(4), max_width=420, max_height=297)
    return backend.get_string(page, settings=layout.Settings(fit_page=True))


if __name__ == "__main__":
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))
