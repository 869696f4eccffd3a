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
        fill(ballast)
        # Orders are stored in ever new pages, so sooner or later there is no room.
        refused = [field.order("pause" if number % 2 else "resume").reason for number in range(2000)]
        print(field.controller.run.state)
        print("storage" if "storage" in refused else "stored")
        ballast.unlink()
        field.order("retry")
        field.work()
        print(field.controller.run.state)


def fill(ballast: Path) -> None:
    with ballast.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(b"x" * 4096)
        except OSError:
            return


if __name__ == "__main__":
    main(Path(sys.argv[1]))
