"""QGroundControl's own plans, and plans that are none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.files.imports import qgc_plan, qgc_waypoints
from stopgo.mission.files.imports.track import ImportOptions
from tests.mission.files.imports.worlds import HOME, plan, waypoint, waypoints

MISSIONS = Path(__file__).parents[5] / "shared" / "data" / "missions"
REAL = {
    "qgroundcontrol_sample": r"item 1 \(NAV_TAKEOFF 22\)",
    "qgroundcontrol_sample_with_digicam_control": "home is at latitude 0, longitude 0",
    "qgroundcontrol_sample_with_structured_scan": "item 2 is a 'StructureScan'",
    "qgroundcontrol_sample_with_survey": "item 2 is a 'survey'",
    "qgroundcontrol_sample_with_survey_missing_items": "item 2 is a 'survey'",
    "qgroundcontrol_sample_with_survey_wrong_version": "item 2 is a 'survey'",
    "qgroundcontrol_sample_without_mission": "mission is missing",
    "qgroundcontrol_sample_wrong_mission_version": "mission.version is 7, and only 2 is read",
    "qgroundcontrol_sample_wrong_overall_version": "version is 42, and only 1 is read",
}


@pytest.mark.skipif(not MISSIONS.is_dir(), reason=f"the real inputs are not in {MISSIONS}")
@pytest.mark.parametrize("name", REAL)
def test_a_plan_for_aircraft_is_refused_by_what_it_asks(name: str) -> None:
    with pytest.raises(InputError, match=REAL[name]):
        qgc_plan.read((MISSIONS / f"{name}.plan").read_bytes(), f"{name}.plan", ImportOptions())


@pytest.mark.skipif(not MISSIONS.is_dir(), reason=f"the real inputs are not in {MISSIONS}")
def test_a_real_plan_without_its_aircraft_commands_is_read() -> None:
    document = json.loads((MISSIONS / "qgroundcontrol_sample.plan").read_bytes())
    document["mission"]["items"] = document["mission"]["items"][1:-1]
    track = qgc_plan.read(json.dumps(document).encode(), "p", ImportOptions())
    (visit,) = track.visits
    assert visit.id == "s01"
    # 0.0010047° of longitude on PX4's sphere of 6 371 km at latitude 47.3977°, and 0.00002036° of latitude.
    assert visit.xy == pytest.approx((75.62, 2.26), abs=0.01)
    assert len(track.back) == 2


def test_ids_and_bearing_that_stopgo_wrote_are_read() -> None:
    ours = {"heading_deg": 90.0, "stops": {"2": "Büro"}}
    track = qgc_plan.read(plan(waypoint(1), waypoint(2, hold=5), stopgo=ours), "p", ImportOptions())
    assert [visit.id for visit in track.visits] == ["Büro"]
    assert track.origin.heading_deg == 90.0
    assert track.visits[0].xy == pytest.approx((-20.0, 0.0), abs=0.1)


@pytest.mark.parametrize(
    "ours", [None, 3, {"heading_deg": "x", "stops": []}, {"stops": {"1": 7}}, {"stops": 1}]
)
def test_a_strange_key_of_ours_is_no_reason_to_fail(ours: object) -> None:
    track = qgc_plan.read(plan(waypoint(1, hold=5), stopgo=ours), "p", ImportOptions())
    assert [visit.id for visit in track.visits] == ["s01"]
    assert track.origin.heading_deg == 0.0


def changed(**changes: object) -> bytes:
    """A good plan, with keys of its root, its mission or its item replaced."""
    document = json.loads(plan(waypoint(hold=5)))
    for part in (document, document["mission"], document["mission"]["items"][0]):
        for key in set(part) & set(changes):
            part[key] = changes[key]
    return json.dumps(document).encode()


BROKEN = {
    "fileType is 'Map', not 'Plan'": changed(fileType="Map"),
    "mission is a list of 0, not an object": changed(mission=[]),
    "mission.items is an object of 0, not a list": changed(items={}),
    "mission.plannedHomePosition is a list of 2, not three": changed(plannedHomePosition=[1, 2]),
    "mission.plannedHomePosition is a list of 3, not three": changed(plannedHomePosition=[1, 2, "3"]),
    "item 1 is 5, not an object": changed(items=[5]),
    "item 1: command is '16', not a whole number": changed(command="16"),
    "item 1: command is True, not a whole number": changed(command=True),
    "item 1: command is -1, not a whole number up to 65535": changed(command=-1),
    "item 1: command is 999999999999999999999999999999999999…": changed(command=int("9" * 4000)),
    "item 1: frame is missing, not a whole number": changed(frame=None),
    "item 1: params is a list of 6, not a list of 7": changed(params=[0] * 6),
    "neither number nor null": changed(params=[0] * 6 + ["x"]),
    "give --origin": plan(waypoint(hold=5), home=None),
    "not JSON, or cut off": plan(waypoint(hold=5))[:-9],
    "not UTF-8 text": b"\xff\xfe{}",
    "nested too deeply": b"[" * 200_000,
    "the file is a list of 0, not an object": b"[]",
}


@pytest.mark.parametrize("words", BROKEN)
def test_what_is_no_plan_is_one_line(words: str) -> None:
    with pytest.raises(InputError) as refusal:
        qgc_plan.read(BROKEN[words], "site.plan", ImportOptions())
    assert str(refusal.value).startswith("site.plan: ")
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


GOOD = waypoints(waypoint(hold=5)).decode()
TABLES = {
    "line 3 has a frame or a command above 65535": GOOD.replace("\t16\t5", "\t99999\t5"),
    "begins with '', not 'QGC WPL 110'": "",
    "begins with 'QGC WPL 120'": GOOD.replace("110", "120"),
    "has no row after": "QGC WPL 110\n",
    "line 3 has 11 columns, not 12": GOOD.replace("5\t0\t0", "5\t0"),
    "line 3 holds something that is no number": GOOD.replace("5\t0\t0", "5\tx\t0"),
    "line 3 is row 7, but 1 is due": GOOD.replace("\n1\t", "\n7\t"),
    "home (row 0) is at latitude 0": waypoints(waypoint(hold=5), home=(0.0, 0.0, 0.0)).decode(),
    "home (row 0) is at latitude nan": GOOD.replace(f"{HOME[0]}\t{HOME[1]}\t{HOME[2]}", "nan\tnan\tnan"),
}


@pytest.mark.parametrize("words", TABLES)
def test_what_is_no_table_of_waypoints_is_one_line(words: str) -> None:
    with pytest.raises(InputError) as refusal:
        qgc_waypoints.read(TABLES[words].encode(), "site.waypoints", ImportOptions())
    assert words in str(refusal.value)


def test_comments_and_windows_lines_are_read_over() -> None:
    text = GOOD.replace("QGC WPL 110\n", "QGC WPL 110\n# drawn on Monday\n").replace("\n", "\r\n")
    assert len(qgc_waypoints.read(text.encode(), "w", ImportOptions()).visits) == 1
