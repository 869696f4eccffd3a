"""The feed of the pages: no page misses a value, and a slow one delays nobody."""

from __future__ import annotations

import asyncio
import json
from typing import Any

from stopgo.site import event_feed
from stopgo.site.event_feed import EventFeed


def messages(feed: EventFeed, last: str, count: int) -> list[tuple[str, dict[str, Any]]]:
    """The first messages after a number: each with its id and its content."""

    async def read() -> list[bytes]:
        found = []
        async for body in feed.messages(last, ended=lambda: False):
            found.append(body)
            if len(found) == count:
                break
        return found

    parts = [body.decode().strip().split("\n") for body in asyncio.run(read())]
    return [(one.removeprefix("id: "), json.loads(two.removeprefix("data: "))) for one, two in parts]


def items(message: dict[str, Any]) -> dict[str, Any]:
    return {".".join(item["key"]): item["value"].get("n") for item in message["items"]}


def test_a_new_page_gets_the_newest_of_everything() -> None:
    feed = EventFeed()
    for n in range(5):
        feed.tell(("pose", "r1"), {"n": n})
    feed.tell(("event", "r1", "1"), {"n": 1})
    ((_, message),) = messages(feed, "", 1)
    assert message["fresh"]
    assert items(message) == {"pose.r1": 4, "event.r1.1": 1}


def test_a_page_that_was_away_gets_what_changed_and_every_event() -> None:
    feed = EventFeed()
    feed.tell(("robot", "r1"), {"n": 0})
    ((last, _),) = messages(feed, "", 1)
    for n in range(1, 1001):
        feed.tell(("event", "r1", str(n)), {"n": n})
        feed.tell(("pose", "r1"), {"n": n})
    ((_, message),) = messages(feed, last, 1)
    assert not message["fresh"]
    found = items(message)
    assert found.pop("pose.r1") == 1000
    assert sorted(found.values()) == list(range(1, 1001))


def test_after_a_restart_a_page_gets_everything() -> None:
    before, after = EventFeed(), EventFeed()
    before.tell(("robot", "r1"), {"n": 0})
    ((last, _),) = messages(before, "", 1)
    after.tell(("robot", "r1"), {"n": 7})
    for known in (last, "junk", "", f"{after.epoch}-junk", f"{after.epoch}-{'9' * 40}"):
        ((_, message),) = messages(after, known, 1)
        assert message["fresh"]
        assert items(message) == {"robot.r1": 7}


def test_a_large_answer_comes_in_parts(monkeypatch: Any) -> None:
    monkeypatch.setattr(event_feed, "MOST_BYTES", 1000)
    feed = EventFeed()
    for n in range(60):
        feed.tell(("event", "r1", str(n)), {"n": n, "text": "x" * 40})
    ((first, one), (_, two)) = messages(feed, "", 2)
    assert (one["fresh"], two["fresh"]) == (True, False)
    ((_, again),) = messages(feed, first, 1)
    assert items(again) == items(two)


def test_a_value_has_its_age() -> None:
    now = [100.0]
    feed = EventFeed(clock=lambda: now[0])
    feed.tell(("robot", "r1"), {}, at_s=98.5)
    now[0] = 101.0
    ((_, message),) = messages(feed, "", 1)
    assert message["items"][0]["age_ms"] == 2500


def test_memory_is_bounded_by_the_keys() -> None:
    feed = EventFeed()
    for n in range(10_000):
        feed.tell(("pose", f"r{n % 20}"), {"n": n})
    assert len(feed.since(-1)) == 20
    feed.forget("pose", "r1")
    assert len(feed.since(-1)) == 19


def test_an_event_waits_for_no_other_message(monkeypatch: Any) -> None:
    monkeypatch.setattr(event_feed, "LEAST_S", 1e6)

    async def read() -> bytes:
        feed = EventFeed()
        found = feed.messages("", ended=lambda: False)
        await anext(found)
        later = asyncio.ensure_future(anext(found))
        await asyncio.sleep(0)
        feed.tell(("pose", "r1"), {"n": 1})
        feed.tell(("event", "r1", "1"), {"n": 1}, at_once=True)
        return await later

    body = asyncio.run(read()).decode()
    assert items(json.loads(body.partition("data: ")[2])) == {"pose.r1": 1, "event.r1.1": 1}
