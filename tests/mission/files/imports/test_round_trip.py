"""Exported missions come back: ids, positions within a step of 1e-7 degrees, waits; noise does not."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stopgo.mission.document import Mission, Stop, with_digest
from stopgo.mission.document.problems import problems_of
from stopgo.mission.errors import InputError
from stopgo.mission.files.exports import exported
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.imports import READERS, read_mission
from stopgo.mission.files.imports.assembling import mission_of
from stopgo.mission.files.imports.track import ImportOptions
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.settings import Settings
from tests.mission.files.exports.worlds import laboratory
from tests.mission.worlds import mission_of as mission_over
from tests.mission.worlds import stop

metres = st.integers(-300_000, 300_000).map(lambda millimetres: millimetres / 1000)
points = st.tuples(metres, metres)
seconds = st.integers(1, 3_600_000).map(lambda milliseconds: milliseconds / 1000)
headings = st.integers(-3_141_592, 3_141_592).map(lambda micro: micro / 1e6)
origins = st.builds(
    SiteOrigin,
    lat=st.floats(1e-3, 65),
    lon=st.floats(-180, 180),
    alt=st.floats(-100, 4000),
    heading_deg=st.floats(-180, 360),
)


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """A mission of one to five stops, each past up to three corners, all places apart."""
    turns = draw(st.lists(st.integers(0, 3), min_size=1, max_size=5))
    places = draw(st.lists(points, min_size=sum(turns) + len(turns) + 1, unique=True))
    at, stops = 0, list[Stop]()
    for number, corners in enumerate(turns, 1):
        leg = tuple(places[at : at + corners + 2])
        made = stop(f"s{number:02}", *leg, heading=draw(headings))
        scan = msgspec.structs.replace(made.scan, duration_s=draw(seconds), timeout_s=4000.0)
        stops.append(msgspec.structs.replace(made, settle_s=draw(seconds), scan=scan))
        at += corners + 1
    mission = mission_over(
        *stops, begin=places[0], back=draw(st.sampled_from([None, (places[at], places[0])]))
    )
    return with_digest(msgspec.structs.replace(mission, georeference=draw(origins)))


def there_and_back(mission: Mission, name: str, autopilot: str, settings: Settings | None = None) -> Mission:
    data = exported(mission, name, Supplements(autopilot=autopilot))
    assert mission.georeference is not None
    track = READERS[name](data, f"site.{name}", ImportOptions(mission.georeference, autopilot))
    return mission_of(track, settings or Settings(), name="site", file=f"site.{name}", digest="0" * 64)


@pytest.mark.parametrize("name", ["plan", "waypoints"])
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@given(mission=missions())
def test_stops_come_back_through_an_autopilots_file(name: str, autopilot: str, mission: Mission) -> None:
    back = there_and_back(mission, name, autopilot)
    assert problems_of(back) == ()
    assert [one.id for one in back.stops] == [one.id for one in mission.stops]
    for one, other in zip(back.stops, mission.stops, strict=True):
        assert math.dist((one.x, one.y), (other.x, other.y)) <= 0.008
        assert one.settle_s == pytest.approx(other.settle_s, abs=1e-6)
        assert one.scan.duration_s == pytest.approx(other.scan.duration_s, abs=1e-6)
        if autopilot != "ardupilot":
            turn = math.remainder(one.heading - other.heading, math.tau)
            assert abs(turn) <= math.radians(0.006)
            assert one.tolerance_m == other.tolerance_m
    assert (back.return_ is None) == (mission.return_ is None)
    assert back.robot.speed == mission.robot.speed


@given(mission=missions())
def test_a_table_brings_every_leg_back(mission: Mission) -> None:
    back = there_and_back(mission, "csv", "ardupilot")
    assert problems_of(back) == ()
    for one, other in zip(back.stops, mission.stops, strict=True):
        assert (one.id, one.approach, one.scan, one.settle_s) == (
            other.id, other.approach, other.scan, other.settle_s,
        )  # fmt: skip
        assert one.heading == pytest.approx(other.heading, abs=1e-6)


def test_a_leg_comes_back_within_what_corners_may_be_cut() -> None:
    back = there_and_back(laboratory(), "plan", "ardupilot", Settings(start=(1.0, 1.0, 0.0)))
    for one, other in zip(back.stops, laboratory().stops, strict=True):
        legs = [
            leg
            for number, leg in enumerate(other.approach)
            if number == 0 or leg != other.approach[number - 1]
        ]
        assert len(one.approach) == len(legs)
        assert all(math.dist(a, b) <= 0.008 for a, b in zip(one.approach, legs, strict=True))


def seeds() -> dict[str, bytes]:
    return {name: exported(laboratory(), name, Supplements()) for name in READERS}


SEEDS = seeds()


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused_in_one_line(name: str, data: st.DataObject) -> None:
    seed = SEEDS[name]
    begin = data.draw(st.integers(0, len(seed)))
    end = data.draw(st.integers(begin, min(len(seed), begin + 40)))
    noise = data.draw(st.one_of(st.binary(max_size=12), st.sampled_from(NOISE)))
    damaged = seed[:begin] + noise + seed[end:]
    try:
        track = READERS[name](damaged, "file", ImportOptions())
        mission = mission_of(track, Settings(), name="site", file="file", digest="0" * 64)
    except InputError as error:
        assert "\n" not in str(error)
        assert str(error).startswith("file: ")
    else:
        assert problems_of(mission) == ()


NOISE = [
    b"1e400",
    b"-1",
    b"null",
    b"NaN",
    b"true",
    b"{}",
    b"[]",
    b'"',
    b"9" * 400,
    b"\xc3\x28",
    b"\t",
    b"\r\n",
    b"\0",
]


@pytest.mark.parametrize("name", READERS)
@given(data=st.binary(max_size=200))
def test_noise_is_refused_in_one_line(name: str, data: bytes) -> None:
    with pytest.raises(InputError) as refusal:
        READERS[name](data, "file", ImportOptions())
    assert "\n" not in str(refusal.value)


def test_two_stops_of_one_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "stops.csv").write_text("id,x_m,y_m\na,1,2\na,3,4\n")
    with pytest.raises(InputError, match=r"is implausible: \$.stops\[1\].id: is 'a', already used by"):
        read_mission(tmp_path / "stops.csv", Settings())
