"""Drawing of a floor and its mission as data for the page: paths in metres, y down, from the upper left.

The page makes SVG elements of it and writes every text by `textContent`. Kinds have the colours of plan.svg.
Targets are grouped by the stops that see them, so that the page colours them as scans arrive.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.floor import Finding, FloorPlan
from stopgo.mission.floor.polylines import FloorLines, lines_of
from stopgo.mission.geometry import FloatArray, Polygon, bounds, is_closed
from stopgo.mission.run.route_position import legs_of
from stopgo.mission.settings.element_kinds import kind_of
from stopgo.mission.stages.covered_intervals import lines_along
from stopgo.mission.stages.sight import Sight

MARGIN = 0.02
MOST_FINDINGS = 200


def shapes_of(floor: FloorPlan) -> FloorLines:
    """Return the lines of a floor that was read from a file."""
    return lines_of(floor, _name_point)


def _name_point(polygon: Polygon) -> tuple[float, float]:
    import shapely

    inside = shapely.Polygon(polygon.exterior, polygon.holes).representative_point()
    return inside.x, inside.y


@dataclass(frozen=True)
class PageFrame:
    """Transform from the drawing's metres to the page's, whose y axis points down."""

    left: float
    top: float
    width: float
    height: float

    @classmethod
    def around(cls, lines: Iterable[FloatArray]) -> PageFrame:
        left, low, right, high = bounds(list(lines))
        margin = MARGIN * max(right - left, high - low, 1.0)
        return cls(left - margin, high + margin, right - left + 2 * margin, high - low + 2 * margin)

    def as_json(self) -> dict[str, float]:
        return {name: round(getattr(self, name), 3) for name in ("left", "top", "width", "height")}

    def path(self, lines: Iterable[FloatArray]) -> str:
        """Return the `d` of a path, in centimetres' precision."""
        return "".join(self._line(np.asarray(line, dtype=np.float64)) for line in lines if len(line) > 1)

    def _line(self, line: FloatArray) -> str:
        closed = is_closed(line)
        points = np.round((line - (self.left, self.top)) * (1.0, -1.0), 2) + 0.0
        text = "L".join(f"{x:g} {y:g}" for x, y in (points[:-1] if closed else points).tolist())
        return f"M{text}{'Z' if closed else ''}"


def floor_drawing_json(shapes: FloorLines, findings: Sequence[Finding] = ()) -> dict[str, Any]:
    """Return a floor without a plan, with the findings of reading it."""
    frame = PageFrame.around(_all_lines(shapes))
    return {"frame": frame.as_json(), **_floor(shapes, frame), "findings": findings_json(findings)}


def findings_json(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Return findings, the gravest first, with their positions in the drawing's metres."""
    ranked = sorted(findings, key=lambda item: item.rank)[:MOST_FINDINGS]
    return [
        {"code": item.code, "text": item.message, "rank": item.rank.name, "at": item.at} for item in ranked
    ]


def mission_drawing_json(
    mission: Mission, shapes: FloorLines | None = None, sight: Sight | None = None
) -> dict[str, Any]:
    """Return a mission, on its floor and with its targets as far as they are known."""
    legs = [np.array(leg, dtype=np.float64).reshape(-1, 2) for leg in legs_of(mission)]
    spots = np.array([(mission.start.x, mission.start.y), *((one.x, one.y) for one in mission.stops)])
    frame = PageFrame.around([*([] if shapes is None else _all_lines(shapes)), *legs, spots])
    drawn: dict[str, Any] = {
        "mission_id": mission.id, "revision": mission.revision, "name": mission.name,
        "frame": frame.as_json(), "legs": frame.path(legs),
        "start": [mission.start.x, mission.start.y, mission.start.heading],
        "stops": [
            {"id": one.id, "x": one.x, "y": one.y, "heading": one.heading, "doorway": one.doorway}
            for one in mission.stops
        ],
        "layers": [], "names": [], "targets": [], "coverage": None, "has_floor": shapes is not None,
    }  # fmt: skip
    if shapes is not None:
        drawn |= _floor(shapes, frame)
    if sight is not None:
        whole = sight.planned.whole
        drawn["targets"] = _targets(sight, mission, frame)
        drawn["coverage"] = {"planned": whole.coverage, "required": whole.required}
    return drawn


def _all_lines(shapes: FloorLines) -> list[FloatArray]:
    return [*shapes.outline, *(line for lines in shapes.kinds.values() for line in lines)]


def _floor(shapes: FloorLines, frame: PageFrame) -> dict[str, Any]:
    layers = [{"kind": "floor", "d": frame.path(shapes.outline), "fill": "", "stroke": ""}]
    for kind, lines in shapes.kinds.items():
        look = kind_of(kind)
        areas = [line for line in lines if is_closed(line)]
        open_lines = [line for line in lines if not is_closed(line)]
        layers.append({"kind": kind, "d": frame.path(areas), "fill": look.fill, "stroke": look.colour})
        layers.append({"kind": kind, "d": frame.path(open_lines), "fill": "none", "stroke": look.colour})
    layers.append({"kind": "openings", "d": frame.path(shapes.openings), "fill": "none", "stroke": ""})
    return {
        "layers": [layer for layer in layers if layer["d"]],
        "names": [[name, round(x, 2), round(y, 2)] for name, x, y in shapes.names],
        "has_floor": True,
    }


def _targets(sight: Sight, mission: Mission, frame: PageFrame) -> list[dict[str, Any]]:
    """Return the targets in groups that the same stops see, each with the number of views it needs."""
    ids = [stop.id for stop in mission.stops if sight.knows(stop)]
    total = sight.targets.total
    asked = np.broadcast_to(sight.totals.asked, (total,))
    seen = np.array([sight.views_from([one]) > 0 for one in ids], dtype=bool).reshape(len(ids), total)
    table = np.packbits(np.concatenate([seen, sight.totals.visible[None, :]]), axis=0).T
    keyed = np.concatenate([table, asked[:, None].astype(np.uint8)], axis=1)
    _, first, group = np.unique(keyed, axis=0, return_index=True, return_inverse=True)
    made = []
    for number, unit in enumerate(first.tolist()):
        stops = [one for one, sees in zip(ids, seen[:, unit].tolist(), strict=True) if sees]
        lines = lines_along(sight.targets, group.reshape(-1) == number)
        made.append({
            "d": frame.path(lines), "stops": stops,
            "need": int(asked[unit]), "visible": bool(sight.totals.visible[unit]),
        })  # fmt: skip
    return made
