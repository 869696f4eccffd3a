"""A robot that is moved while it scans: the scan does not count, whatever base and scanner report."""

from __future__ import annotations

from threading import Event

import msgspec

from stopgo.bridge.robot.scan_standstill import ScanStandstill
from stopgo.mission.document import Scan
from stopgo.mission.run.events import Failed, Pose, Scanned
from stopgo.mission.run.scans import ScanFailed, ScanResult
from tests.bridge.robot.test_run import loaded
from tests.bridge.world import Field, corridor


def push(field: Field, *, x: float = 0.0, heading: float = 0.0) -> None:
    here = field.base.pose()
    field.base.stand_at(msgspec.structs.replace(here, x=here.x + x, heading=here.heading + heading))


def moved_in_first_scan(field: Field, **by: float) -> list[object]:
    """The events of a run whose robot somebody moves in the middle of its first scan."""
    field.order("start")
    field.work_until(lambda run: run.stop_state == "SCANNING")
    field.clock.at(30.0, lambda: push(field, **by))
    field.work()
    return list(field.journal.events())


def test_a_scan_during_which_the_robot_was_pushed_is_made_again() -> None:
    field = loaded(corridor(retries=1))
    events = moved_in_first_scan(field, x=0.3)
    assert [event.stop for event in events if isinstance(event, Scanned)] == ["s1", "s2", "s3"]
    assert field.controller.run.scans == 4


def test_without_tries_left_the_stop_has_failed_with_the_reason() -> None:
    field = loaded(corridor(retries=0, on_failure="skip"))
    events = moved_in_first_scan(field, heading=0.2)
    (failed,) = [event for event in events if isinstance(event, Failed)]
    assert failed.stop == "s1" and "turned 11° during the scan" in failed.reason
    assert field.controller.run.done == ("s2", "s3") and field.controller.run.skipped == ("s1",)


def test_motion_that_is_over_at_the_end_of_the_scan_is_seen_by_the_reported_poses() -> None:
    field = loaded()

    def there_and_back() -> None:
        push(field, x=0.3)
        field.controller.position()
        push(field, x=-0.3)

    field.order("start")
    field.work_until(lambda run: run.stop_state == "SCANNING")
    field.clock.at(30.0, there_and_back)
    field.work()
    assert field.controller.run.scans == 4 and field.controller.run.done == ("s1", "s2", "s3")


def test_a_steady_robot_is_not_disturbed_by_its_estimates_noise() -> None:
    field = Field()
    standstill = ScanStandstill(field.base)
    with standstill.watching(0.05):
        for index in range(100):
            standstill.take(Pose(x=0.004 * (-1) ** index, y=0.0, heading=0.01), 0.02)
        standstill.take(Pose(x=0.0, y=0.0, heading=0.0), 0.5)
    assert standstill.why == ""


def test_a_file_that_has_counted_for_a_stop_counts_for_no_other() -> None:
    """As of a scanner that names its last file again after a restart."""
    field = loaded(corridor(retries=0, on_failure="skip"))
    first = field.scanner.scan
    named: list[ScanResult] = []

    def same(label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        result = first(label, scan, interrupt=interrupt)
        assert isinstance(result, ScanResult)
        named.append(result)
        return named[0] if len(named) < 3 else result

    field.scanner.scan = same  # type: ignore[method-assign]
    field.order("start")
    field.work()
    (failed,) = [event for event in field.journal.events() if isinstance(event, Failed)]
    assert failed.stop == "s2" and "again, which is the scan of s1" in failed.reason
    assert field.controller.run.done == ("s1", "s3")
