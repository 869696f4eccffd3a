"""Yes only from evidence for every stop, no only from evidence against one, else undecided."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed

from stopgo.mission.document import with_digest
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.field_log import Remark, poses_of
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.heading_evidence import heading_answer, unknown_headings
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replay_text import as_csv, as_json, as_text
from stopgo.recordings.replay.replaying import replay
from stopgo.recordings.replay.stop_evidence import stop_evidence
from stopgo.recordings.replay.unseen_visits import possible_s
from tests.faults.sizes import size, some
from tests.recordings.replay.driving import BEGIN_NS, Drive, Odd, Senses, driven, logged, wandering
from tests.recordings.replay.test_replaying import held, log_of
from tests.recordings.truth.disturbances import sensed
from tests.recordings.truth.drives import (
    Mishap,
    Visit,
    about_the_start,
    as_planned,
    given_up,
    mission_with_return,
    repeated,
    shifted,
    shuffled,
    toured,
)

MISSION = wandering(1)
FIRST = Placing(align="first")
THERE = Placing(to_map=Transform(x=0.0, y=0.0, heading=0.0))


def seen(drive: Drive, kept: Callable[[np.ndarray], np.ndarray]) -> Track:
    """The log of a drive without the poses at some seconds."""
    track = logged(drive)
    mask = kept((track.ns - BEGIN_NS) / 1e9)
    return Track.of(track.ns[mask], track.xy[mask], track.heading[mask])


@pytest.mark.parametrize("placing", [Placing(align="first"), Placing(align="stops")])
def test_a_constant_drift_that_explains_every_standstill_is_no_evidence_for_them(placing: Placing) -> None:
    """Wheels 1 % too large that turn away look like a robot whose map is turned and stretched."""
    found = replay(log_of(logged(driven(MISSION), Senses(slip=0.01))), MISSION, placing)
    assert found.comparison.greatest_deviation_m is not None and found.comparison.greatest_deviation_m > 0.1
    assert drive_verdict(found).answer == "unknown"


@pytest.mark.parametrize("turn, scale", some([(0.01, 1.0), (0.02, 1.0), (0.0, 1.01), (0.01, 0.99)], every=2))
@pytest.mark.parametrize("placing", [THERE, FIRST, Placing(align="stops")], ids=["map", "first", "stops"])
def test_a_tour_that_was_turned_or_stretched_is_never_a_yes(
    turn: float, scale: float, placing: Placing
) -> None:
    """The robot's map lies so far off the drawing; at its start both agree."""
    for seed in range(1, 1 + size(short=1, full=3)):
        mission = mission_with_return(seed)
        tour = about_the_start(mission, turn, scale)
        assert not all(tour.good)
        poses = sensed(tour)
        track = Track.of(poses.ns, poses.xy, poses.heading)
        for frame in ("map", "odom"):
            assert drive_verdict(replay(log_of(track, frame=frame), mission, placing)).answer != "yes"


@pytest.mark.parametrize("seed", range(1, 1 + size(short=1, full=3)))
@pytest.mark.parametrize("by", [(0.9, -0.7), (0.1, 0.06), (-0.06, 0.02)])
def test_a_tour_that_was_shifted_is_no_yes_by_a_fit_to_its_stops(seed: int, by: tuple[float, float]) -> None:
    mission = mission_with_return(seed)
    poses = sensed(shifted(mission, by))
    log = log_of(Track.of(poses.ns, poses.xy, poses.heading))
    judged = drive_verdict(replay(log, mission, Placing(align="stops")))
    assert judged.answer == "unknown"
    assert "give --map X,Y,HEADING" in judged.text


def test_a_fit_to_the_stops_is_a_yes_where_the_log_begins_at_the_start() -> None:
    mission = mission_with_return(1)
    for writer in (shifted(mission, (0.0, 0.0)), as_planned(mission, np.random.default_rng(1))):
        poses = sensed(writer)
        track = Track.of(poses.ns, poses.xy, poses.heading)
        assert drive_verdict(replay(log_of(track), mission, Placing(align="stops"))).answer == "yes"
        late = Track.of(track.ns[200:], track.xy[200:], track.heading[200:])
        assert drive_verdict(replay(log_of(late), mission, Placing(align="stops"))).answer == "unknown"


@pytest.mark.parametrize("seed", range(1, 5))
def test_a_drift_that_wanders_shows_neither_yes_nor_no(seed: int) -> None:
    """The error grows by some 0.1 m between stops: no fit explains that, and no standstill excludes it."""
    track = logged(driven(MISSION))
    chance = np.random.default_rng(seed)
    walk = np.cumsum(chance.normal(0, 0.06, (60, 2)), axis=0)
    seconds, knots = (track.ns - BEGIN_NS) / 1e9, np.linspace(0, 240, 60)
    moved = np.stack([np.interp(seconds, knots, column) for column in walk.T], axis=-1)
    judged = drive_verdict(
        replay(log_of(Track.of(track.ns, track.xy + moved - moved[0], track.heading)), MISSION, FIRST)
    )
    assert (judged.answer, judged.exit_code) == ("unknown", 3)
    assert "undecided" in judged.text


@pytest.mark.parametrize("beside", [0.1, 0.15, 0.3])
def test_one_position_error_is_reported_though_the_log_drifts(beside: float) -> None:
    drive = driven(MISSION)
    track = logged(drive, Senses(slip=0.01))
    halt = drive.halts[4]
    seconds = (track.ns - BEGIN_NS) / 1e9
    xy = track.xy.copy()
    xy[(seconds > halt.begin_s - 0.5) & (seconds < halt.end_s + 0.5)] += (beside, 0.0)
    assert drive_verdict(replay(log_of(Track.of(track.ns, xy, track.heading)), MISSION, FIRST)).answer == "no"


def test_a_robot_that_stood_off_its_stops_is_reported_though_the_log_drifts() -> None:
    """Distances between its standstills differ from those planned by more than any drift."""
    drive = driven(MISSION, Odd(beside_m=0.5))
    found = replay(log_of(logged(drive, Senses(slip=0.01))), MISSION, Placing(align="first"))
    assert drive_verdict(found).answer == "no"


def test_one_stop_that_was_missed_by_a_little_is_reported_where_the_others_hold() -> None:
    drive = driven(MISSION)
    track = logged(drive)
    halt = drive.halts[4]
    seconds = (track.ns - BEGIN_NS) / 1e9
    xy = track.xy.copy()
    xy[(seconds > halt.begin_s - 0.5) & (seconds < halt.end_s + 0.5)] += (0.08, 0.0)
    found = replay(log_of(Track.of(track.ns, xy, track.heading)), MISSION, THERE)
    assert drive_verdict(found).answer == "no"
    assert "s05: position error 80 mm" in drive_verdict(found).text


@pytest.mark.parametrize("climb", [3.2, -3.2, 1.0])
def test_a_robot_that_changed_its_storey_did_not_visit_the_stops_of_the_other(climb: float) -> None:
    drive = driven(MISSION)
    track = logged(drive)
    seconds = (track.ns - BEGIN_NS) / 1e9
    height = np.clip((seconds - drive.halts[3].end_s) / 5, 0, 1) * climb + 7.0
    judged = drive_verdict(replay(log_of(track, height=height), MISSION, replace(THERE, level_m=7.0)))
    assert judged.answer == ("yes" if climb == 1.0 else "unknown")
    assert ("3.2 m higher than at the start" in judged.text) == (climb == 3.2)
    assert ("s05" in judged.text, "s04" in judged.text) == (climb != 1.0, False)


@pytest.mark.parametrize("level", [None, 9.6, 0.0, 3.0])
def test_a_run_on_another_storey_is_undecided_until_its_height_is_given(level: float | None) -> None:
    track = logged(driven(MISSION))
    log = log_of(track, height=np.full(len(track), 9.6))
    judged = drive_verdict(replay(log, MISSION, replace(THERE, level_m=level)))
    assert judged.answer == ("yes" if level == 9.6 else "unknown")
    assert ("begin at 9.6 m" in judged.text) == (level != 9.6)


def test_poses_that_are_missing_during_a_stop_do_not_show_that_nobody_was_there() -> None:
    drive = driven(MISSION)
    halt = drive.halts[4]
    track = seen(drive, lambda s: (s < halt.begin_s - 2) | (s > halt.end_s + 2))
    judged = drive_verdict(replay(log_of(track), MISSION, THERE))
    assert judged.answer == "unknown"
    assert "8 of 9" in judged.text and "s05 is undecided" in judged.text and "without poses" in judged.text


@pytest.mark.parametrize("late_s", [0.13, 0.23, 1.23, -3.3])
def test_a_gap_into_which_the_robot_turned_away_does_not_show_that_it_stood_too_shortly(
    late_s: float,
) -> None:
    """Of 14 s at the stop, the last ones are unseen, and after the gap it has turned, or driven on."""
    drive = driven(MISSION)
    end = drive.halts[0].end_s + late_s
    track = seen(drive, lambda s: (s <= end - 8.0) | (s >= end))
    judged = drive_verdict(replay(log_of(track, own_clock=True), MISSION, THERE))
    assert judged.answer == ("unknown" if late_s > 0 else "yes")


def test_a_gap_that_begins_just_behind_a_standstill_counts_with_it() -> None:
    """The standstill ends one pose before the gap: autopilots round their poses."""
    drive = driven(MISSION)
    halt = drive.halts[0]
    track = seen(drive, lambda s: (s <= halt.end_s - 4.2) | (s >= halt.end_s + 2.8))
    found = replay(log_of(track), MISSION, THERE)
    match = found.matches[0]
    short = replace(match, standstill=replace(match.standstill, end_ns=match.standstill.end_ns - 10**8))
    assert possible_s(found.run.poses, short) == pytest.approx(possible_s(found.run.poses, match))
    assert possible_s(found.run.poses, short) > 14


def test_a_stop_that_was_passed_in_sight_is_a_no() -> None:
    track = logged(driven(MISSION, Odd(skipped=frozenset({4}))))
    assert drive_verdict(replay(log_of(track), MISSION, THERE)).answer == "no"


def test_a_log_that_begins_late_is_no_evidence_of_the_stops_before() -> None:
    drive = driven(MISSION)
    track = seen(drive, lambda s: s > drive.halts[2].end_s + 1)
    judged = drive_verdict(replay(log_of(track), MISSION, THERE))
    assert judged.answer == "unknown"
    assert "s01, s02 and s03 are undecided: the log begins" in judged.text


def test_half_a_log_is_no_evidence_of_the_stops_after() -> None:
    drive = driven(MISSION)
    track = seen(drive, lambda s: s < drive.halts[5].end_s + 1)
    judged = drive_verdict(replay(log_of(track), MISSION, THERE))
    assert judged.answer == "unknown"
    assert "s07, s08 and s09 are undecided: the log ends" in judged.text


def test_rare_poses_do_not_show_that_a_standstill_was_too_short() -> None:
    """Every 5 s a pose, and scans of 14 s: what is seen of them is 5 or 10 s."""
    track = logged(driven(MISSION))
    rare = np.arange(len(track)) % 50 == 3
    found = replay(log_of(Track.of(track.ns[rare], track.xy[rare], track.heading[rare])), MISSION, THERE)
    assert drive_verdict(found).answer == "unknown"
    assert found.extra == ()


@pytest.mark.parametrize("seed", range(1, 4))
def test_poses_every_five_seconds_are_never_a_no(seed: int) -> None:
    mission = wandering(seed)
    track = logged(driven(mission))
    rare = Track.of(track.ns[::50], track.xy[::50], track.heading[::50])
    judged = drive_verdict(replay(log_of(rare), mission, Placing(align="first")))
    assert judged.answer != "no"
    assert "not at a stop" not in judged.text


@pytest.mark.parametrize("seed", [3110, 1, 2, 3, 4, 5, 6, 7])
def test_poses_every_five_seconds_are_never_a_no_in_any_order_of_the_stops(seed: int) -> None:
    mission, chance = mission_with_return(seed), np.random.default_rng(seed)
    poses = sensed(shuffled(mission, chance), 0.2)
    judged = drive_verdict(replay(log_of(Track.of(poses.ns, poses.xy, poses.heading)), mission, THERE))
    assert judged.answer == "unknown"


def test_stops_that_were_visited_in_another_order_were_visited() -> None:
    """The fourth and fifth stop change places."""
    stops = list(MISSION.stops)
    before, one, other, behind = ((stop.x, stop.y) for stop in stops[2:6])
    stops[3:6] = [
        changed(stops[4], approach=(before, other)),
        changed(stops[3], approach=(other, one)),
        changed(stops[5], approach=(one, behind)),
    ]
    drive = driven(with_digest(changed(MISSION, stops=tuple(stops))))
    judged = drive_verdict(replay(log_of(logged(drive)), MISSION, THERE))
    assert judged.answer == "yes"
    assert "9 of 9 stops" in judged.text


def test_a_stop_without_a_trigger_is_undecided_where_others_have_one() -> None:
    """The robot was held there by hand, and sent on past its scan."""
    drive = driven(MISSION)
    track = logged(drive)
    triggers = [
        Remark(int(track.ns[0] + (halt.begin_s + 3.0) * 1e9), "trigger", "camera")
        for halt in drive.halts
        if halt.stop is not None
    ]
    assert drive_verdict(replay(log_of(track, remarks=tuple(triggers)), MISSION, THERE)).answer == "yes"
    assert drive_verdict(replay(log_of(track), MISSION, THERE)).answer == "yes"
    found = replay(log_of(track, remarks=(*triggers[:3], *triggers[4:])), MISSION, THERE)
    assert drive_verdict(found).answer == "unknown"
    assert "s04 is undecided: the log shows no trigger of the scanner there" in drive_verdict(found).text
    assert len(found.scanned_from) == len(MISSION.stops) - 1


@pytest.mark.parametrize(
    "beside_m, seconds, answer", [(0.3, 1000.0, "unknown"), (0.3, 3.0, "yes"), (0.03, 1000.0, "yes")]
)
def test_a_step_of_the_poses_that_lasts_is_their_uncertainty(
    beside_m: float, seconds: float, answer: str
) -> None:
    """Before it or after it they were wrong; the robot follows them, so that its stops look good."""
    drive = driven(MISSION)
    track, way = logged(drive), (drive.halts[3].end_s + drive.halts[4].begin_s) / 2
    late = (track.ns - BEGIN_NS) / 1e9 - way
    xy = track.xy + np.where((late > 0) & (late < seconds), beside_m, 0.0)[:, None] * (0.0, 1.0)
    mission = changed(
        MISSION,
        stops=tuple(
            changed(stop, y=stop.y + beside_m if k > 3 and seconds > 100 else stop.y)
            for k, stop in enumerate(MISSION.stops)
        ),
    )
    found = replay(log_of(Track.of(track.ns, xy, track.heading), frame="map"), mission, THERE)
    assert drive_verdict(found).answer == answer
    unsure_m = [one.unsure_m or 0.0 for one in stop_evidence(found)]
    assert min(unsure_m) == pytest.approx(beside_m if answer == "unknown" else 0.0, abs=0.02)


def test_the_figures_tell_their_uncertainty_and_what_was_not_seen() -> None:
    drive = driven(MISSION)
    track = seen(drive, lambda s: (s < drive.halts[2].end_s + 0.5) | (s > drive.halts[3].begin_s - 0.5))
    found = replay(log_of(track), MISSION, THERE)
    text = " ".join(as_text(found).split())
    assert "uncertain position errors ± 1 mm" in text
    assert re.search(
        r"greatest ≤ \d+ mm at [\d.]+ s, while recorded \(\d\d\.\d % of the path\), unseen \d:\d\d", text
    )
    evidence = as_json(found)["evidence"]
    assert [one["answer"] for one in evidence] == ["yes"] * len(MISSION.stops)
    assert all(0 <= one["unsure_m"] < 0.002 for one in evidence)
    assert b"unsure_m,answer" in as_csv(found)


def test_a_drift_that_begins_after_stops_that_hold_is_no_evidence_where_its_path_has_a_gap() -> None:
    """Vehicles on visual odometry drift in a frame that is tied to the earth; a gap hides the path."""
    drive = driven(MISSION)
    track = seen(drive, lambda s: (s < drive.halts[0].end_s + 3) | (s > drive.halts[1].begin_s - 3))
    seconds = (track.ns - BEGIN_NS) / 1e9
    drift = 0.002 * np.maximum(0.0, seconds - drive.halts[3].end_s)
    moved = Track.of(track.ns, track.xy + drift[:, None] * (1.0, 0.3), track.heading)
    judged = drive_verdict(replay(log_of(moved, frame="map"), MISSION, THERE))
    assert judged.answer == "unknown"
    assert "the poses drift" in judged.text


def test_noise_of_rare_poses_is_no_evidence_against_a_stop() -> None:
    """One pose in 3 s, with a noise of 40 mm, where 50 mm are tolerated."""
    for seed in range(3):
        track, chance = logged(driven(MISSION)), np.random.default_rng(seed)
        xy = track.xy[::30] + chance.normal(0, 0.04, track.xy[::30].shape)
        found = replay(log_of(Track.of(track.ns[::30], xy, track.heading[::30])), MISSION, THERE)
        assert drive_verdict(found).answer == "unknown"


def test_a_standstill_in_which_the_clock_was_set_back_may_have_been_longer() -> None:
    """Eight seconds are missing in a halt, and the clock is set back meanwhile."""
    drive = driven(MISSION)
    begin_s = drive.halts[4].begin_s + 3
    track = seen(drive, lambda s: (s < begin_s) | (s > begin_s + 8))
    ns = track.ns - np.where((track.ns - BEGIN_NS) / 1e9 > begin_s, 120 * 10**9, 0)
    poses = poses_of("/odom", "map", ns, track.xy, track.heading)
    assert poses is not None
    judged = drive_verdict(replay(held(poses), MISSION, THERE))
    assert judged.answer == "unknown"
    assert "s05 is undecided: the clock was set while it was stationary" in judged.text


@pytest.mark.parametrize("own_clock, answer", [(False, "unknown"), (True, "yes")])
def test_a_standstill_is_as_long_as_its_poses_show_where_the_clock_may_have_been_set(
    own_clock: bool, answer: str
) -> None:
    """Nine seconds without poses in a standstill look like a clock that was set forward."""
    drive = driven(MISSION)
    begin_s = drive.halts[4].begin_s + 3
    track = seen(drive, lambda s: (s < begin_s) | (s > begin_s + 9))
    judged = drive_verdict(replay(log_of(track, own_clock=own_clock), MISSION, THERE))
    assert judged.answer == answer, judged.text
    assert ("may be a clock that was set forward" in judged.text) is not own_clock


def test_a_robot_that_writes_no_poses_while_it_stands_stood_as_long_as_they_are_missing() -> None:
    drive = driven(MISSION)
    stands = [(halt.begin_s + 1, halt.end_s - 1) for halt in drive.halts]
    track = seen(drive, lambda s: ~np.any([(begin < s) & (s < end) for begin, end in stands], axis=0))
    judged = drive_verdict(replay(log_of(track), MISSION, THERE))
    assert judged.answer == "yes", judged.text


def test_poses_that_end_before_their_log_do_not_show_the_end_of_the_run() -> None:
    """The robot is back at its start when its localisation fails, and drives on for two minutes."""
    mission = mission_with_return(1)
    poses = sensed(given_up(mission, np.random.default_rng(1)))
    track = Track.of(poses.ns, poses.xy, poses.heading)
    log = log_of(track)
    assert drive_verdict(replay(log, mission, THERE)).answer == "no"
    longer = replace(log, end_ns=log.end_ns + 120 * 10**9)
    judged = drive_verdict(replay(longer, mission, THERE))
    assert judged.answer == "unknown"
    assert "120 s without poses at the end of the log" in judged.text


@pytest.mark.parametrize("mishap, seed", [(shuffled, 1), (repeated, 1363)])
def test_without_headings_a_log_that_places_itself_denies_nothing(mishap: Mishap, seed: int) -> None:
    """In another order of the stops the first path has another direction than the planned one."""
    mission = mission_with_return(seed)
    poses = sensed(mishap(mission, np.random.default_rng(seed)))
    track = Track.of(poses.ns, poses.xy, np.zeros(len(poses.ns)))
    blind = replace(log_of(track).poses[0], heading=np.full(len(track), np.nan))
    judged = drive_verdict(replay(held(blind), mission, FIRST))
    assert judged.answer == "unknown"
    assert "the log has no headings" in judged.text


@pytest.mark.parametrize("follows", [True, False], ids=["robot follows its poses", "robot is right"])
@pytest.mark.parametrize(
    "jump, gap_s", [((0.2, 0.2), 0.5), ((0.5, 0.4), 1.5), ((0.2, 0.2), 4.0), ((3.0, 0.0), 1.5)]
)
def test_a_jump_of_the_poses_that_a_gap_hides_leaves_the_stops_undecided(
    jump: tuple[float, float], gap_s: float, follows: bool
) -> None:
    """A robot that follows its poses steers back to the route, and is off it; else only its poses are."""
    mission = mission_with_return(1)
    tour = as_planned(mission, np.random.default_rng(1))
    poses, halts = sensed(tour), tour.drive.halts
    at, end = (halts[4].end_s + halts[5].begin_s) / 2, halts[5].begin_s - 0.5
    left = np.where(poses.true_s > at, 1.0, 0.0)
    if follows:
        left *= 1 - np.clip((poses.true_s - at - gap_s) / (end - at - gap_s), 0, 1)
    kept = np.abs(poses.true_s - at) >= gap_s / 2
    xy = poses.xy + left[:, None] * jump
    track = Track.of(poses.ns[kept], xy[kept], poses.heading[kept])
    judged = drive_verdict(replay(log_of(track), mission, THERE))
    assert judged.answer == "unknown", judged.text


@pytest.mark.parametrize("halted, gap_s", [(True, 3.0), (True, 7.0), (False, 3.0)])
def test_a_jump_that_a_gap_hides_is_no_evidence_against_the_stops_after_it(
    halted: bool, gap_s: float
) -> None:
    """All poses after it lie off by one vector; the robot stood on its stops."""
    mission = mission_with_return(2)
    tour = as_planned(mission, np.random.default_rng(2))
    poses, halts = sensed(tour), tour.drive.halts
    at = halts[3].begin_s + 4.0 if halted else (halts[3].end_s + halts[4].begin_s) / 2
    xy = poses.xy + np.where(poses.true_s > at, 1.0, 0.0)[:, None] * (0.3, -0.4)
    kept = (poses.true_s < at) | (poses.true_s > at + gap_s)
    track = Track.of(poses.ns[kept], xy[kept], poses.heading[kept])
    judged = drive_verdict(replay(log_of(track), mission, THERE))
    assert judged.answer == "unknown", judged.text


@pytest.mark.parametrize("number", [4, 6])
def test_a_gap_is_no_excuse_for_one_stop_that_was_missed(number: int) -> None:
    """The stops after it hold, so that no jump in the gap explains the one that was missed."""
    mission = mission_with_return(2)
    visits = [Visit(k, (0.3, -0.4) if k == number else (0.0, 0.0)) for k in range(len(mission.stops))]
    drive = toured(mission, visits)
    gap = (drive.halts[3].end_s + drive.halts[4].begin_s) / 2
    track = seen(drive, lambda seconds: np.abs(seconds - gap) > 1.0)
    assert drive_verdict(replay(log_of(track), mission, THERE)).answer == "no"


@pytest.mark.parametrize(
    "turns, heading, answer, text",
    [
        (0.0, lambda turn: turn, "yes", "9 of 9 stops"),
        (np.pi, lambda turn: turn, "no", "s03: turned 180.0° from its heading; the scanner sees 180°."),
        (0.0, lambda turn: np.full(len(turn), np.nan), "unknown", "the log has no headings"),
        (0.0, np.degrees, "unknown", "not the directions of driving"),
    ],
    ids=["planned", "turned", "none", "degrees"],
)
def test_a_scanner_that_sees_a_half_needs_the_planned_heading(
    turns: float, heading: Callable[[np.ndarray], np.ndarray], answer: str, text: str
) -> None:
    """Only a scanner that sees all round may face anywhere."""
    stops = list(MISSION.stops)
    stops[2] = changed(stops[2], heading=stops[2].heading + turns)
    track = logged(driven(with_digest(changed(MISSION, stops=tuple(stops)))))
    poses = poses_of("/odom", "map", track.ns, track.xy, heading(track.heading))
    assert poses is not None
    for fov, expected in ((180.0, answer), (360.0, "yes")):
        mission = with_digest(changed(MISSION, scanner=changed(MISSION.scanner, fov_deg=fov)))
        judged = drive_verdict(replay(held(poses), mission, THERE))
        assert judged.answer == expected
    mission = with_digest(changed(MISSION, scanner=changed(MISSION.scanner, fov_deg=180.0)))
    assert text in drive_verdict(replay(held(poses), mission, THERE)).text


def test_a_heading_between_others_is_not_one_of_a_stop() -> None:
    """A compass that is silent while the robot stands at a stop."""
    drive = driven(MISSION)
    track, halt = logged(drive), drive.halts[3]
    seconds = (track.ns - BEGIN_NS) / 1e9
    silent = (seconds > halt.begin_s - 1) & (seconds < halt.end_s + 1)
    poses = poses_of("/odom", "map", track.ns, track.xy, np.where(silent, np.nan, track.heading))
    mission = with_digest(changed(MISSION, scanner=changed(MISSION.scanner, fov_deg=180.0)))
    assert poses is not None
    found = replay(held(poses), mission, THERE)
    judged = drive_verdict(found)
    assert judged.answer == "unknown"
    assert "s04 is undecided: its scanner sees 180°, and the log has no heading there" in judged.text
    assert "no heading there" in unknown_headings(found)
    assert drive_verdict(replay(held(poses), MISSION, THERE)).answer == "yes"  # it stood all the time


@pytest.mark.parametrize("answer, wrong", [("no", slice(4, 5)), ("unknown", slice(0, None))])
def test_a_heading_like_those_around_it_is_undecided_where_the_log_drifts(answer: str, wrong: slice) -> None:
    stops = list(MISSION.stops)
    stops[wrong] = [changed(stop, heading=stop.heading + 1.0) for stop in stops[wrong]]
    mission = changed(MISSION, scanner=changed(MISSION.scanner, fov_deg=180.0), stops=tuple(stops))
    found = replay(log_of(logged(driven(MISSION))), with_digest(mission), THERE)
    assert heading_answer(found, 4, drifts=True)[0] == answer
    assert heading_answer(found, 4, drifts=False)[0] == "no"
