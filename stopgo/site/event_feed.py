"""Feed of everything that pages show: the newest value of each key, numbered by its change.

A page that was away asks for all that changed after the number it knows. It gets the newest value of each
key once, however often it changed meanwhile, so a slow page delays nobody and needs no queue. What must not
be left out, such as the events of a run, has a key for each.

Invariants:
- `_values` is in the order of the numbers; a key that changes moves to the end.
- A number is given once. Numbers of another `epoch`, before a restart, are unknown: that page gets all.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any

Key = tuple[str, ...]
Value = dict[str, Any]

BEAT_S = 1.0
"""Longest time without a message to a page; a page that hears none for longer says so."""
LEAST_S = 0.1
"""Time between two messages to a page: ten each second."""
AT_ONCE_S = 0.02
"""Time after a message before the next, if that has a value which people wait for."""
MOST_BYTES = 512 * 1024
"""Size above which a message is divided."""


@dataclass(frozen=True)
class Told:
    """A value, its number, and the time when it was true."""

    number: int
    value: Value
    at_s: float


class EventFeed:
    """Newest values by key, from any thread to any number of pages."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.epoch = secrets.token_hex(4)
        self._clock = clock
        self._lock = threading.Lock()
        self._values: OrderedDict[Key, Told] = OrderedDict()
        self._number = 0
        self._streams: set[_Stream] = set()

    def tell(self, key: Key, value: Value, *, at_s: float | None = None, at_once: bool = False) -> None:
        """Set the value of a key, which was true at `at_s` on the feed's clock.

        Values go to the pages ten times a second, those that people wait for `at_once`.
        """
        with self._lock:
            self._number += 1
            self._values[key] = Told(self._number, value, self._clock() if at_s is None else at_s)
            self._values.move_to_end(key)
            streams = list(self._streams)
        for stream in streams:
            stream.wake(at_once=at_once)

    def forget(self, *prefix: str) -> None:
        """Remove the keys that begin so; pages learn it by the value that replaces them."""
        with self._lock:
            for key in [key for key in self._values if key[: len(prefix)] == prefix]:
                del self._values[key]

    def close(self) -> None:
        """Wake every page's stream."""
        with self._lock:
            streams = list(self._streams)
        for stream in streams:
            stream.wake(at_once=True)

    def value(self, *key: str) -> Value | None:
        """Return the newest value of a key."""
        found = self._values.get(key)
        return None if found is None else found.value

    def since(self, number: int) -> list[tuple[Key, Told]]:
        """Return all values with a number above `number`, in order."""
        newer: list[tuple[Key, Told]] = []
        with self._lock:
            for key in reversed(self._values):
                told = self._values[key]
                if told.number <= number:
                    break
                newer.append((key, told))
        return newer[::-1]

    async def messages(self, last: str, *, ended: Callable[[], bool]) -> AsyncIterator[bytes]:
        """Yield server-sent events after the one named `last`, until `ended`."""
        epoch, _, text = last.partition("-")
        number = int(text) if epoch == self.epoch and text.isdecimal() and len(text) < 16 else -1
        stream = _Stream()
        self._streams.add(stream)
        try:
            while not ended():
                stream.begin()
                for block in self._blocks(number):
                    number, body = block
                    yield body
                await stream.pause()
        finally:
            self._streams.discard(stream)

    def _blocks(self, number: int) -> list[tuple[int, bytes]]:
        """Return messages with all newer values, each below the largest size; one without values at least."""
        fresh, newer = number < 0, self.since(number)
        blocks: list[tuple[int, bytes]] = []
        items: list[str] = []
        size, now = 0, self._clock()
        for key, told in newer:
            age = max(0, round(1000 * (now - told.at_s)))
            text = json.dumps({"key": key, "age_ms": age, "value": told.value}, ensure_ascii=False)
            items.append(text)
            size, number = size + len(text), told.number
            if size > MOST_BYTES:
                blocks.append((number, self._message(number, items, fresh=fresh)))
                items, size, fresh = [], 0, False
        if items or not blocks:
            number = max(number, 0)
            blocks.append((number, self._message(number, items, fresh=fresh)))
        return blocks

    def _message(self, number: int, items: list[str], *, fresh: bool) -> bytes:
        body = f'{{"fresh":{json.dumps(fresh)},"items":[{",".join(items)}]}}'
        return f"id: {self.epoch}-{number}\ndata: {body}\n\n".encode("utf-8", "replace")


class _Stream:
    """Stream of messages to one page, in the loop that made it; other threads wake it."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()
        self._awaited = asyncio.Event()

    def begin(self) -> None:
        """Forget the changes that the next message has."""
        self._changed.clear()
        self._awaited.clear()

    async def pause(self) -> None:
        """Wait until the next message is due."""
        await asyncio.sleep(AT_ONCE_S)
        if not await _set_within(self._awaited, LEAST_S - AT_ONCE_S):
            await _set_within(self._changed, BEAT_S)

    def wake(self, *, at_once: bool) -> None:
        """Note a change; from any thread."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._set, at_once)

    def _set(self, at_once: bool) -> None:
        self._changed.set()
        if at_once:
            self._awaited.set()


async def _set_within(event: asyncio.Event, within_s: float) -> bool:
    try:
        return await asyncio.wait_for(event.wait(), within_s)
    except TimeoutError:
        return False
