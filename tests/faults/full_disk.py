"""Fills a small disk under a robot's journal; run in a namespace where it may mount one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from stopgo.bridge.commands.spawn import robot_process
from stopgo.bridge.robot.journal_file import open_journal
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.document import Mission
from stopgo.mission.errors import NegativeResult
from tests.bridge.world import Field, corridor
from tests.waiting import wait_until

ROOM_BYTES = 1024 * 1024


def main(folder: Path, *, process: bool) -> None:
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(folder)], check=False
    ).returncode:
        sys.exit("cannot mount")
    (with_a_process if process else in_simulated_time)(folder)


def in_simulated_time(folder: Path) -> None:
    with open_journal(folder, "r1") as journal:
        field = Field(journal=journal)
        field.station().push(corridor())
        field.order("start")
        ballast = folder / "ballast"
        for _ in range(3):  # what was kept free for stops is let go, and filled by the others, too
            fill(ballast)
            field.order("pause")
            field.order("resume")
        # Orders are stored in ever new pages, so sooner or later there is no room.
        answers = [field.order("pause" if number % 2 else "resume") for number in range(2000)]
        refused = {answer.verb for answer in answers if answer.reason == "storage"}
        print(*sorted(refused), field.base.speed())
        ballast.unlink()
        field.controller.on_link_silence(0.0)
        field.order("resume" if field.controller.run.state == "PAUSED" else "retry")
        field.work()
        print(field.controller.run.state)


def with_a_process(folder: Path) -> None:
    """A robot that drives while its disk is filled is paused and aborted, and reports it later."""
    ballast = folder / "ballast"
    with (
        robot_process("r1", folder / "state") as endpoint,
        connect(endpoint, robot="r1", timeout_s=30.0) as station,
    ):
        station.push(an_hours_drive())
        station.command("start")
        wait_until(lambda: station.status().stop_state == "NAVIGATING")
        paused = station.command("pause")
        while "cannot be written" not in paused.message:
            go_on(station, ballast)
            fill(ballast)
            paused = station.command("pause")
        print(paused.outcome, station.status().state)
        print(station.command("abort").outcome, station.status().state)
        newest = station.status().last_event
        ballast.unlink()
        wait_until(lambda: station.status().last_event > newest)
        print(*[type(event).__name__ for event in station.log(since=newest)])


def an_hours_drive() -> Mission:
    """Only orders are stored on the way: a robot that arrives and cannot store that is held, not paused."""
    return corridor(stops=1, closed=False, x=1800.0, approach=((0.0, 0.0), (1800.0, 0.0)))


def go_on(station: Station, ballast: Path) -> None:
    """Let the paused robot drive, and store that it does; held for want of room, it is given a little."""

    def drives() -> bool:
        status = station.status()
        if status.state == "HELD":
            os.truncate(ballast, max(0, ballast.stat().st_size - ROOM_BYTES))
            station.command("retry")
        return (status.state, status.stop_state) == ("RUNNING", "NAVIGATING")

    try:
        station.command("resume")
    except NegativeResult as no:
        assert no.reason == "storage"
    wait_until(drives)


def fill(ballast: Path) -> None:
    with ballast.open("ab", buffering=0) as file:
        try:
            while True:
                file.write(b"x" * 4096)
        except OSError:
            return


if __name__ == "__main__":
    main(Path(sys.argv[1]), process=sys.argv[2] == "process")
