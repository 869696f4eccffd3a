"""Events of a run reach the page as soon as they are told, each once, and never those of another run."""

from __future__ import annotations

from typing import Any

from stopgo.mission.run.events import Pose, PoseReport, Settled, Started
from stopgo.site.event_feed import EventFeed
from stopgo.site.shown_run import ShownRun

HERE = Pose(x=0.0, y=0.0, heading=0.0)


def event(kind: Any, number: int, run_id: str = "a", **details: Any) -> Any:
    about = {"robot": "r1", "boot_id": "b", "robot_ns": 1_000_000_000 * number, "mission_id": "m"}
    return kind(**about, number=number, run_id=run_id, revision=1, mission_time_s=0.0, **details)


def pose_at(x: float, run_id: str, ns: int) -> PoseReport:
    pose = Pose(x=x, y=0.0, heading=0.0)
    about = {"robot": "r1", "boot_id": "b", "seq": 1, "mission_time_s": 0.0, "speed": 0.0}
    return PoseReport(**about, robot_ns=ns, run_id=run_id, pose=pose)


def numbers(feed: EventFeed) -> list[tuple[int, str]]:
    shown = [(told.number, key[2]) for key, told in feed.since(-1) if key[0] == "event"]
    return [(number, name) for number, name in shown]


def test_an_event_that_came_live_is_shown_once() -> None:
    feed = EventFeed()
    run = ShownRun(feed, "r1")
    started, settled = event(Started, 1, commander="anna"), event(Settled, 2, stop="s1", pose=HERE)
    run.take_live(started, None)
    run.take_live(settled, pose_at(1.5, "a", 2_500_000_000))
    before = numbers(feed)
    run.begin("a")
    run.take(started, None)
    run.take(settled, None)
    assert numbers(feed) == before
    assert (feed.value("event", "r1", "2") or {})["at"] == [1.5, 0.0]


def test_events_of_another_run_do_not_come_in_between() -> None:
    feed = EventFeed()
    run = ShownRun(feed, "r1")
    run.take_live(event(Settled, 4, "old", stop="s1", pose=HERE), None)
    assert numbers(feed) == []
    run.begin("a")
    run.take(event(Settled, 5, "a", stop="s1", pose=HERE), None)
    run.take_live(event(Started, 6, "b", commander="anna"), None)
    run.take(event(Settled, 7, "a", stop="s2", pose=HERE), None)
    run.add_pose(pose_at(9.0, "a", 1))
    assert [name for _, name in numbers(feed)] == ["6"]
    assert feed.value("path", "r1", "0") is None
    assert feed.value("run", "r1") == {"run": "b"}
