"""Verdicts of the guard on a program's signs of life."""

from __future__ import annotations

from stopgo.bridge.ros2.goal_guard import DRIVES, SILENT_S, STANDS, Signs


def test_a_program_that_ends_while_it_drives_is_stopped_once() -> None:
    signs = Signs(0.0)
    signs.take(STANDS + DRIVES, 1.0)
    assert not signs.must_stop(1.0)
    signs.take(b"", 1.1)
    assert signs.must_stop(1.1)
    assert not signs.must_stop(1.2)


def test_a_program_that_hangs_while_it_drives_is_stopped() -> None:
    signs = Signs(0.0)
    signs.take(DRIVES, 1.0)
    assert not signs.must_stop(1.0 + SILENT_S)
    assert signs.must_stop(1.1 + SILENT_S)


def test_a_program_that_stands_may_end_or_hang() -> None:
    signs = Signs(0.0)
    signs.take(DRIVES + STANDS, 1.0)
    assert not signs.must_stop(9.0)
    signs.take(b"", 9.0)
    assert signs.ended and not signs.must_stop(9.1)
