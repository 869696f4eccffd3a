"""A station that the fake robot puts through its paces, in the test's own time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stopgo.bridge.conform.fake_robot import FakeRobot, FaultyLink, ForgedAnswers, at_work
from stopgo.bridge.conform.requirements import ConformVerdict, tried
from stopgo.bridge.conform.station_bench import StationBench
from stopgo.bridge.conform.station_requirements import STATION_REQUIREMENTS
from stopgo.bridge.link.keys import HeldKeys, now_utc, read_keys
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.signatures import NO_SIGNING, KeySigning
from stopgo.bridge.station.station import Station
from stopgo.bridge.station.watch import EventLines, watch_with
from stopgo.mission.document import Mission
from stopgo.mission.errors import StopgoError

KEYS = KeyExpressions("r1")


class StationUnderTest:
    """Our own station, which acts as by a command; subclasses are broken on purpose."""

    station: type[Station] = Station

    def __init__(self, site: Path | None = None) -> None:
        self.site = site
        self.board = Switchboard()

    def held(self, name: str) -> HeldKeys | None:
        return None if self.site is None else read_keys(self.site / name, now=now_utc())

    def link(self) -> Link:
        held = self.held("alice")
        return self.board.link(NO_SIGNING if held is None else KeySigning(held))

    def does(self, what: str, mission: Mission | None) -> int:
        station = self.station(
            self.link(), KEYS, commander="alice", timeout_s=4.0, patience_s=6.0, held=self.held("alice")
        )
        try:
            self.acts(station, what, mission)
        except StopgoError as error:
            return error.exit_code
        return 0

    def acts(self, station: Station, what: str, mission: Mission | None) -> None:
        if what == "push":
            assert mission is not None
            station.push(mission)
        elif what == "watch":
            watch_with(station, None, EventLines(lambda line: None))
        elif what == "status":
            station.status()
        else:
            station.command(what)  # type: ignore[arg-type]

    @contextmanager
    def bench(self) -> Iterator[StationBench]:
        held, boot_id = self.held("r1"), "b1"
        forged = None if held is None else ForgedAnswers(KeySigning(held, boot_id=boot_id))
        link = FaultyLink(self.board.link(forged or NO_SIGNING), KEYS)
        with at_work(FakeRobot(link, KEYS, boot_id, speed_up=10.0)) as robot:
            yield StationBench(robot, self.does, forged=forged)


def verdicts(station: StationUnderTest, *only: str) -> dict[str, ConformVerdict]:
    """Verdicts of the kit on a station, by requirement."""
    wanted = [one for one in STATION_REQUIREMENTS if not only or one.text in only or one.section in only]
    assert wanted
    with station.bench() as bench:
        return {verdict.text: verdict for verdict in tried(wanted, bench)}
