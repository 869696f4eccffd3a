"""A new revision that is pushed during a run: followed from the next stop on, or refused with the reason."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from stopgo.mission.document import Mission, Scan, with_digest
from stopgo.mission.errors import NegativeResult
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import RevisionTaken, Scanned
from tests.bridge.world import Field, corridor
from tests.faults.test_crashes import Mains, PowerCut

LONGER = corridor(stops=4, revision=2)
TURNED = msgspec.structs.replace(corridor().frame, to_map=Transform(x=1.0, y=0.0, heading=0.0))
QUICK = Scan(profile="quick", duration_s=5.0, timeout_s=60.0)


def running(**details: Any) -> Field:
    """A field whose robot has been started, and has not yet left."""
    field = Field(**details)
    field.station().push(corridor())
    field.order("start")
    return field


def changed(**details: Any) -> Mission:
    return with_digest(msgspec.structs.replace(corridor(revision=2), **details))


def test_a_revision_is_followed_from_the_next_stop_on() -> None:
    field = running()
    field.controller.step()  # on the way to s1
    station = field.station()
    assert station.push(LONGER).waits
    assert (station.status().revision, station.status().next_revision) == (1, 2)
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3", "s4")
    told = field.told()
    assert told[:6] == ["Started", "RevisionWaits", "Arrived s1", "Settled s1", "Scanned s1", "RevisionTaken"]
    assert told[-1] == "Finished"
    assert [event.revision for event in field.journal.events() if isinstance(event, Scanned)] == [1, 2, 2, 2]
    assert (station.status().revision, station.status().next_revision) == (2, None)


def test_the_stop_that_is_worked_on_is_finished_as_the_old_revision_says() -> None:
    field = running()
    field.station().push(corridor(revision=2, scan=QUICK))
    field.work()
    scans = [event.mission_time_s for event in field.journal.events() if isinstance(event, Scanned)]
    assert scans == pytest.approx([67.0, 67.0 + 12.0, 67.0 + 24.0])  # 5 s of way, 2 s to settle, 60 s or 5 s


def test_a_revision_pushed_while_a_scan_is_in_progress_does_not_disturb_it() -> None:
    field = running()
    field.clock.at(30.0, lambda: field.station().push(LONGER))
    field.work()
    assert field.told().count("Settled s1") == field.told().count("Scanned s1") == 1
    assert field.controller.run.done == ("s1", "s2", "s3", "s4")


def test_a_revision_may_end_the_run_at_the_stop_that_is_worked_on() -> None:
    field = running()
    field.station().push(corridor(stops=1, revision=2))
    field.work()
    assert field.controller.run.done == ("s1",)
    assert field.controller.run.state == "FINISHED"
    assert field.base.pose().x == pytest.approx(0.0, abs=1e-6)


def test_a_revision_may_lengthen_a_run_that_is_at_its_last_stop() -> None:
    field = Field()
    field.station().push(corridor(stops=1))
    field.order("start")
    field.station().push(corridor(stops=2, revision=2))
    field.work()
    assert field.controller.run.done == ("s1", "s2")


def test_a_skip_takes_the_waiting_revision_at_once() -> None:
    field = running()
    field.controller.step()
    field.station().push(LONGER)
    assert field.order("skip", stop="s1").outcome == "ok"
    assert field.controller.run.revision == 2
    field.work()
    assert (field.controller.run.skipped, field.controller.run.done) == (("s1",), ("s2", "s3", "s4"))


def test_a_newer_revision_replaces_the_one_that_waits() -> None:
    field = running()
    field.station().push(LONGER)
    field.station().push(corridor(stops=2, revision=3))
    field.work()
    assert [event.revision for event in field.journal.events() if isinstance(event, RevisionTaken)] == [3]
    assert field.controller.run.done == ("s1", "s2")


def moved(index: int, **details: Any) -> Mission:
    stops = list(corridor().stops)
    stops[index] = msgspec.structs.replace(stops[index], **details)
    return changed(stops=tuple(stops))


@pytest.mark.parametrize(
    ("revision", "why"),
    [
        (moved(0, x=2.0005), "stop s1 or the leg to it differs"),
        (moved(0, id="t1"), "stop s1 or the leg to it differs"),
        (moved(0, approach=((0.0, 0.0), (1.0, 0.5), (2.0, 0.0))), "stop s1 or the leg to it differs"),
        (changed(frame=TURNED), "frame"),
    ],
)  # fmt: skip
def test_a_revision_that_changes_the_path_so_far_is_refused(revision: Mission, why: str) -> None:
    field = running()
    with pytest.raises(NegativeResult, match=f"way_differs: revision 2: .*{why}"):
        field.station().push(revision)
    assert field.controller.run.next_revision is None
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


def test_a_robot_may_refuse_every_revision_during_a_run() -> None:
    field = running(revisions="refuse")
    with pytest.raises(NegativeResult, match=r"running: .* takes no revision"):
        field.station().push(LONGER)
    field.work()
    assert not field.station().push(LONGER).waits
    assert field.controller.run.state == "READY"


def test_a_robot_on_its_return_home_takes_no_revision() -> None:
    field = running()
    field.controller.step()
    field.order("home")
    with pytest.raises(NegativeResult, match="drives home"):
        field.station().push(LONGER)


def test_a_run_that_is_aborted_lets_the_waiting_revision_go() -> None:
    field = running()
    station = field.station()
    station.push(LONGER)
    field.order("abort")
    assert field.told()[-2:] == ["RevisionDropped", "Aborted"]
    assert station.status().next_revision is None
    assert station.push(LONGER).already
    assert station.status().revision == 2


def test_pushing_the_waiting_revision_again_changes_nothing() -> None:
    field = running()
    field.station().push(LONGER)
    again = field.station().push(LONGER)
    assert (again.already, again.waits) == (True, True)
    assert field.told().count("RevisionWaits") == 1


@pytest.mark.parametrize("moment", ["commit", "committed"])
def test_a_power_cut_at_any_entry_neither_loses_a_revision_nor_repeats_a_stop(moment: str) -> None:
    for entry in range(1, 22):
        field = running()
        station = field.station()
        station.push(LONGER)
        field.journal.rows.commit_hook = Mains((moment, entry))
        while field.controller.run.state != "FINISHED":
            try:
                if field.controller.run.state == "PAUSED":
                    field.order("resume")
                field.work()
            except PowerCut:
                field.boot()
        assert [told for told in field.told() if told.startswith("Scanned")] == [
            f"Scanned s{n}" for n in (1, 2, 3, 4)
        ]
        assert field.told().count("RevisionTaken") == 1
