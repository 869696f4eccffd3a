"""Lists that `translate` writes, driven by a vehicle of their autopilot: all scans are in place."""

from __future__ import annotations

import math
from typing import Any

import pytest

from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE, Geodetic, from_geodetic
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.read_back import differences, upload_of
from stopgo.mission.mavlink.stop_numbers import stop_numbered
from stopgo.mission.mavlink.translate import translate
from tests.bridge.mavlink.simulated.bench import ACCEPTED, Bench, item_of
from tests.mission.worlds import square_tour

WAYS: list[tuple[str, str, dict[str, Any]]] = [
    ("strict", "generic", {}),
    ("px4", "px4", {}),
    ("ardupilot", "ardupilot", {}),
    ("ardupilot", "ardupilot", {"trigger": "camera"}),
    ("ardupilot", "ardupilot", {"scan_wait": "script_time"}),
    ("ardupilot", "ardupilot", {"trigger": "camera", "settle": "hold"}),
]
NEAR_M = 0.02
"""Two steps of 1e-7 degrees."""


@pytest.mark.parametrize(("profile", "autopilot", "choices"), WAYS)
def test_every_scan_is_made_where_and_for_as_long_as_it_was_planned(
    profile: str, autopilot: str, choices: dict[str, Any]
) -> None:
    mission = square_tour()
    sent = translate(mission, autopilot, **choices)
    bench = Bench(profile, origin=sent.origin)
    bench.count(len(upload_of(sent)))
    for number, item in enumerate(upload_of(sent)):
        bench.item(number, item)
    assert bench.results() == [ACCEPTED]
    assert differences(sent, [item_of(message) for message in bench.download()]) == ()
    bench.start()
    bench.pass_time(300.0)
    pictures = bench.said("CAMERA_IMAGE_CAPTURED")
    assert [picture.capture_result for picture in pictures] == [1, 1]
    for picture, stop in zip(pictures, mission.stops, strict=True):
        name, _, told = picture.file_url.partition("?")
        assert stop_numbered(mission, int(name.removesuffix(".e57").rpartition("-")[2])) == stop.id
        assert dict(part.split("=") for part in told.split("&"))["points"] == str(360_000 * 60)
        place = Geodetic(lat=picture.lat / STEPS_PER_DEGREE, lon=picture.lon / STEPS_PER_DEGREE)
        where = from_geodetic(sent.origin, place, autopilot_named(autopilot).rule)
        assert math.dist(where, (stop.x, stop.y)) < NEAR_M
    assert bench.reached()[-1] == len(sent.items) - 1
