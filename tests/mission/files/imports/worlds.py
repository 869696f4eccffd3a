"""Plans and tables as other programs write them."""

from __future__ import annotations

import json
from typing import Any

HOME = (47.3769, 8.5417, 408.0)
NORTH = 0.00009
"""Degrees of latitude that are about 10 m."""

Row = tuple[int, int, tuple[float | None, ...]]
"""Command, frame, and param1 to param7."""


def waypoint(north: float = 1.0, *, hold: float = 0.0, yaw: float | None = None, command: int = 16) -> Row:
    """A waypoint so many times 10 m north of home."""
    return (command, 3, (hold, 0, 0, yaw, HOME[0] + north * NORTH, HOME[1], 0))


def delay(seconds: float, *clock: float) -> Row:
    return (93, 2, (seconds, *(clock or (-1, -1, -1)), 0, 0, 0))


def command(number: int, *params: float | None) -> Row:
    """A command without a place."""
    return (number, 2, (*params, *(0.0 for _ in range(7 - len(params)))))


CAPTURE = command(2000, 0, 0, 1, 0)
SPEED = command(178, 1, 0.8, -1)


def plan(*rows: Row, home: tuple[float, ...] | None = HOME, firmware: int = 3, **root: Any) -> bytes:
    """A .plan of QGroundControl."""
    items = [
        {
            **{"type": "SimpleItem", "autoContinue": True, "doJumpId": number},
            **{"command": command, "frame": frame, "params": list(params)},
        }
        for number, (command, frame, params) in enumerate(rows, 1)
    ]
    mission = {"version": 2, "firmwareType": firmware, "vehicleType": 10, "items": items}
    mission.update({} if home is None else {"plannedHomePosition": list(home)})
    return json.dumps({
        **{"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": mission},
        **{"geoFence": {"circles": [], "polygons": [], "version": 2}},
        **{"rallyPoints": {"points": [], "version": 2}, **root},
    }).encode()  # fmt: skip


def waypoints(*rows: Row, home: tuple[float, ...] = HOME) -> bytes:
    """A table QGC WPL 110."""
    lines = ["QGC WPL 110", "\t".join(map(str, (0, 1, 0, 16, 0, 0, 0, 0, *home, 1)))]
    for number, (command, frame, params) in enumerate(rows, 1):
        told = ["nan" if value is None else str(value) for value in params]
        lines.append("\t".join((str(number), "0", str(frame), str(command), *told, "1")))
    return ("\n".join(lines) + "\n").encode()
