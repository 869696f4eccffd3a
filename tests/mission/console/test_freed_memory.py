"""Memory given back between the stages of a large plan: nothing else changes, on any system."""

from __future__ import annotations

import ctypes
import gc
import sys

import pytest

from stopgo.mission.console import freed_memory

given: list[int] = []


class Library:
    """A C library that can give memory back."""

    @staticmethod
    def malloc_trim(kept: int) -> None:
        given.append(kept)


@pytest.fixture(autouse=True)
def library(monkeypatch: pytest.MonkeyPatch) -> None:
    given.clear()
    monkeypatch.setattr(ctypes, "CDLL", lambda name: Library)
    monkeypatch.setattr(sys, "platform", "linux")


def test_a_large_process_gives_all_it_can_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(freed_memory, "LARGE", 0)
    freed_memory.give_back()
    assert given == [0]


def test_python_looks_seldom_for_objects_that_refer_to_each_other_and_then_as_before() -> None:
    before = gc.get_threshold()
    with freed_memory.looking_seldom():
        assert gc.get_threshold()[0] == freed_memory.OBJECTS
    assert gc.get_threshold() == before


def test_a_small_process_keeps_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(freed_memory, "LARGE", 1 << 40)
    freed_memory.give_back()
    assert given == []


@pytest.mark.parametrize("platform", ["win32", "darwin"])
def test_other_systems_do_it_by_themselves(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(freed_memory, "LARGE", 0)
    monkeypatch.setattr(sys, "platform", platform)
    freed_memory.give_back()
    assert given == []


def test_a_library_that_cannot_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(freed_memory, "LARGE", 0)
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    freed_memory.give_back()
    assert given == []
