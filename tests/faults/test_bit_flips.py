"""A bit that flips anywhere in a robot's state folder is found before anything follows from it."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import pytest

from stopgo.bridge.robot.journal_file import open_journal
from stopgo.mission.errors import InputError
from tests.bridge.world import Field, corridor
from tests.faults.sizes import size

FLIPS = size(short=60, full=1000)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """State folders of a robot in the middle of its run: left in order, and as a power cut leaves it."""
    base = tmp_path_factory.mktemp("state")
    with open_journal(base / "closed", "r1") as journal:
        field = Field(journal=journal)
        field.station().push(corridor())
        field.order("start")
        field.work_until(lambda run: run.done == ("s1",))
        shutil.copytree(base / "closed", base / "cut")
    return {name: base / name for name in ("closed", "cut")}


def known(folder: Path) -> object:
    """All that a robot takes from its folder."""
    with open_journal(folder, "r1") as journal:
        field = Field(journal=journal)
        held = journal.missions.read(corridor().id, 1)
        run = field.controller.run
        return held, run.state, run.done, run.at, [type(event) for event in journal.events()]


@pytest.mark.parametrize("which", ["closed", "cut"])
def test_a_flipped_bit_is_harmless_or_named(folders: dict[str, Path], tmp_path: Path, which: str) -> None:
    chance = random.Random(11)
    shutil.copytree(folders[which], tmp_path / "whole")
    sound = known(tmp_path / "whole")
    files = sorted(path for path in folders[which].iterdir() if path.name != "reserve")
    sizes = [path.stat().st_size for path in files]
    named = 0
    for number in range(FLIPS):
        folder = tmp_path / f"{number}"
        shutil.copytree(folders[which], folder, ignore=shutil.ignore_patterns("reserve"))
        victim = folder / chance.choices(files, sizes)[0].name
        data = bytearray(victim.read_bytes())
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        victim.write_bytes(data)
        try:
            assert known(folder) == sound, victim
        except InputError as error:
            assert "\n" not in str(error)
            named += 1
        shutil.rmtree(folder)
    assert named > 0
