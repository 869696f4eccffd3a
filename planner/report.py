"""What `stopgo plan` tells of a plan: one object for machines, a few lines for a person."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mission.document import Mission
from mission.geometry import FloatArray
from mission.planning import IN_HOLE, OUTSIDE, SLIVER, TOO_SMALL, Route, Unreached
from mission.schedule import schedule
from planner.unreached import unreached


@dataclass(frozen=True, eq=False)
class PlanReport:
    """A finished plan with its files and the seconds each stage took."""

    route: Route
    mission: Mission
    files: dict[str, Path]
    times_s: dict[str, float]
    elsewhere: frozenset[int] = frozenset()
    """Rooms that plans of other parts enter."""

    @property
    def unreached(self) -> tuple[Unreached, ...]:
        return unreached(self.route.selection.visibility.candidates, self.elsewhere)

    def as_json(self) -> dict[str, Any]:
        """The object that `--json` prints."""
        selection = self.route.selection
        visibility = selection.visibility
        candidates = visibility.candidates
        space, targets = candidates.space, visibility.targets
        never = [OUTSIDE, IN_HOLE, TOO_SMALL, SLIVER]
        times = schedule(self.mission)
        return {
            "floor": self._floor(),
            "mission": {
                "id": self.mission.id,
                "revision": self.mission.revision,
                "digest": self.mission.digest,
            },
            "targets": {
                "total": targets.total,
                "raw": sum(targets.raw.get(kind, 0) for kind in targets.by_kind(space.floor.elements)),
                "by_kind": targets.by_kind(space.floor.elements),
                "raw_by_kind": targets.raw,
            },
            "candidates": {
                "generated": _places(candidates.xy[~np.isin(candidates.reason, never)]),
                "reachable": _places(candidates.xy[candidates.kept]),
                "strategy": candidates.strategy,
            },
            "visibility": {"visible": int(visibility.visible.sum()), "method": visibility.method},
            "selection": {
                "stops": len(selection.chosen),
                "coverage": selection.coverage,
                "bound": selection.bound,
                "method": selection.method,
            },
            "route": {
                "length_m": self.route.length,
                "bound_m": self.route.bound,
                "method": self.route.method,
                "tour": self.route.tour,
                "start": self.route.start_reason,
            },
            "schedule": {
                "drive_s": times.drive_s,
                "turn_s": times.turn_s,
                "settle_s": times.settle_s,
                "scan_s": times.scan_s,
                "total_s": times.total_s,
            },
            "unreached": [
                {"room": item.room, "why": item.why, "area_m2": item.area_m2} for item in self.unreached
            ],
            "times_s": {key: round(value, 4) for key, value in self.times_s.items()},
            "files": {key: str(path) for key, path in self.files.items()},
        }

    def _floor(self) -> dict[str, Any]:
        space = self.route.selection.visibility.candidates.space
        floor = space.floor
        return {
            "name": floor.name,
            "area_m2": floor.area,
            "rooms": len(floor.rooms),
            "openings": len(floor.openings),
            "findings": [
                {"code": f.code, "message": f.message, "element": f.element, "at": f.at}
                for f in space.findings
            ],
        }

    def as_text(self) -> str:
        """A few lines a person reads."""
        told = self.as_json()
        floor, route, times = told["floor"], told["route"], told["schedule"]
        chosen = told["selection"]
        minutes = times["total_s"] / 60
        lines = [
            f"{floor['name']}: {floor['area_m2']:.0f} m², {floor['rooms']} rooms, "
            f"{floor['openings']} openings",
            f"  targets     {told['targets']['total']} units, "
            f"{told['visibility']['visible']} visible from {told['candidates']['reachable']} candidates",
            f"  stops       {chosen['stops']} (at least {chosen['bound']} are needed), "
            f"coverage {100 * chosen['coverage']:.1f} % of what is visible",
            f"  route       {route['length_m']:.1f} m {route['tour']} "
            f"(no route is below {route['bound_m']:.1f} m), from {route['start']}",
            f"  time        {minutes:.0f} min: drive {times['drive_s']:.0f} s, turn {times['turn_s']:.0f} s, "
            f"settle {times['settle_s']:.0f} s, scan {times['scan_s']:.0f} s",
        ]
        lines += [f"  unreached   {u.room} ({u.area_m2:.1f} m²): {u.why}" for u in self.unreached]
        lines += [f"  finding     {finding['message']}" for finding in floor["findings"]]
        return "\n".join([*lines, *(f"  {key:<11} {path}" for key, path in self.files.items())])


def _places(xy: FloatArray) -> int:
    """Different positions: a scanner that does not look all round has several headings at each."""
    return len(np.unique(xy, axis=0))
