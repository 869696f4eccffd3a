"""docs/reference/mavlink-items.md: its code runs, and its table of degrees is what the rules say."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from stopgo.mission.files import mission_json
from stopgo.mission.frames.geodesy import from_geodetic, to_geodetic
from stopgo.mission.frames.transform import SiteOrigin
from tests.mission.worlds import square_tour

GUIDE = (Path(__file__).parents[3] / "docs" / "reference" / "mavlink-items.md").read_text(encoding="utf-8")


def test_its_example_prints_the_items_and_the_notes(tmp_path, monkeypatch, capsys):
    mission_json.write(square_tour(), tmp_path / "mission.json")
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", GUIDE, flags=re.DOTALL)
    exec(compile(example, "docs/reference/mavlink-items.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["speed None DO_CHANGE_SPEED (178)", "stop S1 NAV_WAYPOINT (16)"]
    assert len(lines) == 10 + 3


@pytest.mark.parametrize("latitude", [0, 30, 47, 60])
def test_its_millimetres_per_metre_are_what_the_rules_say(latitude):
    (row,) = re.findall(rf"^\| {latitude}° \|(.*)\|$", GUIDE, flags=re.MULTILINE)
    told = [float(cell.removesuffix(" mm")) for cell in (part.strip() for part in row.split("|"))]
    origin = SiteOrigin(lat=latitude, lon=8.0, alt=0.0, heading_deg=0.0)
    found = [
        math.dist(from_geodetic(origin, to_geodetic(origin, point), rule), point) / 100 * 1000
        for rule in ("ardupilot", "px4")
        for point in ((0.0, 100.0), (100.0, 0.0))
    ]
    assert found == pytest.approx(told, abs=0.06)
