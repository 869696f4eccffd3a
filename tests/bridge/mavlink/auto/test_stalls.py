"""A vehicle that stands in AUTO between two waypoints: reported within 10 s, held, and driven on by retry."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from stopgo.mission.run.events import Held
from tests.bridge.mavlink.auto.site import ALL, Site, until, watched
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")


@pytest.mark.parametrize(("profile", "item"), some([("px4", 6), ("ardupilot", 7)], every=2))
def test_a_vehicle_that_stands_in_auto_is_held_within_ten_seconds_and_retry_drives_on(
    profile: str, item: int, tmp_path: Path
) -> None:
    site = Site(tmp_path, profile, faults=[f"stuck@{item}"], speed_up=1.0)
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        until(site, lambda events, run: run.state == "HELD")
        assert site.order("retry").state == "RUNNING"
    (held,) = [event for event in site.events if isinstance(event, Held)]
    assert "stood in AUTO" in held.reason and f"item {item} (to S2)" in held.reason
    seconds = re.search(r"for (\d+) s", held.reason)
    assert seconds is not None and 8 <= int(seconds[1]) <= 10
    assert site.run.done == ("S1", "S2", "S3")


def test_a_short_standstill_is_reported_to_nobody(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", faults=["stuck@7=5"], speed_up=1.0)
    with site.up(), watched(site):
        site.order("start")
    assert told(site.events) == ALL
