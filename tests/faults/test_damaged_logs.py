"""Logs damaged at many places: every format is read or refused in one line, and no verdict turns for it."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from stopgo.mission.errors import InputError, Undecided
from stopgo.recordings.logs import listing, read_log
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replaying import replay
from tests.faults.sizes import FULL, some
from tests.recordings.replay.driving import Odd, driven, logged, wandering
from tests.recordings.truth import formats
from tests.recordings.truth.disturbances import Sensed
from tests.recordings.truth.formats import Writer

LOGS = Path(__file__).parents[3] / "shared" / "data" / "logs"
REAL = (
    "turtlebot3.bag", "rosbag2-pose/rosbag2_test_0.db3", "rosbag2-split-mcap/wbag_0.mcap", "crawler.tlog",
    "rover-stop-and-go.BIN", "px4.ulg",
)  # fmt: skip
PLACES = 56
WHOLE: tuple[Writer, ...] = (
    formats.csv_table, formats.tum, formats.kitti, *formats.BAGS, *formats.VEHICLES
)  # fmt: skip
MISSION = wandering(1)
Damage = Callable[[bytearray, random.Random], None]


def flip(data: bytearray, chance: random.Random) -> None:
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def flip_many(data: bytearray, chance: random.Random) -> None:
    for _ in range(50):
        flip(data, chance)


def flip_in_head(data: bytearray, chance: random.Random) -> None:
    data[chance.randrange(min(len(data), 4000))] ^= 1 << chance.randrange(8)


def flip_in_tail(data: bytearray, chance: random.Random) -> None:
    data[-1 - chance.randrange(min(len(data), 4000))] ^= 1 << chance.randrange(8)


def truncate(data: bytearray, chance: random.Random) -> None:
    del data[chance.randrange(1, len(data)) :]


def cut_out(data: bytearray, chance: random.Random) -> None:
    at = chance.randrange(len(data))
    del data[at : at + chance.randrange(1, 5000)]


def overwrite(data: bytearray, chance: random.Random) -> None:
    at = chance.randrange(len(data))
    count = min(len(data) - at, chance.randrange(1, 5000))
    data[at : at + count] = chance.randbytes(count)


def clear(data: bytearray, chance: random.Random) -> None:
    at = chance.randrange(len(data))
    count = min(len(data) - at, chance.randrange(1, 5000))
    data[at : at + count] = bytes(count)


DAMAGES: tuple[Damage, ...] = (
    flip, flip_many, flip_in_head, flip_in_tail, truncate, cut_out, overwrite, clear
)  # fmt: skip


def numbers_for(case: int) -> range:
    """Numbers of the damages of a case: in the short form every fourth kind, by turns."""
    return range(PLACES) if FULL else range(case % 4, len(DAMAGES), 4)


def damaged(path: Path, target: Path, number: int) -> Path:
    data, chance = bytearray(path.read_bytes()), random.Random(f"{path.name} {number}")
    DAMAGES[number % len(DAMAGES)](data, chance)
    target.write_bytes(data)
    return target


@pytest.mark.filterwarnings("ignore")
@pytest.mark.skipif(not LOGS.is_dir(), reason="../shared/data/logs is not here")
@pytest.mark.parametrize("name", REAL)
def test_a_damaged_log_is_read_or_refused_in_one_line(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / Path(name).name
    found: Counter[str] = Counter()
    for number in numbers_for(REAL.index(name)):
        damaged(LOGS / name, path, number)
        try:
            log = read_log(path)
            listing.as_text(log)
            listing.as_json(log)
            sum(len(sweep.xyz) for sweep in log.sweeps())
            found["read"] += 1
        except InputError as error:
            assert str(path) in str(error)
            assert "\n" not in str(error)
            assert len(str(error)) < 600
            found["refused"] += 1
    assert found["read"] > found["refused"]
    assert capsys.readouterr().out == ""


def written(folder: Path, writer: Writer, odd: Odd) -> Path:
    """A log of a drive in one format, of which every byte is known."""
    track = logged(driven(MISSION, odd))
    nothing = np.zeros(len(track))
    poses = Sensed((track.ns - track.ns[0]) / 1e9, track.ns, track.xy, track.heading, nothing, nothing)
    return writer(folder, MISSION, poses)


def answer(path: Path, writer: Writer) -> str:
    """Verdict on the drive; `refused` if there is none."""
    placing = Placing() if writer in formats.VEHICLES else Placing(align="first")
    try:
        return drive_verdict(replay(read_log(path), MISSION, placing)).answer
    except (InputError, Undecided) as error:
        assert "\n" not in str(error)
        return "refused"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("writer", some(WHOLE, every=2), ids=lambda writer: writer.__name__)
@pytest.mark.parametrize("odd, whole, never", [(Odd(), "yes", "no"), (Odd(frozenset({4})), "no", "yes")])
def test_damage_turns_no_verdict(tmp_path: Path, writer: Writer, odd: Odd, whole: str, never: str) -> None:
    path = written(tmp_path, writer, odd)
    assert answer(path, writer) == whole
    (tmp_path / "damaged").mkdir()
    if (tmp_path / "times.txt").exists():
        (tmp_path / "damaged" / "times.txt").write_bytes((tmp_path / "times.txt").read_bytes())
    target = tmp_path / "damaged" / path.name
    numbers = numbers_for(WHOLE.index(writer) + (whole == "no"))
    found = [(number, answer(damaged(path, target, number), writer)) for number in numbers]
    assert [number for number, told in found if told == never] == []
