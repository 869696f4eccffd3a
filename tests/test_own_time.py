"""The time of tests passes only when all of their threads wait, and then at once."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.mavlink.vehicle_link.transport import open_transport
from stopgo.bridge.mavlink.vehicle_link.url import Url
from tests.own_time import World, stepped_into

HOUR_S = 3600.0


@pytest.fixture
def world() -> Iterator[World]:
    with stepped_into() as made:
        yield made


class Gate:
    """Opens at the third try; `between` happens before every one."""

    def __init__(self, between: Callable[[], None]) -> None:
        self._between = between
        self._tries = 0

    def acquire(self, *, timeout: float) -> bool:
        self._between()
        self._tries += 1
        return self._tries == 3


def test_a_thread_waits_however_slow_the_machine_is_while_others_go_on() -> None:
    world = World()

    def go_on() -> None:
        world._gone_on += 1

    world._wait_at(Gate(go_on))
    with pytest.raises(AssertionError, match="every thread waits for another"):
        world._wait_at(Gate(lambda: None))


def test_an_hour_passes_for_all_at_once(world: World) -> None:
    began, told = world.monotonic_ns(), []

    def sleeps(hours: int) -> None:
        world.sleep(hours * HOUR_S)
        told.append(hours)

    threads = [world.Thread(target=sleeps, args=(hours,)) for hours in (3, 1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert told == [1, 2, 3]
    assert (world.monotonic_ns() - began) / 1e9 == pytest.approx(3 * HOUR_S, abs=1e-3)


def test_no_time_passes_while_somebody_works(world: World) -> None:
    """However long the work takes on the machine's clock, who waits is not late."""
    done = world.Event()

    def works() -> None:
        time.sleep(0.05)
        done.set()

    world.Thread(target=works).start()
    assert done.wait(1e-6)


def test_waits_end_by_what_they_wait_for_or_by_their_time(world: World) -> None:
    items, free, news = world.Queue(), world.Lock(), world.Condition()
    free.acquire()

    def gives() -> None:
        world.sleep(1.0)
        items.put("one")
        free.release()
        with news:
            news.notify_all()

    for late in (0.9, 1.1):
        world.Thread(target=gives).start()
        with news:
            assert news.wait(late) == (late > 1.0)
        assert items.get(timeout=0.2) == "one"
        assert free.acquire(timeout=0.2)
        with pytest.raises(queue.Empty):
            items.get(timeout=HOUR_S)


def test_the_bridge_lives_in_it_and_comes_back_out(world: World) -> None:
    clock = WallClock(speed_up=10.0)
    began = clock.now_ns()
    clock.wait(HOUR_S)
    assert clock.now_ns() - began == pytest.approx(HOUR_S * 1e9, rel=1e-6)
    assert threading.Event is not world.Event


def test_datagrams_arrive_at_once_and_are_refused_where_nobody_listens(world: World) -> None:
    near = open_transport(Url("udpout", "127.0.0.1", 9))
    near.write(b"lost")
    assert near.disconnected == "nothing listens there"
    far = open_transport(Url("udpin", "127.0.0.1", 9))
    near.write(b"asked")
    ((sender, data),) = far.read(HOUR_S)
    assert data == b"asked"
    far.write(b"answered", sender)
    assert near.read(HOUR_S) == [(("127.0.0.1", 9), b"answered")]
    assert near.disconnected == ""
    assert near.read(HOUR_S) == []
