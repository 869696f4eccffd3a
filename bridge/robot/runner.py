"""What an agent serves: whoever carries out a run, our controller or a follower of an autopilot's own run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from stopgo.mission.document import Mission
from stopgo.mission.run.events import STOPS_LISTED, Pose, StateReport
from stopgo.mission.run.orders import Answer, Order
from stopgo.mission.run.states import Run, stop_of


@dataclass(frozen=True)
class Position:
    """Where a robot is and how fast (m/s), and when that was, on the run's clock."""

    pose: Pose
    speed: float
    ns: int


class Runner(Protocol):
    """Carries out a run, and says how far it is."""

    changed: Callable[[], None]
    """The agent's: called after every change that others may know of."""
    works: tuple[Callable[[], None], ...]
    """What it does, each in a thread of its own, until it is closed; a robot driven from here then stands."""

    @property
    def boot_id(self) -> str: ...

    def snapshot(self) -> tuple[Run, Mission | None]:
        """The run and its mission at one moment."""

    def position(self) -> Position | None:
        """Where the robot is; `None` if nothing was told of it since this was last asked."""

    def battery(self) -> float:
        """0 to 1."""

    def execute(self, order: Order) -> Answer:
        """Carry out an order once, however often it comes."""

    def on_link_silence(self, silent_s: float) -> None:
        """Told how long no station has been heard."""

    def close(self) -> None:
        """End all works."""


def state_report(runner: Runner, *, robot: str, seq: int, ns: int, newest: int) -> StateReport:
    """What a robot is doing; `newest`, the number of the newest event, is read before the run is.

    So a state never claims an event that it does not show yet.
    """
    run, mission = runner.snapshot()
    stop = stop_of(run, mission)
    return StateReport(
        robot=robot, boot_id=runner.boot_id, seq=seq, robot_ns=ns, state=run.state, run_id=run.run_id,
        mission_id=run.mission_id, revision=run.revision, stop=stop.id if stop else None,
        stop_state=run.stop_state if stop else None, done=run.done[-STOPS_LISTED:],
        skipped=run.skipped[-STOPS_LISTED:], done_count=len(run.done), skipped_count=len(run.skipped),
        outside=run.outside[-STOPS_LISTED:], outside_count=len(run.outside),
        battery=runner.battery(), last_event=newest, next_revision=run.next_revision,
    )  # fmt: skip
