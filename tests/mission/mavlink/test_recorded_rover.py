"""A mission of scan stops on a real ArduPilot Rover, from the Rover's own log."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.ardupilot import keeps as ardupilot_keeps
from stopgo.mission.mavlink.items import Command, Item, MavFrame
from stopgo.mission.mavlink.recognise import recognise
from stopgo.mission.mavlink.recognised_tour import recognised_tour
from tests.mission.mavlink.rover_log import OF_ROVER_LOG, logged

pytestmark = OF_ROVER_LOG
# Where the log's ORGN message says that the vehicle's origin is.
ORIGIN = SiteOrigin(lat=47.3977, lon=8.5456, alt=488.0, heading_deg=0.0)
CORNERS = [(3.0, 0.0), (3.0, 3.0), (6.0, 3.0), (6.0, 0.0), (9.0, 0.0)]


@pytest.fixture(scope="module")
def kept() -> list[Item]:
    """The 15 items that the vehicle logged when it was armed, home left out."""
    items = {message.CNum: _item(message) for message in logged("CMD")}
    return [items[number] for number in sorted(items) if number > 0]


def _item(message) -> Item:
    params = (message.Prm1, message.Prm2, message.Prm3, message.Prm4)
    lat, lon = (round(angle * 1e7) for angle in (message.Lat, message.Lng))
    return Item(message.CId, message.Frame, params, x=lat, y=lon, z=message.Alt)


def test_what_the_rover_kept_is_what_we_say_it_keeps_again(kept):
    assert len(kept) == 15
    for item in kept:
        predicted = ardupilot_keeps(item)
        if item.command != Command.NAV_WAYPOINT:  # the log writes frame 0 where the read-back says MISSION
            assert predicted.frame == MavFrame.MISSION
            predicted = replace(predicted, frame=item.frame)
        assert predicted == item


def test_what_was_sent_to_it_is_predicted_to_be_kept_so(kept):
    """The mission as it was sent: hold 1 s, message 100 + i with i and the place, delay 3 s."""
    step = 0.011131884502145034
    for number, (x, y) in enumerate(CORNERS):
        lat = 473_977_000 + round(y / step)
        lon = 85_456_000 + round(x / step / math.cos(math.radians(47.3977)))
        sent = [
            Item(Command.NAV_WAYPOINT, MavFrame.GLOBAL_RELATIVE_ALT_INT, (1.0, 0.0, 0.0, 0.0), x=lat, y=lon),
            Item(Command.DO_SEND_SCRIPT_MESSAGE, MavFrame.MISSION, (100.0 + number, number, y, x)),
            Item(Command.NAV_DELAY, MavFrame.MISSION, (3.0, -1.0, -1.0, -1.0)),
        ]
        for item, own in zip(sent, kept[3 * number : 3 * number + 3], strict=True):
            predicted = ardupilot_keeps(item)
            assert replace(predicted, frame=own.frame) == own


def test_it_is_recognised_as_five_stops_three_metres_apart(kept):
    found = recognised_tour(recognise(kept), ORIGIN)
    assert [(visit.settle_s, visit.scan_s, visit.number) for visit in found.visits] == [
        (1.0, 3.0, number) for number in range(5)
    ]
    assert all(
        math.dist(visit.at, place) <= 0.008 for visit, place in zip(found.visits, CORNERS, strict=True)
    )
    assert (found.back, found.speed) == ((), None)
