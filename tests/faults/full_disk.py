"""Fills a small disk under a robot's journal; run in a namespace where it may mount one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from bridge.robot.journal import open_journal
from tests.bridge.world import Field, corridor


def main(folder: Path) -> None:
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(folder)], check=False
    ).returncode:
        sys.exit("cannot mount")
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
        field.controller.hear_of_link(0.0)
        field.order("resume" if field.controller.run.state == "PAUSED" else "retry")
        field.work()
        print(field.controller.run.state)


def fill(ballast: Path) -> None:
    with ballast.open("ab", buffering=0) as file:
        try:
            while True:
                file.write(b"x" * 4096)
        except OSError:
            return


if __name__ == "__main__":
    main(Path(sys.argv[1]))
