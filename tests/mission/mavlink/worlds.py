"""Missions small enough to check their items on paper."""

from __future__ import annotations

from dataclasses import replace

import msgspec

from stopgo.mission.document import Mission, ScannerSpec
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.items import Item, ItemList
from stopgo.mission.mavlink.read_back import upload_of
from tests.mission.worlds import mission_of, square_tour, stop

NAMES = list(AUTOPILOTS)


def corner_tour() -> Mission:
    """Round a pillar: two straight points, one real corner, a stop, then back along the same way."""
    return mission_of(
        stop("S1", (0.0, 0.0), (1.0, 0.0), (2.0, 0.01), (4.0, 0.0), (4.0, 3.0)),
        back=((4.0, 3.0), (4.0, 0.0), (0.0, 0.0)),
    )


def narrow_view() -> Mission:
    """The square tour with a scanner that sees a quarter of the circle."""
    scanner = ScannerSpec(profile="default", range=5.0, fov_deg=90.0)
    return changed(square_tour(), scanner=scanner)


def changed(mission: Mission, **fields: object) -> Mission:
    """The mission with other fields."""
    return msgspec.structs.replace(mission, **fields)


def first_stop(mission: Mission, **fields: object) -> Mission:
    """The mission with other fields in its first stop."""
    first, *rest = mission.stops
    return changed(mission, stops=(msgspec.structs.replace(first, **fields), *rest))


def first_scan(mission: Mission, **fields: object) -> Mission:
    """The mission with other fields in its first stop's scan."""
    return first_stop(mission, scan=msgspec.structs.replace(mission.stops[0].scan, **fields))


def read_back(sent: ItemList) -> list[Item]:
    """Items that an honest vehicle gives back, with a home of its own."""
    vehicle = AUTOPILOTS[sent.autopilot]
    kept = [vehicle.kept(item) for item in upload_of(sent)]
    if vehicle.home_first:
        kept[0] = replace(kept[0], x=kept[0].x + 5, z=99.0)
    return kept
