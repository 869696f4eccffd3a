"""Simulated time: scheduled calls happen in order."""

from __future__ import annotations

from stopgo.bridge.link.clock import SimulatedClock


def test_calls_of_one_moment_happen_in_the_order_in_which_they_were_scheduled() -> None:
    clock, happened = SimulatedClock(), list[str]()
    clock.at(1.0, lambda: happened.append("before"))
    clock.at(2.0, lambda: happened.append("first"))
    clock.wait(1.0)
    clock.at(1.0, lambda: happened.append("second"))
    clock.at(1.0, lambda: happened.append("third"))
    clock.wait(1.0)
    assert happened == ["before", "first", "second", "third"]
