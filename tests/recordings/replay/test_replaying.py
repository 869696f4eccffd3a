"""A log compared with its mission: placed as given, every figure that of the drive, another's refused."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace as changed

import stopgo
from stopgo.command_line import main
from stopgo.mission.document import Frame, Mission, with_digest
from stopgo.mission.errors import InputError, Undecided
from stopgo.mission.files.mission_json import write
from stopgo.mission.frames.transform import SiteOrigin, Transform
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.field_log import FieldLog, Poses, Remark, poses_of
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Align, Placing
from stopgo.recordings.replay.path_and_time import driven_path, lost_times
from stopgo.recordings.replay.replay_text import as_csv, as_json, as_text
from stopgo.recordings.replay.replaying import UNITS, replay
from tests.recordings.logs.writing import Messages, write_bag
from tests.recordings.replay.driving import Drive, Odd, Senses, driven, logged, wandering

MISSION = wandering(1)
FIRST = Placing(align="first")


def log_of(track: Track, *, frame: str = "odom", remarks: tuple[Remark, ...] = (), **about: Any) -> FieldLog:
    poses = poses_of("/odom", frame, track.ns, track.xy, track.heading, **about)
    assert poses is not None
    return held(poses, remarks=remarks)


def held(*poses: Poses, remarks: tuple[Remark, ...] = ()) -> FieldLog:
    ns = np.concatenate([track.ns for track in poses]) if poses else np.zeros(1, np.int64)
    return FieldLog(
        "field.bag", "test", "d" * 64, 1, "wall", int(ns.min()), int(ns.max()), poses=poses, remarks=remarks
    )


def offset_of(drive: Drive, mission: Mission, stop: int) -> float:
    halt = [halt for halt in drive.halts if halt.stop == stop][-1]
    return math.dist((halt.x, halt.y), (mission.stops[stop].x, mission.stops[stop].y))


def test_every_figure_of_a_clean_log_is_that_of_the_drive() -> None:
    drive = driven(MISSION, Odd(skipped=frozenset({3}), beside_m=0.01))
    found = replay(log_of(logged(drive)), MISSION, FIRST)
    outcomes = {item.stop: item.outcome for item in found.comparison.stops}
    assert outcomes.pop("s04") == "skipped"
    assert set(outcomes.values()) == {"unconfirmed"}
    for k, item in enumerate(found.comparison.stops):
        if item.outcome == "unconfirmed":
            assert item.deviation_m == pytest.approx(offset_of(drive, MISSION, k), abs=1e-6)
            truth = next(halt for halt in drive.halts if halt.stop == k)
            assert item.arrived_s == pytest.approx(truth.begin_s, abs=0.2)
    assert drive_verdict(found).answer == "no"


def test_a_drive_as_planned_is_one() -> None:
    found = replay(log_of(logged(driven(MISSION))), MISSION, FIRST)
    assert drive_verdict(found).answer == "yes"
    assert drive_verdict(found).exit_code == 0
    way = driven_path(found)
    assert way.driven_m == pytest.approx(way.planned_m, rel=0.01)
    noisy = replay(log_of(logged(driven(MISSION), Senses(noise_m=0.05))), MISSION, FIRST)
    assert driven_path(noisy).driven_m == pytest.approx(way.planned_m, rel=0.05)
    assert way.greatest_m == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    "how, frame, changes",
    [
        (Placing(to_map=Transform(x=5.0, y=-3.0, heading=0.8)), "odom", {}),
        (FIRST, "odom", {}),
        (Placing(align="stops"), "odom", {}),
        (Placing(), "map", {"frame": Frame(name="site", to_map=Transform(x=5.0, y=-3.0, heading=0.8))}),
    ],
)
def test_a_log_in_another_frame_is_placed_in_every_way(
    how: Placing, frame: str, changes: dict[str, Any]
) -> None:
    mission = with_digest(changed(MISSION, **changes))
    track = logged(driven(mission), Senses(turned=0.8, shifted=(5.0, -3.0)))
    found = replay(log_of(track, frame=frame), mission, how)
    assert drive_verdict(found).answer == "yes"
    assert found.comparison.greatest_deviation_m == pytest.approx(0, abs=0.002)
    assert found.run.alignment is not None
    assert math.remainder(found.run.alignment.heading + 0.8, math.tau) == pytest.approx(0, abs=1e-3)


def test_a_log_on_the_earth_is_placed_by_the_georeference() -> None:
    """The site's +y bears 90°, east: the log's metres east and north are turned by that."""
    mission = with_digest(
        changed(MISSION, georeference=SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=90.0))
    )
    track = logged(driven(mission), Senses(turned=-math.pi / 2))
    about = {"origin": SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=0.0), "rule": "ardupilot"}
    found = replay(log_of(track, frame="local", **about), mission, Placing())
    assert found.comparison.greatest_deviation_m == pytest.approx(0, abs=1e-6)
    about["origin"] = SiteOrigin(lat=48.0, lon=8.0, alt=0.0, heading_deg=0.0)
    with pytest.raises(InputError, match="check the mission"):
        replay(log_of(track, frame="local", **about), mission, Placing())


def test_a_log_is_never_placed_by_a_guess() -> None:
    with pytest.raises(InputError, match="--align first"):
        replay(log_of(logged(driven(MISSION))), MISSION, Placing())


def test_a_log_of_another_mission_is_refused() -> None:
    track = logged(driven(MISSION))
    with pytest.raises(InputError, match="check the mission"):
        replay(log_of(track), MISSION, Placing(to_map=Transform(x=500.0, y=0.0, heading=0.0)))


def test_a_log_without_poses_says_what_it_has() -> None:
    with pytest.raises(InputError, match="no pose in it"):
        replay(held(), MISSION, FIRST)


def test_several_robots_are_not_mixed() -> None:
    track = logged(driven(MISSION))
    both = [poses_of(f"/{r}/odom", "odom", track.ns, track.xy, track.heading, robot=r) for r in ("r1", "r2")]
    log = held(*(poses for poses in both if poses is not None))
    with pytest.raises(InputError, match="several robots"):
        replay(log, MISSION, FIRST)
    assert replay(log, MISSION, Placing(align="first", robot="r2")).placed.source.robot == "r2"


def test_poses_of_two_robots_by_turns_are_refused() -> None:
    """Nearly all were left out, and the others were "never near a stop"."""
    mission, other = wandering(4), wandering(5)
    one, two = (logged(driven(item)) for item in (mission, other))
    count = min(len(one), len(two))
    ns = np.stack([one.ns[:count], two.ns[:count] + 10**7], axis=1).ravel()
    xy = np.stack([one.xy[:count], two.xy[:count]], axis=1).reshape(-1, 2)
    with pytest.raises(InputError, match="% of its poses jump away and back, as of two robots in one log"):
        replay(log_of(Track.of(ns, xy, np.zeros(2 * count))), mission, Placing(align="first"))


@pytest.mark.parametrize(("align", "error"), [("first", InputError), ("stops", Undecided)])
def test_poses_in_millimetres_are_named(align: Align, error: type[Exception]) -> None:
    mission = wandering(4)
    track = logged(driven(mission))
    millimetres = Track.of(track.ns, track.xy * 1000, track.heading)
    with pytest.raises(error, match=r"; its poses move at \d+ m/s: give them in metres"):
        replay(log_of(millimetres), mission, Placing(align=align))


@pytest.mark.parametrize("unit", ["feet", "inches"])
def test_poses_in_another_unit_are_named(unit: str) -> None:
    mission = wandering(4)
    track = logged(driven(mission))
    other = Track.of(track.ns, track.xy * UNITS[unit] + 5000, track.heading)
    with pytest.raises(InputError, match=rf"times as long as the route, as in {unit}: give it in metres"):
        replay(log_of(other, frame="map"), mission, Placing(to_map=Transform(x=0.0, y=0.0, heading=0.0)))


def test_times_in_milliseconds_are_named() -> None:
    """They are read as seconds: the whole drive was one standstill, and no stop could be judged."""
    track = logged(driven(MISSION))
    slow = Track.of(track.ns * 1000, track.xy, track.heading)
    with pytest.raises(InputError, match="with times read as seconds; name the column of times"):
        replay(replace(log_of(slow), format="CSV trajectory"), MISSION, FIRST)
    assert replay(replace(log_of(track), format="CSV trajectory"), MISSION, FIRST).comparison.stops


def test_a_table_with_few_poses_a_minute_has_seconds() -> None:
    track = logged(driven(MISSION))
    few = Track.of(track.ns[::300], track.xy[::300], track.heading[::300])
    assert replay(replace(log_of(few), format="CSV trajectory"), MISSION, FIRST).comparison.stops


def test_a_time_offset_moves_the_run_and_is_reported() -> None:
    track = logged(driven(MISSION))
    found = replay(log_of(track), MISSION, Placing(align="first", time_offset_s=-2.5))
    assert found.run.poses.ns[0] == track.ns[0] - 2_500_000_000
    assert "times by -2.500 s" in as_text(found)


def test_a_standstill_too_short_for_a_scan_is_none() -> None:
    drive = driven(MISSION)
    rows = np.array(drive.rows)
    halt = drive.halts[4]
    kept = (rows[:, 0] <= halt.begin_s + 5) | (rows[:, 0] > halt.end_s)
    rows = rows[kept]
    rows[:, 0] = np.arange(len(rows)) / 10  # nine seconds of the scan never were
    track = Track.of(rows[:, 0] * 1e9, rows[:, 1:3], rows[:, 3])
    found = replay(log_of(track), MISSION, FIRST)
    assert found.comparison.stops[4].outcome == "failed"
    assert "of 14.0 s" in found.comparison.stops[4].reason


def test_a_short_standstill_takes_nothing_from_a_long_one_before() -> None:
    drive = driven(MISSION, Odd(repeated=frozenset({4})))
    rows = np.array(drive.rows)
    again = [halt for halt in drive.halts if halt.stop == 4][1]
    rows = rows[(rows[:, 0] <= again.begin_s + 5) | (rows[:, 0] > again.end_s)]
    rows[:, 0] = np.arange(len(rows)) / 10
    found = replay(log_of(Track.of(rows[:, 0] * 1e9, rows[:, 1:3], rows[:, 3])), MISSION, FIRST)
    stop = found.comparison.stops[4]
    assert stop.outcome == "unconfirmed"
    assert stop.reason.count("stationary") == 1


def test_time_lost_is_found_where_it_was() -> None:
    drive = driven(MISSION, Odd(extra_before=frozenset({5})))
    found = replay(log_of(logged(drive)), MISSION, FIRST)
    stood = next(halt for halt in drive.halts if halt.stop is None)
    worst = lost_times(found)[0]
    assert worst.where.endswith("not at a stop")
    assert worst.seconds == pytest.approx(stood.end_s - stood.begin_s, abs=0.5)


def test_text_json_and_csv_report_the_same() -> None:
    drive = driven(MISSION, Odd(skipped=frozenset({2}), extra_before=frozenset({4}), beside_m=0.02))
    found = replay(log_of(logged(drive)), MISSION, FIRST)
    told = json.loads(json.dumps(as_json(found)))
    rows = list(csv.DictReader(io.StringIO(as_csv(found).decode())))
    text = as_text(found)
    for stop, row in zip(told["run"]["stops"], rows, strict=True):
        assert row["stop"] == stop["stop"]
        assert row["outcome"] == stop["outcome"]
        if stop["deviation_m"] is not None:
            assert float(row["deviation_m"]) == pytest.approx(stop["deviation_m"], abs=1e-4)
            assert f"{1000 * stop['along_m']:+.1f}" in text
    assert told["verdict"] in text
    assert [halt["how"] for halt in told["halts"]].count("extra") == 1


def test_the_command_reads_a_bag_and_writes_table_and_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    messages = Messages(ros2=True)
    drive = driven(MISSION, Odd(beside_m=0.3))
    track = logged(drive)
    rows = [
        ("/odom", "nav_msgs/msg/Odometry", ns, messages.odometry(ns, (x, y, heading)))
        for ns, (x, y), heading in zip(
            track.ns.tolist(), track.xy.tolist(), track.heading.tolist(), strict=True
        )
    ]
    bag = write_bag(tmp_path / "field.mcap", rows)
    plan = tmp_path / "mission.json"
    write(MISSION, plan)
    given = [str(bag), "--mission", str(plan), "--align", "first", "--json"]
    html = tmp_path / "report.html"
    files = ["--csv", str(tmp_path / "stops.csv"), "-o", str(tmp_path / "replay.rrd"), "--html", str(html)]
    assert main(["replay", *given, *files]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["answer"] == "no"
    assert told["run"]["stops"][0]["deviation_m"] == pytest.approx(offset_of(drive, MISSION, 0), abs=1e-6)
    page = html.read_text()
    assert told["verdict"].split(". ")[0] in page
    assert "scan it again" in page
    assert "coverage acquired" not in page
    assert len((tmp_path / "stops.csv").read_text().splitlines()) == 1 + len(MISSION.stops)
    from stopgo.recordings.page.reviewed import review

    (run,) = review([tmp_path / "replay.rrd"]).comparisons
    assert run.log.ended
    assert [item.outcome for item in run.stops] == ["unconfirmed"] * len(MISSION.stops)


def test_from_python_a_log_is_replayed_in_one_call(tmp_path: Path) -> None:
    track = logged(driven(MISSION))
    table = zip(track.ns.tolist(), track.xy.tolist(), track.heading.tolist(), strict=True)
    rows = "".join(f"{ns},{x},{y},{heading}\n" for ns, (x, y), heading in table)
    (tmp_path / "run.csv").write_text("time_ns,x,y,heading\n" + rows)
    found = stopgo.replay(tmp_path / "run.csv", MISSION, align="stops")
    assert drive_verdict(found).answer == "yes"
    assert stopgo.replay(tmp_path / "run.csv", MISSION, to_map=(0.0, 0.0, 0.0)).run.alignment is not None


@pytest.mark.parametrize(
    "options, words",
    [
        (["--map", "1,2"], "--map 1,2"),
        (["--map", "1,2,nan"], "--map 1,2,nan"),
        (["--map", "1e308,2,3"], "--map 1e308,2,3"),
        (["--align", "best"], "--align best"),
        (["--map", "1,2,3", "--align", "first"], "one of them"),
        (["--time-offset", "inf"], "--time-offset"),
        (["--stamps", "mine"], "--stamps mine"),
        (["--poses", "/nothing", "--align", "first"], "--poses /nothing"),
        ([], "--align first"),
    ],
)
def test_bad_options_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    path, plan = tmp_path / "a.csv", tmp_path / "mission.json"
    path.write_text("time,x,y\n0,0,0\n1,0,0\n")
    write(MISSION, plan)
    assert main(["replay", str(path), "--mission", str(plan), *options]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def parked_near(first_stop: tuple[float, float], *, beside_m: float) -> tuple[Drive, Mission]:
    """A drive that misses its first stop, and parks at the start, nearer to the stop than the scan."""
    back = ((MISSION.stops[-1].x, MISSION.stops[-1].y), (MISSION.start.x, MISSION.start.y))
    stops = (changed(MISSION.stops[0], x=first_stop[0], y=first_stop[1]), *MISSION.stops[1:])
    first = changed(stops[0], approach=((0.0, 0.0), first_stop))
    second = changed(stops[1], approach=(first_stop, *stops[1].approach[1:]))
    mission = with_digest(changed(MISSION, stops=(first, second, *stops[2:]), return_=back))
    drive = Drive(0.0, 0.0, 0.0)
    drive.rows.append((0.0, 0.0, 0.0, 0.0))
    for k, stop in enumerate(mission.stops):
        ahead = beside_m if k == 0 else 0.0
        for point in stop.approach[1:]:
            drive.go((point[0] + ahead, point[1]), speed=1.0, turn_rate=1.0)
        drive.turn(stop.heading, turn_rate=1.0)
        drive.stay(14.0, k)
    drive.go(back[-1], speed=1.0, turn_rate=1.0)
    drive.stay(30.0)
    return drive, mission


def test_the_standstill_for_parking_is_not_the_scan_at_a_stop_near_it() -> None:
    drive, mission = parked_near((0.1, 0.0), beside_m=0.2)
    found = replay(log_of(logged(drive)), mission, Placing(to_map=Transform(x=0.0, y=0.0, heading=0.0)))
    first = found.comparison.stops[0]
    assert first.deviation_m == pytest.approx(0.2, abs=0.01)
    assert (first.arrived_s or 0.0) < 10.0


def test_the_standstill_with_the_scan_counts_and_not_one_after_it() -> None:
    drive = driven(MISSION, Odd(repeated=frozenset({4}), beside_m=0.01))
    first, _ = (halt for halt in drive.halts if halt.stop == 4)
    track = logged(drive)
    trigger = Remark(
        int(track.ns[0] + (first.begin_s + 3.0) * 1e9), "trigger", "IMAGE_START_CAPTURE (2000)", 9
    )
    found = replay(log_of(track, remarks=(trigger,)), MISSION, FIRST)
    stop = found.comparison.stops[4]
    assert stop.arrived_s == pytest.approx(first.begin_s, abs=0.3)
    assert "IMAGE_START_CAPTURE" in stop.reason
