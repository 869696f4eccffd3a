"""A world with time of its own: its threads wait for hours in no time, on a slow machine as on a fast one.

Time stands still while any thread of the world works. When all of them wait, it jumps to the next moment that
one of them waits for. What is sent over UDP arrives at once. So no outcome depends on how fast the machine
is, and no test waits for anything.

`stepped_into` lets the modules of the bridge and of its tests live in such a world, until the block ends.
Threads that are not the world's, other processes and sockets know nothing of its time: what needs them needs
real time.
"""

from __future__ import annotations

import heapq
import itertools
import math
import os
import pkgutil
import queue
import select
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from importlib import import_module
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import stopgo.bridge
from stopgo.bridge.mavlink.vehicle_link import transport
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.errors import InputError

NET_S = 120.0
"""Of real time, in which some thread of a world must go on: else they wait for one another."""
INSIDE = ("tests.waiting.", "stopgo.bridge.", "tests.bridge.", "tests.faults.")
"""Modules that live in the world."""


class _Over(SystemExit):
    """Ends a thread that still waits when its world ends."""


class _Waiting:
    """A thread that waits, and why it goes on."""

    __slots__ = ("gate", "gone_on")

    def __init__(self, gate: Any) -> None:
        self.gate = gate
        """A lock that is held until the thread goes on."""
        self.gone_on = False
        """True once it goes on, or does not wait after all."""


class World:
    """Time, and everything that threads wait for with."""

    def __init__(self) -> None:
        self._monitor = threading.Lock()
        self._origin_ns = time.time_ns()
        self._now_ns = 0
        self._active = 1
        self._looks = itertools.count()
        self._count = itertools.count()
        self._gone_on = 0
        """How often any thread did."""
        self._timers: list[tuple[int, int, _Waiting]] = []
        self._parked: set[_Waiting] = set()
        self._gates: list[Any] = []
        """Gates that nobody waits at."""
        self._over = False
        self.ports: dict[tuple[str, int], UdpIn] = {}
        world = self

        class Bound:
            """Common base of these classes: the world that made them."""

            _world = world

        self.Lock = type("Lock", (Bound, _Lock), {})
        self.RLock = type("RLock", (Bound, _RLock), {})
        self.Condition = type("Condition", (Bound, _Condition), {})
        self.Event = type("Event", (Bound, _Event), {})
        self.Queue = type("Queue", (Bound, _Queue), {})
        self.Thread = type("Thread", (Bound, _Thread), {})

    # What modules import

    @property
    def shims(self) -> dict[object, object]:
        """Stand-ins for the imports of a module in the world."""
        looks = self._looks
        of_threads = _Instead(
            threading, Lock=self.Lock, RLock=self.RLock, Condition=self.Condition, Event=self.Event,
            Thread=self.Thread,
        )  # fmt: skip
        of_time = _Instead(
            time, monotonic=lambda: (self._now_ns + next(looks)) / 1e9, monotonic_ns=self.monotonic_ns,
            time=lambda: self.time_ns() / 1e9, time_ns=self.time_ns, sleep=self.sleep,
        )  # fmt: skip
        of_queues = _Instead(queue, Queue=self.Queue, SimpleQueue=self.Queue)
        return {
            threading: of_threads, time: of_time, queue: of_queues,
            threading.Event: self.Event, threading.Lock: self.Lock, select: None,
        }  # fmt: skip

    def monotonic_ns(self) -> int:
        """A look at the clock takes a nanosecond, so that who looks again and again sees time pass."""
        return self._now_ns + next(self._looks)

    def time_ns(self) -> int:
        return self._origin_ns + self.monotonic_ns()

    def set_date(self, seconds: float) -> None:
        """Set the date forward or back; what waits goes on waiting."""
        self._origin_ns += round(seconds * 1e9)

    def sleep(self, seconds: float) -> None:
        with self._monitor:
            self._park(None, self._due_ns(seconds))

    def _due_ns(self, seconds: float | None) -> int | None:
        """Time after so many seconds: always later, so that no loop repeats in no time."""
        return None if seconds is None else self._now_ns + max(1, math.ceil(seconds * 1e9))

    def _is_past(self, due_ns: int | None) -> bool:
        return due_ns is not None and self._now_ns >= due_ns

    # How threads wait, with the monitor held

    def _line_up(self, line: deque[_Waiting] | None) -> _Waiting:
        """Stand in line for what another thread may give from now on, without the monitor too."""
        if self._gates:
            gate = self._gates.pop()
        else:
            gate = threading.Lock()
            gate.acquire()
        me = _Waiting(gate)
        if line is not None:
            line.append(me)
        return me

    def _leave(self, me: _Waiting) -> None:
        """Wait for nothing after all."""
        me.gone_on = True
        self._gates.append(me.gate)

    def _park(self, line: deque[_Waiting] | None, due_ns: int | None) -> None:
        """Wait until `_let_on` or until the time is up."""
        self._park_as(self._line_up(line), due_ns)

    def _park_as(self, me: _Waiting, due_ns: int | None) -> None:
        self._parked.add(me)
        if due_ns is not None:
            heapq.heappush(self._timers, (due_ns, next(self._count), me))
        self._rest()
        if me.gone_on:  # the time has jumped to the end of this very wait
            me.gate.acquire()
        else:
            self._monitor.release()
            try:
                self._wait_at(me.gate)
            finally:
                self._monitor.acquire()
        if self._over:
            raise _Over
        self._gates.append(me.gate)

    def _wait_at(self, gate: Any) -> None:
        """Until it opens, however long that takes, as long as some thread of the world goes on meanwhile."""
        before = self._gone_on
        while not gate.acquire(timeout=NET_S):
            assert self._gone_on != before, "every thread waits for another"
            before = self._gone_on

    def _let_on(self, waiting: _Waiting) -> None:
        self._parked.discard(waiting)
        waiting.gone_on = True
        self._gone_on += 1
        self._active += 1
        waiting.gate.release()

    def _let_on_first(self, line: deque[_Waiting], count: int = 1) -> None:
        """The first `count` that still wait in the line; those whose time was up are left out."""
        while line and count:
            first = line.popleft()
            if not first.gone_on:
                self._let_on(first)
                count -= 1

    def _rest(self) -> None:
        """A thread stops working; if it was the last, time jumps."""
        self._active -= 1
        while self._active == 0 and self._timers:
            due_ns, _, waiting = heapq.heappop(self._timers)
            if not waiting.gone_on:
                self._now_ns = max(self._now_ns, due_ns)
                self._let_on(waiting)

    def end(self) -> None:
        """Let nobody wait any longer."""
        with self._monitor:
            self._over = True
            for waiting in list(self._parked):
                self._let_on(waiting)


class _Instead(SimpleNamespace):
    """A module of which some names mean something else."""

    def __init__(self, module: object, **names: object) -> None:
        super().__init__(**names)
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


class _Lock:
    """A lock of Python's that is never waited at: who finds it held stands in line."""

    _world: World
    _made = staticmethod(threading.Lock)

    def __init__(self) -> None:
        self._held: Any = self._made()
        self._line: deque[_Waiting] = deque()

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        return self._held.acquire(False) or (blocking and self._wait(timeout))

    def _wait(self, timeout: float) -> bool:
        world = self._world
        with world._monitor:
            due_ns = world._due_ns(None if timeout < 0 else timeout)
            while True:
                me = world._line_up(self._line)
                if (is_mine := self._held.acquire(False)) or world._is_past(due_ns):
                    world._leave(me)
                    return is_mine
                world._park_as(me, due_ns)

    def release(self) -> None:
        self._held.release()
        if self._line:
            with self._world._monitor:
                self._world._let_on_first(self._line)

    def locked(self) -> bool:
        return self._held.locked()

    def __enter__(self) -> bool:
        return self._held.acquire(False) or self._wait(-1)

    def __exit__(self, *exception: object) -> None:
        self.release()


class _RLock(_Lock):
    _made = staticmethod(threading.RLock)


class _Condition:
    _world: World

    def __init__(self, lock: _Lock | None = None) -> None:
        self._lock = lock or self._world.Lock()
        self._line: deque[_Waiting] = deque()

    def __enter__(self) -> bool:
        return self._lock.acquire()

    def __exit__(self, *exception: object) -> None:
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        return self._wait(self._world._due_ns(timeout))

    def _wait(self, due_ns: int | None) -> bool:
        world = self._world
        with world._monitor:
            me = world._line_up(self._line)
            self._lock._held.release()
            world._let_on_first(self._lock._line)
            world._park_as(me, due_ns)
            in_time = not world._is_past(due_ns)
        self._lock.acquire()
        return in_time

    def wait_for(self, predicate: Callable[[], bool], timeout: float | None = None) -> bool:
        due_ns = self._world._due_ns(timeout)
        while not predicate():
            if self._world._is_past(due_ns):
                return False
            self._wait(due_ns)
        return True

    def notify(self, count: int = 1) -> None:
        if self._line:
            with self._world._monitor:
                self._world._let_on_first(self._line, count)

    def notify_all(self) -> None:
        self.notify(len(self._line))


class _Event:
    _world: World

    def __init__(self) -> None:
        self._is_set = False
        self._line: deque[_Waiting] = deque()

    def is_set(self) -> bool:
        return self._is_set

    def set(self) -> None:
        with self._world._monitor:
            self._is_set = True
            self._world._let_on_first(self._line, len(self._line))

    def clear(self) -> None:
        self._is_set = False

    def wait(self, timeout: float | None = None) -> bool:
        if self._is_set:
            return True
        with self._world._monitor:
            if not self._is_set:
                self._world._park(self._line, self._world._due_ns(timeout))
            return self._is_set


class _Queue:
    _world: World

    def __init__(self, maxsize: int = 0) -> None:
        self._most = maxsize
        self._items: deque[Any] = deque()
        self._line: deque[_Waiting] = deque()

    def put(self, item: Any) -> None:
        """As of a queue without end: nobody here waits for room."""
        if self._most and len(self._items) >= self._most:
            raise queue.Full
        self._items.append(item)
        if self._line:
            with self._world._monitor:
                self._world._let_on_first(self._line)

    put_nowait = put

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        try:
            return self._items.popleft()
        except IndexError:
            if not block:
                raise queue.Empty from None
        return self._wait_for_one(timeout)

    def _wait_for_one(self, timeout: float | None) -> Any:
        world = self._world
        with world._monitor:
            due_ns = world._due_ns(timeout)
            while True:
                me = world._line_up(self._line)
                try:
                    item = self._items.popleft()
                except IndexError:
                    if world._is_past(due_ns):
                        world._leave(me)
                        raise queue.Empty from None
                    world._park_as(me, due_ns)
                else:
                    world._leave(me)
                    return item

    def get_nowait(self) -> Any:
        return self.get(block=False)

    def qsize(self) -> int:
        return len(self._items)

    def empty(self) -> bool:
        return not self._items


class _Thread(threading.Thread):
    _world: World

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._line: deque[_Waiting] = deque()
        self._has_run = False

    def start(self) -> None:
        with self._world._monitor:
            self._world._active += 1
        super().start()

    def run(self) -> None:
        world = self._world
        try:
            super().run()
        finally:
            with world._monitor:
                self._has_run = True
                world._let_on_first(self._line, len(self._line))
                world._rest()

    def join(self, timeout: float | None = None) -> None:
        with self._world._monitor:
            if not self._has_run:
                self._world._park(self._line, self._world._due_ns(timeout))
        if self._has_run:
            super().join()


@cache
def _import_all() -> None:
    """Every module of the bridge: one that is imported later would live in real time."""
    for module in pkgutil.walk_packages(stopgo.bridge.__path__, f"{stopgo.bridge.__name__}."):
        import_module(module.name)


# ---- UDP ----


class UdpIn:
    """Hears everyone on a port of the world, and answers those it has heard."""

    datagrams = True
    disconnected = ""

    def __init__(self, world: World, url: Url) -> None:
        self._world = world
        self.address = (url.host, url.number)
        if self.address in world.ports:
            raise InputError(f"{url}: cannot be opened (Address already in use); is it free?")
        world.ports[self.address] = self
        self._peers: dict[Any, UdpOut] = {}
        self._came: Any = world.Queue()

    def take(self, sender: UdpOut, data: bytes) -> None:
        self._came.put((sender, data))

    def read(self, timeout_s: float) -> list[tuple[Any, bytes]]:
        try:
            sender, data = self._came.get(timeout=max(0.0, timeout_s))
        except queue.Empty:
            return []
        self._peers.pop(sender.address, None)
        self._peers[sender.address] = sender
        while len(self._peers) > transport.MAX_PEERS:
            del self._peers[next(iter(self._peers))]
        return [(sender.address, data)]

    def write(self, data: bytes, to: Any = None) -> None:
        for peer in list(self._peers.values()) if to is None else [self._peers.get(to)]:
            if peer is not None:
                peer.take(data)

    def ends(self, to: Any = None) -> list[Any]:
        """No other process can write here."""
        return []

    def close(self) -> None:
        self._world.ports.pop(self.address, None)


class UdpOut:
    """Sends to one port of the world, and hears only that one."""

    datagrams = True
    _numbers = itertools.count(50_000)

    def __init__(self, world: World, url: Url) -> None:
        self.disconnected = ""
        self.address = ("127.0.0.1", next(self._numbers))
        self._world = world
        self._peer = (url.host, url.number)
        self._came: Any = world.Queue()
        self._open = True

    def take(self, data: bytes) -> None:
        if self._open:
            self._came.put(data)

    def read(self, timeout_s: float) -> list[tuple[Any, bytes]]:
        try:
            data = self._came.get(timeout=max(0.0, timeout_s))
        except queue.Empty:
            return []
        self.disconnected = ""
        return [(self._peer, data)]

    def write(self, data: bytes, to: Any = None) -> None:
        there = self._world.ports.get(self._peer)
        if there is None:
            self.disconnected = "nothing listens there"
        else:
            there.take(self, data)

    def ends(self, to: Any = None) -> list[Any]:
        return []

    def close(self) -> None:
        self._open = False


@contextmanager
def _on_one_processor() -> Iterator[None]:
    """One thread of a world works at a time: on one processor they wake one another sooner and for less."""
    if sys.platform != "linux":
        yield
        return
    processors = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {sorted(processors)[os.getpid() % len(processors)]})
    try:
        yield
    finally:
        os.sched_setaffinity(0, processors)


@lru_cache(maxsize=1)
def _uses(modules: int, reals: frozenset[int]) -> list[tuple[ModuleType, str, int]]:
    """Modules inside, and their attributes that are one of these objects; anew when modules were imported."""
    inside = [module for name, module in sys.modules.items() if f"{name}.".startswith(INSIDE)]
    return [
        (module, attribute, id(value))
        for module in inside
        for attribute, value in vars(module).items()
        if id(value) in reals
    ]


@contextmanager
def stepped_into() -> Iterator[World]:
    """The bridge and its tests in a world of their own, until the block ends."""
    _import_all()
    world = World()
    with pytest.MonkeyPatch.context() as patch, _on_one_processor():
        patch.setitem(transport.OPENING, "udpin", lambda url: UdpIn(world, url))
        patch.setitem(transport.OPENING, "udpout", lambda url: UdpOut(world, url))
        shims = {id(real): shim for real, shim in world.shims.items() if shim is not None}
        for module, attribute, real in _uses(len(sys.modules), frozenset(shims)):
            patch.setattr(module, attribute, shims[real])
        try:
            yield world
        finally:
            world.end()
