"""The follower's first look, with a vehicle of a few messages."""

from __future__ import annotations

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.mavlink.auto.auto_follower import AutoFollower
from stopgo.bridge.mavlink.auto.logbook import Logbook, remember
from stopgo.bridge.mavlink.vehicle_link.foreign_commands import ForeignCommands
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.wire import GROUND_STATION, Who
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Paused
from stopgo.mission.run.states import Change, changed, started
from tests.mission.mavlink.following.worlds import tour

MANUAL, AUTO = 0, 10


class NoHands:
    """This vehicle gets no message."""

    def ask_for_picture(self) -> None: ...

    def ask_for_telemetry(self) -> None: ...


class NobodyElse:
    """A line on which no other station commands."""

    autopilot = ARDUPILOT
    foreign = ForeignCommands(Who(1, 1), GROUND_STATION, ARDUPILOT)

    @property
    def heartbeat(self) -> Message:
        return found_in_manual(0)[0]


def told_at_first_look(boot_ms: int) -> list[str]:
    """Reasons of the pauses of a run that is found in MANUAL, a minute after it was started."""
    clock, mission = SimulatedClock(), tour()
    book = Logbook(memory_journal(), "mavlink-1", clock)
    remember(book, mission, translate(mission, "ardupilot"))
    book.boots.take(clock.now_ns(), 30_000)
    book.move(lambda run: (started(run, run_id="r", now_ns=clock.now_ns(), by="me"),))
    clock.wait(60.0)
    observer = Observer(ARDUPILOT)
    follower = AutoFollower(book, NobodyElse(), observer, NoHands())  # type: ignore[arg-type]
    for message in found_in_manual(boot_ms):
        clock.wait(0.1)
        follower.look(observer.take(message, book.listed, clock.now_ns()))
    follower.begin()
    follower.look("SYSTEM_TIME")
    return [event.reason for event in book.journal.events() if isinstance(event, Paused)]


def found_in_manual(boot_ms: int) -> tuple[Message, ...]:
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED | dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return (
        dialect.MAVLink_heartbeat_message(10, 3, armed, MANUAL, 4, 3),
        dialect.MAVLink_mission_current_message(0, 14, dialect.MISSION_STATE_NOT_STARTED, 1),
        dialect.MAVLink_system_time_message(0, boot_ms),
    )


def stop_state_after(boot_ms: int) -> str:
    """The state at the first stop, where another station has the run at 60 s of the vehicle's time.

    The vehicle reports at `boot_ms` that it is on its way to the stop.
    """
    clock, mission = SimulatedClock(), tour()
    book = Logbook(memory_journal(), "mavlink-1", clock)
    remember(book, mission, translate(mission, "ardupilot"))
    book.boots.take(clock.now_ns(), 60_000)
    book.move(lambda run: (started(run, run_id="r", now_ns=clock.now_ns(), by="me"),))
    book.move(lambda run: (Change(changed(run, state="RUNNING", stop_state="SETTLING")),))
    observer = Observer(ARDUPILOT)
    follower = AutoFollower(book, NobodyElse(), observer, NoHands())  # type: ignore[arg-type]
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED | dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    assert book.listed is not None
    for message in (
        dialect.MAVLink_heartbeat_message(10, 3, armed, AUTO, 4, 3),
        dialect.MAVLink_system_time_message(0, boot_ms),
        dialect.MAVLink_mission_current_message(book.listed.stops[0].at, 14, dialect.MISSION_STATE_ACTIVE, 1),
    ):
        follower.look(observer.take(message, book.listed, clock.now_ns()))
    follower.begin()
    follower.look("MISSION_CURRENT")
    return book.run.stop_state


def test_a_report_older_than_the_arrival_that_another_station_saw_brings_no_run_back() -> None:
    assert stop_state_after(59_000) == "SETTLING"
    assert stop_state_after(60_100) == "NAVIGATING"


def test_a_reboot_is_reported_before_the_mode_that_it_brought_about() -> None:
    assert told_at_first_look(boot_ms=3_000) == ["reboot"]


def test_a_mode_that_somebody_chose_is_reported_as_theirs() -> None:
    assert told_at_first_look(boot_ms=90_300) == ["mode MANUAL, by somebody (not known who)"]
