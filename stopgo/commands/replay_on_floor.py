"""Replays on the floor of their plan: visible and measured targets, and the follow-up mission."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stopgo.mission.console.table import printable
from stopgo.mission.errors import InputError

if TYPE_CHECKING:
    from stopgo.mission.comparing.measured import Measured
    from stopgo.mission.document import Mission
    from stopgo.planner.pipeline.follow_up_mission import PlannedFloor
    from stopgo.recordings.replay.replayed import Replay


def on_floor(replays: list[Replay], planned: PlannedFloor, clouds: Path | None) -> list[Replay]:
    """Return the replays with what was visible from the robot's stationary poses, and what scans measured."""
    from stopgo.planner.pipeline.follow_up_mission import as_driven
    from stopgo.recordings.replay.heading_evidence import unknown_headings

    found = []
    for item in replays:
        if why := unknown_headings(item):
            _tell(f"{item.log.path}: what was visible is undecided: {why}")
        found.append(item if why else item.with_sight(as_driven(planned, item.scanned_from)))
    return [item.with_measured(_measured(planned, item, clouds)) for item in found]


def _measured(planned: PlannedFloor, replay: Replay, clouds: Path | None) -> Measured | None:
    """Measurements of the scanner's own clouds, else of the scans in the log; None where there is neither."""
    from stopgo.planner.pipeline.measuring import measured
    from stopgo.recordings.clouds import clouds_in, levels
    from stopgo.recordings.replay.placed_sweeps import placed_sweeps

    if clouds is not None:
        return measured(planned, levels(clouds_in(clouds)), least_sweeps=1, surveyed=True)
    found = measured(planned, placed_sweeps(replay))
    return found if found.points else None


def _follow_up_of(replays: list[Replay], planned: PlannedFloor, others: list[Mission]) -> Mission | None:
    """Plan a mission for what all replays together missed; None if they missed nothing required.

    `others` are the missions that divide the floor with the planned one.
    """
    import numpy as np

    from stopgo.planner.pipeline.follow_up_mission import top_up

    scanned_from = np.concatenate([item.scanned_from for item in replays])
    evidence = " ".join(item.log.digest for item in replays)
    obstacles = [
        item.outline
        for replay in replays
        if replay.measured is not None
        for item in replay.measured.unplanned
    ]
    clouds = [item.measured for item in replays if item.measured is not None and item.measured.decides]
    for found in clouds:
        if found.placing_text:
            raise InputError(f"--clouds: {found.placing_text}; no follow-up mission can be planned")
    done = np.any([found.hit | ~found.totals.visible for found in clouds], axis=0) if clouds else None
    return top_up(planned, scanned_from, obstacles=obstacles, evidence=evidence, measured=done, others=others)


def write_follow_up(replays: list[Replay], planned: PlannedFloor, others: list[Mission], path: Path) -> None:
    """Write the follow-up mission, and print its number of stops, or why there is none."""
    from stopgo.mission.files.mission_json import write

    by_clouds = any(item.measured is not None and item.measured.decides for item in replays)
    if not by_clouds and any(item.sight is None for item in replays):
        _tell(f"{path}: not written: it is not known what was visible")
        return
    mission = _follow_up_of(replays, planned, others)
    if mission is None:
        _tell(f"{path}: not written: all required targets were visible, or measured")
        return
    write(mission, path)
    _tell(f"{path}: {len(mission.stops)} follow-up stops")


def _tell(line: str) -> None:
    """Print a line on stderr; a path in it may have any letters."""
    typer.echo(printable(line), err=True)
