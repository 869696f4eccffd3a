"""Clocks that are set while a log is written, and stamps that are wrong: the order of writing decides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stopgo.recordings.logs import read_log
from stopgo.recordings.logs.clock_steps import mended_times
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replay_text import as_text
from stopgo.recordings.replay.replaying import replay
from tests.recordings.logs.test_autopilot_logs import told
from tests.recordings.logs.writing import write_telemetry_log
from tests.recordings.replay.driving import driven, logged, wandering

MISSION = wandering(1)


def table(path: Path, *steps: tuple[int, float]) -> Path:
    """A drive as planned; from each of some poses on the clock is ahead by so many seconds."""
    track = logged(driven(MISSION))
    ns = track.ns.copy()
    for first, seconds in steps:
        ns[first:] += round(seconds * 1e9)
    rows = zip(ns.tolist(), track.xy.tolist(), track.heading.tolist(), strict=True)
    text = "".join(f"{time},{x},{y},{heading}\n" for time, (x, y), heading in rows)
    path.write_text("time_ns,x,y,heading\n" + text)
    return path


@pytest.mark.parametrize(
    "steps",
    [((900, -3600.0),), ((700, -120.0),), ((500, -3600.0), (900, 3600.0)), ((30, 120.0),)],
)
def test_a_clock_that_is_set_in_mid_log_changes_no_verdict(
    tmp_path: Path, steps: tuple[tuple[int, float], ...]
) -> None:
    found = replay(read_log(table(tmp_path / "a.csv", *steps)), MISSION, Placing(align="first"))
    assert drive_verdict(found).answer == "yes"
    assert found.comparison.greatest_deviation_m == pytest.approx(0, abs=0.01)
    first, seconds = steps[0]
    (line, *_) = found.placed.source.oddities
    assert f"the clock steps {'back' if seconds < 0 else 'forward'} by " in line
    assert float(line.split(" by ")[1].split(" s ")[0]) == pytest.approx(abs(seconds), abs=0.2)
    assert f"after pose {first} of" in line and line in as_text(found)


@pytest.mark.parametrize("at", [0, 700, -1])
def test_one_stamp_far_off_is_left_out_and_reported(tmp_path: Path, at: int) -> None:
    path = table(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    row = 1 + at if at >= 0 else at
    ns, rest = lines[row].split(",", 1)
    lines[row] = f"{int(ns) + 9000 * 10**9},{rest}"
    path.write_text("\n".join(lines))
    log = read_log(path)
    assert log.seconds < 1000
    found = replay(log, MISSION, Placing(align="stops"))
    assert drive_verdict(found).answer == "yes"
    assert any("1 of " in line and "far from" in line for line in log.poses[0].oddities)


def test_a_gap_in_the_poses_is_no_step_of_the_clock() -> None:
    """The robot drove on meanwhile, or was stationary: nobody knows."""
    ns = np.arange(100) * 10**8
    xy = np.column_stack([np.arange(100) * 0.05, np.zeros(100)])
    kept = (ns < 3 * 10**9) | (ns > 6 * 10**9)
    assert mended_times(ns[kept], xy[kept]).lines == ()
    later = np.where(np.arange(100) < 50, ns, ns + 60 * 10**9)
    assert mended_times(later, np.zeros((100, 2))).lines == ()


def test_poses_out_of_order_by_less_than_a_second_are_sorted() -> None:
    ns = np.arange(100) * 10**8
    ns[[40, 42]] = ns[[42, 40]]
    mended = mended_times(ns, np.zeros((100, 2)))
    assert mended.lines == () and mended.ns.tolist() == ns.tolist()


def test_the_stations_clock_is_set_back_in_a_telemetry_log(tmp_path: Path) -> None:
    """All that it received then counts on: poses, modes and lists alike."""
    rows = [(ns - (3600 * 10**9 if k >= 50 else 0), *row) for k, (ns, *row) in enumerate(told())]
    log = read_log(write_telemetry_log(tmp_path / "a.tlog", rows))
    whole = read_log(write_telemetry_log(tmp_path / "b.tlog", told()))
    assert np.allclose(log.poses[0].xy, whole.poses[0].xy)
    assert log.seconds == pytest.approx(whole.seconds, abs=0.2)
    assert any("steps back by 36" in line or "steps back by 35" in line for line in log.oddities)
    rows = [(ns + (9000 * 10**9 if k == 50 else 0), *row) for k, (ns, *row) in enumerate(told())]
    wrong = read_log(write_telemetry_log(tmp_path / "c.tlog", rows))
    assert wrong.seconds == pytest.approx(whole.seconds, abs=0.2)
