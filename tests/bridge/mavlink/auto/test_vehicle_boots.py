"""Restarts of a vehicle, links that deliver late, and clocks that drift: distinguished by its clock."""

from __future__ import annotations

import pytest

from stopgo.bridge.mavlink.auto.vehicle_boots import VehicleBoots
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import memory_journal

SECOND = 10**9


class Listener:
    """A station's process that hears a vehicle; times are seconds since the vehicle's first boot."""

    def __init__(self, journal: Journal | None = None) -> None:
        self.journal = journal or memory_journal()
        self.boots = VehicleBoots(self.journal)

    def hear(self, at_s: float, up_s: float) -> str:
        return self.boots.take(round((1000 + at_s) * SECOND), round(up_s * 1000))

    def hear_all(self, *reports: tuple[float, float]) -> list[str]:
        return [self.hear(at_s, up_s) for at_s, up_s in reports]


def test_a_clock_that_goes_back_was_restarted() -> None:
    station = Listener()
    assert station.hear_all((60.0, 60.0), (61.0, 61.0)) == ["same", "same"]
    first = station.boots.boot_id
    assert station.hear(66.0, 2.0) == "restarted"
    assert station.boots.boot_id != first
    assert station.hear(67.0, 3.0) == "same"


def test_reports_that_overtake_each_other_are_no_restart() -> None:
    station = Listener()
    assert set(station.hear_all((60.0, 60.0), (60.1, 59.4), (60.2, 60.2), (60.3, 59.5))) == {"same"}


@pytest.mark.parametrize("up_s", [20.0, 600.0])
@pytest.mark.parametrize("stall_s", [6.0, 34.0, 120.0])
def test_a_link_that_holds_reports_back_is_no_restart(up_s: float, stall_s: float) -> None:
    """All of them arrive in one burst, the oldest first."""
    station = Listener()
    station.hear(up_s, up_s)
    burst = [(up_s + stall_s + index / 1e4, up_s + index / 10) for index in range(1, round(stall_s * 10))]
    told = station.hear_all(*burst)
    assert "restarted" not in told and told[-1] == "same"
    assert station.boots.late_s < 0.5
    assert station.hear(up_s + stall_s + 1, up_s + stall_s + 1) == "same"


def test_a_link_that_stays_late_is_no_restart_and_its_delay_is_known() -> None:
    station = Listener()
    told = station.hear_all(*((300.0 + t + min(t, 20.0), 300.0 + t) for t in range(60)))
    assert set(told) == {"same"}
    assert 19.0 < station.boots.late_s < 20.5


def test_a_clock_that_drifts_is_no_restart_and_no_delay() -> None:
    station = Listener()
    assert {station.hear(t, t * (1 - 5e-5)) for t in range(600, 400_000, 600)} == {"same"}
    assert station.boots.late_s < 1.0


def test_a_restart_during_a_long_silence_is_reported_once_the_next_reports_do_not_catch_up() -> None:
    """The vehicle is up for longer than it was before the silence."""
    station = Listener()
    station.hear(20.0, 20.0)
    told = station.hear_all(*((100.0 + t / 10, 40.0 + t / 10) for t in range(40)))
    assert told[0] == "in doubt" and told.count("restarted") == 1 and told[-1] == "same"
    assert station.boots.late_s < 0.5


def test_a_date_that_is_set_while_nobody_listens_is_no_restart_of_an_armed_vehicle() -> None:
    first = Listener()
    first.hear(60.0, 60.0)
    second = Listener(first.journal)
    told = [second.boots.take(round((4660.0 + t) * SECOND), 62_000 + t * 1000, armed=True) for t in range(5)]
    assert set(told) == {"same"} and second.boots.late_s < 0.5


def test_each_restart_is_reported_by_one_of_the_processes_that_listen() -> None:
    one = Listener()
    other = Listener(one.journal)
    for listener in (one, other):
        assert listener.hear(60.0, 60.0) == "same"
    times = ((66.0, 2.0), (66.1, 2.1))
    told = [listener.hear(at_s, up_s) for at_s, up_s in times for listener in (one, other)]
    assert told.count("restarted") == 1
    assert one.boots.boot_id == other.boots.boot_id


def test_a_restart_between_two_processes_is_reported_by_the_second() -> None:
    first = Listener()
    first.hear_all(*((t, t) for t in range(60, 100)))
    assert Listener(first.journal).hear(120.0, 15.0) == "restarted"
    again = Listener(first.journal)
    assert again.hear(121.0, 16.0) == "same"


def test_reports_that_come_a_little_sooner_each_are_not_stored_one_by_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station = Listener()
    station.hear(60.0, 60.0)
    stored: list[object] = []
    store_fact = station.journal.store_fact
    monkeypatch.setattr(station.journal, "store_fact", lambda *fact: (stored.append(fact), store_fact(*fact)))
    station.hear_all(*((60.0 + t / 10, 60.0 + t / 9) for t in range(90)))  # 1 s sooner at the end
    assert len(stored) == 0
    station.hear(69.5, 69.5 + 2.0)
    assert len(stored) == 1
