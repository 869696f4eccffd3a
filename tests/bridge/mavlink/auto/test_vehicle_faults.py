"""Reboots, silence, stations that die, others who interfere: one story, and never the wrong stop."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.auto.logbook import remember
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.peer import reached as found_peer
from stopgo.bridge.station.follow import Silence
from stopgo.mission.document import Scan
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Arrived, Held, Paused, Resumed, Started
from tests.bridge.mavlink.auto.site import ALL, Site, real_tour, until, watched
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")


def by_hand(peer: Peer, mode: tuple[int, int]) -> None:
    """Somebody else changes the mode."""
    assert peer.command(dialect.MAV_CMD_DO_SET_MODE, 1, *mode).accepted


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_after_a_reboot_the_run_goes_on_at_the_stop_that_was_not_finished(
    profile: str, tmp_path: Path
) -> None:
    site = Site(tmp_path, profile)
    corner_of_s2 = next(
        site.sent.placed.index(placed) for placed in site.sent.placed if placed.role == "corner"
    )
    number = corner_of_s2 + (1 if profile == "ardupilot" else 0)
    site.faults = [f"reboot-mission@{number}"]
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: run.state == "PAUSED")
        assert site.run.done == ("S1",) and site.run.reason == "reboot"
        with pytest.raises(NegativeResult, match="not_armed"):
            site.order("resume", arm=False)
        assert site.order("resume").state == "RUNNING"
    words = told(site.events)
    assert [word for word in words if word.startswith("Scanned")] == [
        "Scanned S1",
        "Scanned S2",
        "Scanned S3",
    ]
    assert words[-1] == "Finished"
    assert len({event.boot_id for event in site.events}) == 2


def test_a_station_that_ends_is_followed_by_another_without_gap_or_repeat(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        with site.reached() as station:
            station.command("start")
            until(site, lambda events, run: "Arrived S2" in told(events))
        assert site.run.state == "RUNNING"
        with watched(site) as seen:
            pass
    events = [report for report in seen if hasattr(report, "number")]
    assert told(events) == told(site.events) and [event.number for event in events] == list(
        range(1, len(events) + 1)
    )
    assert [word for word in told(events) if "S2" not in word] == [word for word in ALL if "S2" not in word]
    assert told(events).count("Arrived S2") == 1


def test_a_stop_that_nobody_saw_is_not_said_to_be_scanned(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", mission=real_tour(), speed_up=20.0)
    with site.up():
        site.order("start")
        with found_peer(site.url, vehicle=1) as peer, peer.waiting("MISSION_CURRENT") as waiting:
            while waiting.get(30.0).mission_state != dialect.MISSION_STATE_COMPLETE:
                pass
        with watched(site):
            pass
    words = told(site.events)
    assert "Unconfirmed S2" in words and "Scanned S2" not in words
    assert words[-1] == "Finished"


def test_two_that_watch_report_every_event_once(tmp_path: Path) -> None:
    site = Site(tmp_path, "px4")
    with site.up(), watched(site) as one, watched(site) as other:
        site.order("start")
    assert told(site.events) == ALL
    for seen in (one, other):
        assert told([report for report in seen if hasattr(report, "number")]) == ALL


def test_a_mode_that_somebody_else_chooses_is_reported_as_theirs(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        by_hand(peer, (0, 0))
        until(site, lambda events, run: run.state == "PAUSED")
        assert "MANUAL" in site.run.reason and "not known who" in site.run.reason
        by_hand(peer, (10, 0))
    paused = [event for event in site.events if isinstance(event, Paused | Resumed)]
    assert told(paused) == ["Paused", "Resumed"]
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")


def test_a_mission_that_somebody_else_changes_holds_the_run(tmp_path: Path) -> None:
    from stopgo.bridge.mavlink.transfer.upload import upload

    site = Site(tmp_path, "ardupilot")
    short = translate(real_tour(), "ardupilot", trigger="none")
    with site.up():
        site.order("start")
        with site.reached():
            until(site, lambda events, run: "Scanned S1" in told(events))
            site.order("pause")
            with found_peer(site.url, vehicle=1) as peer:
                upload(peer, short)
            until(site, lambda events, run: run.state == "HELD")
        assert "somebody has changed" in site.run.reason
        with pytest.raises(NegativeResult, match="mission_differs"):
            site.order("retry")
        site.order("abort")
    assert any(isinstance(event, Held) for event in site.events)


def test_a_silent_vehicle_is_reported_as_silence_and_its_run_goes_on(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    silent, heard = threading.Event(), []

    def follow() -> None:
        with site.reached() as station:
            for report in station.reports():
                heard.append(report)
                if isinstance(report, Silence):
                    silent.set()

    thread = threading.Thread(target=follow, daemon=True)
    with site.up():
        site.order("start")
        thread.start()
        until(site, lambda events, run: "Scanned S1" in told(events))
    assert silent.wait(30.0)
    site.at = None
    with site.up():
        until(site, lambda events, run: run.state == "PAUSED")
        site.order("resume")
        thread.join(60.0)
    assert not thread.is_alive()
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_what_a_restart_took_from_the_vehicle_one_command_gives_again(profile: str, tmp_path: Path) -> None:
    """Its origin, its mode and its arming."""
    site = Site(tmp_path, profile)
    with site.up():
        site.order("start")
        with site.reached():
            until(site, lambda events, run: "Arrived S1" in told(events))
    site.at, site.origin = None, None
    with site.up(), watched(site):
        until(site, lambda events, run: run.state == "PAUSED")
        assert site.order("resume").state == "RUNNING"
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")


def test_a_link_that_delivers_late_is_neither_a_reboot_nor_an_operator(tmp_path: Path) -> None:
    mission = real_tour(scan=Scan(profile="default", duration_s=6.0, timeout_s=60.0))
    site = Site(tmp_path, "ardupilot", mission=mission, speed_up=1.0)
    with site.up(), Lossy(site.url.number, Roughness(), seed=1) as line:
        site.url = line.url
        with site.book() as book:
            remember(book, site.mission, site.sent)
        with watched(site):
            site.order("start")
            until(site, lambda events, run: "Arrived S1" in told(events))
            line.stall(34.0)
    words = told(site.events)
    assert words[0] == "Started" and words[-1] == "Finished"
    assert {word.split()[0] for word in words[1:-1]} <= {"Arrived", "Settled", "Unconfirmed", "Scanned"}
    assert len({event.boot_id for event in site.events}) == 1


def test_a_new_push_ends_the_run_that_it_replaces(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
        site.order("pause")
        with site.book() as book:
            remember(book, site.mission, site.sent)
    assert told(site.events)[-1] == "Aborted" and site.run.state == "READY"


def test_a_stop_is_measured_where_the_vehicle_stands(tmp_path: Path) -> None:
    """It drives exactly, so that it is known where that is."""
    site = Site(tmp_path, "px4", faults=["beside@6=0.03"], seed=None)
    with site.up(), watched(site):
        site.order("start")
    (arrived,) = [event for event in site.events if isinstance(event, Arrived) and event.stop == "S2"]
    assert arrived.deviation_m == pytest.approx(0.03, abs=0.012)


def test_a_command_whose_answer_was_lost_is_reported_as_its_commanders_once_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = Site(tmp_path, "ardupilot")
    obeyed = Peer.command

    def unheard(peer: Peer, number: int, *params: float, **details: Any) -> Any:
        ack = obeyed(peer, number, *params, **details)
        if number == dialect.MAV_CMD_DO_SET_MODE:
            raise OutcomeUnknown("the answer was lost")
        return ack

    with site.up():
        monkeypatch.setattr(Peer, "command", unheard)
        with pytest.raises(OutcomeUnknown):
            site.order("start")
        assert site.run.state == "READY"
        monkeypatch.undo()
        with watched(site):
            pass
    begun = [event for event in site.events if isinstance(event, Started)]
    assert [event.commander for event in begun] == ["test"]
    assert site.run.state == "FINISHED"


def test_a_journal_that_cannot_be_written_ends_the_watch_and_says_why(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), pytest.raises(InputError, match="disk full"), site.reached() as station:
        station.command("start")
        with site.book() as book:
            book.journal.rows.connection.execute("CREATE TRIGGER full BEFORE INSERT ON events BEGIN SELECT"
                                             " RAISE(FAIL, 'disk full'); END")  # fmt: skip
        for _ in station.reports():
            pass


def test_a_mission_of_as_many_items_is_seen_to_be_another_when_somebody_starts_it(tmp_path: Path) -> None:
    from stopgo.bridge.mavlink.transfer.upload import upload

    site = Site(tmp_path, "ardupilot")
    other = translate(real_tour(settle_s=3.5), "ardupilot")
    assert len(other.placed) == len(site.sent.placed)
    with site.up(), site.reached() as station, found_peer(site.url, vehicle=1) as peer:
        station.command("start")
        until(site, lambda events, run: "Arrived S1" in told(events))
        station.command("pause")
        upload(peer, other)
        by_hand(peer, (10, 0))
        until(site, lambda events, run: run.state == "HELD")
        assert "settle of S1" in site.run.reason
        while peer.in_auto:
            peer.ask(dialect.MAVLINK_MSG_ID_HEARTBEAT)
        station.command("abort")
