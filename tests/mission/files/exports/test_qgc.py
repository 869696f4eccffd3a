"""`.plan` as MAVSDK imports it, `.waypoints` as pymavlink and MAVSDK load it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import msgspec
import pytest
from mavsdk.plugins.mission_raw import MissionRaw
from pymavlink.mavwp import MAVWPLoader

from stopgo.mission.document import Mission
from stopgo.mission.errors import NegativeResult
from stopgo.mission.files.exports import exported
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE, Geodetic, from_geodetic
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.read_back import home_item
from stopgo.mission.mavlink.translate import translate
from tests.mission.files.exports.worlds import laboratory

FileOf = Callable[[bytes, str], str]
every = pytest.mark.parametrize("autopilot", AUTOPILOTS)


@every
def test_mavsdk_imports_the_plan_item_by_item(
    mission: Mission, autopilot: str, mavsdk: MissionRaw, file: FileOf
) -> None:
    data = exported(mission, "plan", Supplements(autopilot=autopilot))
    read = mavsdk.import_qgroundcontrol_mission(file(data, "site.plan"))
    assert not read.geofence_items
    assert not read.rally_items
    sent = translate(mission, autopilot)
    home = home_item(sent.origin)
    first, *items = read.mission_items  # MAVSDK puts home in front for the ArduPilot it talks to
    assert (first.command, first.x, first.y, first.z) == (16, home.x, home.y, home.z)
    assert len(items) == len(sent.items)
    for got, item in zip(items, sent.items, strict=True):
        assert (got.command, got.x, got.y, got.z) == (item.command, item.x, item.y, item.z)
        told = (got.param1, got.param2, got.param3, got.param4)
        assert told == pytest.approx(item.params, rel=1e-6, nan_ok=True)
        assert got.autocontinue == 1


def test_the_plan_has_every_key_its_readers_ask_for() -> None:
    plan = json.loads(exported(laboratory(), "plan", Supplements(autopilot="px4")))
    assert (plan["fileType"], plan["version"]) == ("Plan", 1)
    assert {"groundStation", "mission", "geoFence", "rallyPoints"} <= set(plan)
    body = plan["mission"]
    assert (body["version"], body["firmwareType"], body["vehicleType"]) == (2, 12, 10)
    assert body["plannedHomePosition"] == [47.3769, 8.5417, 408.0]
    altitude = {"Altitude", "AltitudeMode", "AMSLAltAboveTerrain"}
    for number, item in enumerate(body["items"], 1):
        assert item["doJumpId"] == number
        assert len(item["params"]) == 7
        assert altitude & set(item) in (altitude, set())
        assert item["frame"] in (2, 3)


def test_corners_for_px4_have_no_heading_and_null_says_so() -> None:
    items = json.loads(exported(laboratory(), "plan", Supplements(autopilot="px4")))["mission"]["items"]
    waypoints = [item["params"] for item in items if item["command"] == Command.NAV_WAYPOINT]
    assert None in [params[3] for params in waypoints]
    assert all(None not in params[:3] for params in waypoints)


@every
def test_pymavlink_loads_the_waypoints_row_by_row(mission: Mission, autopilot: str, file: FileOf) -> None:
    data = exported(mission, "waypoints", Supplements(autopilot=autopilot))
    loader = MAVWPLoader()
    sent = translate(mission, autopilot)
    assert loader.load(file(data, "site.waypoints")) == len(sent.items) + 1
    home, *rows = [loader.wp(number) for number in range(loader.count())]
    assert (home.command, home.frame, home.current) == (16, 0, 1)
    assert (home.x, home.y, home.z) == (sent.origin.lat, sent.origin.lon, sent.origin.alt)
    for number, (row, item) in enumerate(zip(rows, sent.items, strict=True), 1):
        steps = STEPS_PER_DEGREE if item.command == Command.NAV_WAYPOINT else 1
        assert (row.seq, row.command, row.current) == (number, item.command, 0)
        assert (round(row.x * steps), round(row.y * steps)) == (item.x, item.y)
        told = (row.param1, row.param2, row.param3, row.param4)
        assert told == pytest.approx(item.params, nan_ok=True)


def test_mavsdk_loads_the_waypoints_too(mavsdk: MissionRaw, file: FileOf) -> None:
    data = exported(laboratory(), "waypoints", Supplements())
    read = mavsdk.import_mission_planner_mission(file(data, "site.waypoints")).mission_items
    places = [(item.x, item.y) for item in translate(laboratory()).items if item.command == 16]
    assert [(item.x, item.y) for item in read if item.command == 16][-len(places) :] == places


def test_rows_are_twelve_columns_apart_by_tabs() -> None:
    head, *rows = exported(laboratory(), "waypoints", Supplements()).decode().splitlines()
    assert head == "QGC WPL 110"
    for row in rows:
        cells = row.split("\t")
        assert len(cells) == 12
        assert all(len(cell.partition(".")[2]) >= 8 for cell in cells[8:10])


@every
def test_a_stop_stands_within_8_mm_by_the_autopilots_own_rule(mission: Mission, autopilot: str) -> None:
    plan = json.loads(exported(mission, "plan", Supplements(autopilot=autopilot)))
    origin, rule = mission.georeference, AUTOPILOTS[autopilot].rule
    assert origin is not None
    named = {plan["stopgo"]["stops"][number]: int(number) for number in plan["stopgo"]["stops"]}
    for stop in mission.stops:
        lat, lon = plan["mission"]["items"][named[stop.id] - 1]["params"][4:6]
        there = from_geodetic(origin, Geodetic(lat=lat, lon=lon), rule)
        assert math.dist(there, (stop.x, stop.y)) <= 0.008


@pytest.mark.parametrize("name", ["plan", "waypoints"])
def test_a_mission_that_needs_its_headings_is_refused_for_who_drops_them(name: str) -> None:
    narrow = msgspec.structs.replace(laboratory().scanner, fov_deg=90.0)
    made = msgspec.structs.replace(laboratory(), scanner=narrow)
    with pytest.raises(NegativeResult, match=r"stop s01: heading 200\.0° is needed"):
        exported(made, name, Supplements(autopilot="ardupilot"))
    with pytest.raises(NegativeResult, match="px4 turns no rover to it"):
        exported(made, name, Supplements(autopilot="px4"))
    assert exported(made, name, Supplements(autopilot="generic"))


WAYS = [
    Supplements(trigger="camera"),
    Supplements(trigger="none"),
    Supplements(settle="hold"),
    Supplements(scan_wait="script_time"),
    Supplements(autopilot="px4", settle="hold", trigger="none"),
]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["plan", "waypoints"])
def test_items_are_those_that_a_push_sends_with_the_same_options(
    name: str, way: Supplements, file: FileOf
) -> None:
    data = exported(laboratory(), name, way)
    sent = translate(
        laboratory(), way.autopilot, trigger=way.trigger, scan_wait=way.scan_wait, settle=way.settle
    )
    told = [item.command for item in sent.items]
    if name == "plan":
        assert [item["command"] for item in json.loads(data)["mission"]["items"]] == told
    else:
        loader = MAVWPLoader()
        loader.load(file(data, "site.waypoints"))
        assert [loader.wp(number).command for number in range(1, loader.count())] == told
