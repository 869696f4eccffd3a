"""A mission pushed again: a run goes on whose vehicle has lost its list, and a changed mission is stored."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import pytest
from msgspec.structs import replace

from stopgo.bridge.mavlink.auto import mission_push
from stopgo.bridge.mavlink.auto.logbook import logbook, remember
from stopgo.bridge.mavlink.auto.mission_push import PushConsent, check_pushable, send_and_remember
from stopgo.bridge.mavlink.transfer.upload import NOTHING_SENT, Uploaded, clear
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.errors import NegativeResult, RobotUnreachable
from stopgo.mission.mavlink.translate import translate
from tests.bridge.mavlink.auto.site import KINDS, Site, real_tour, until
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")


def pushed(site: Site, mission: Mission, *, while_running: bool = False) -> Uploaded:
    """Push as `stopgo push --mavlink` does."""
    sent, state = translate(mission, KINDS[site.profile]), site.folder / "station"
    consent = PushConsent(while_running=while_running)
    with reached(site.url, vehicle=1) as peer:
        check_pushable(site.url, peer, mission, sent, consent, state=state, report=lambda line: None)
        return send_and_remember(site.url, peer, mission, sent, state=state, while_running=while_running)


@contextmanager
def paused_after_a_scan(site: Site) -> Iterator[None]:
    """The vehicle is on, and its run is paused with one stop done."""
    with site.up():
        with site.reached() as station:
            station.command("start")
            until(site, lambda events, run: "Scanned S1" in told(events))
            station.command("pause")
        yield


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_run_goes_on_after_its_vehicle_lost_the_list_and_got_it_again(profile: str, tmp_path: Path) -> None:
    """It was refused as the end of the run, and with consent it ended it: all stops were to scan again."""
    site = Site(tmp_path, profile)
    with paused_after_a_scan(site):
        with reached(site.url, vehicle=1) as peer:
            clear(peer)
        with site.reached() as station:
            until(site, lambda events, run: run.state == "HELD")
            assert (
                "the vehicle has lost its mission in a restart, or somebody has cleared it" in site.run.reason
            )
            assert "push it again (stopgo push), then retry" in site.run.reason
            assert not pushed(site, site.mission).already
            assert (site.run.state, site.run.done) == ("HELD", ("S1",))
            assert station.command("retry").state == "RUNNING"
            until(site, lambda events, run: run.over)
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")
    assert told(site.events).count("Scanned S1") == 1


def test_a_run_keeps_the_list_that_its_vehicle_holds(tmp_path: Path) -> None:
    """NaN in the items of PX4 made the same list another one, and the run was over."""
    site = Site(tmp_path, "px4")
    with paused_after_a_scan(site):
        with pytest.raises(NegativeResult, match="a push would end it"):
            pushed(site, site.mission)
        assert pushed(site, site.mission, while_running=True).already
    assert (site.run.state, site.run.done) == ("PAUSED", ("S1",))


@pytest.mark.parametrize("end", [KeyboardInterrupt, RobotUnreachable])
def test_a_push_that_ends_while_it_reads_the_vehicle_has_changed_nothing(
    end: type[BaseException], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C ended it without a line on what was sent."""

    def ended(peer: Peer) -> NoReturn:
        raise end("no data")

    site, said = Site(tmp_path, "ardupilot"), list[str]()
    sent = translate(site.mission, KINDS[site.profile])
    monkeypatch.setattr(mission_push, "download", ended)
    with paused_after_a_scan(site), reached(site.url, vehicle=1) as peer, pytest.raises(end):
        check_pushable(
            site.url,
            peer,
            site.mission,
            sent,
            PushConsent(),
            state=site.folder / "station",
            report=said.append,
        )
    assert said == ([NOTHING_SENT] if end is KeyboardInterrupt else [])
    assert (site.run.state, site.run.done) == ("PAUSED", ("S1",))


def test_another_mission_is_not_taken_for_the_lost_one(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    other = with_digest(replace(site.mission, revision=2))
    with paused_after_a_scan(site):
        with reached(site.url, vehicle=1) as peer:
            clear(peer)
        with pytest.raises(NegativeResult, match="a push would end it"):
            pushed(site, other)


def test_a_revision_with_the_same_items_is_stored(tmp_path: Path) -> None:
    """ArduPilot keeps no tolerance: it held these items already, and the station kept the old mission."""
    site = Site(tmp_path, "ardupilot")
    wider = tuple(replace(stop, tolerance_m=0.4, retries=3) for stop in site.mission.stops)
    revised = with_digest(replace(site.mission, stops=wider, revision=2))
    with site.up():
        assert pushed(site, revised).already
    with site.book() as book:
        assert book.listed is not None and book.listed.mission == revised
        assert book.run.revision == 2


def test_a_record_of_an_earlier_version_is_known_by_its_stored_mission(tmp_path: Path) -> None:
    mission = real_tour()
    sent = translate(mission, "px4")
    with logbook(Url("udpout", "127.0.0.1", 14550), 1, tmp_path) as book:
        assert not book.was_sent(mission, sent)
        remember(book, mission, sent)
        record = book.journal.fact("sent", dict[str, object])
        assert record is not None and record.pop("digest") == mission.digest
        book.journal.store_fact("sent", record)
        assert book.was_sent(mission, sent)
        assert not book.was_sent(with_digest(replace(mission, name="other")), sent)
        assert not book.was_sent(mission, translate(mission, "ardupilot"))
