"""Tests of the store of finished plans: whole or not at all, shared, bounded."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from stopgo.batches import store as module
from stopgo.batches.store import RESULT, Claim, Result, ResultStore
from stopgo.mission.errors import InputError

KEY, OTHER = "aa" * 16, "bb" * 16


def result(**values: object) -> Result:
    facts = {"exit_code": 0, "text": "", "reports": [], "parts": {}, "settings": {}, "computed_by": "x"}
    facts |= {"floor": "f", "floor_digest": "d", "planned": "2026-01-01", "seconds": 1.0, "files": {}}
    return Result(**(facts | values))  # type: ignore[arg-type]


@pytest.fixture
def store(tmp_path: Path) -> ResultStore:
    return ResultStore.at(tmp_path / "store")


def publish(store: ResultStore, key: str = KEY, text: str = "a plan") -> None:
    with store.filling() as folder:
        (folder / "mission.json").write_text(text)
        store.publish(key, folder, result())


def test_a_published_result_is_found_with_its_files(store: ResultStore) -> None:
    assert store.find(KEY) is None
    publish(store)
    found = store.find(KEY)
    assert found is not None
    assert list(found.files) == ["mission.json"]
    assert (store.result_folder(KEY) / "mission.json").read_text() == "a plan"


@pytest.mark.parametrize("damage", ["cut", "other", "gone", "manifest"])
def test_a_damaged_result_does_not_count_and_can_be_made_again(store: ResultStore, damage: str) -> None:
    publish(store)
    file = store.result_folder(KEY) / "mission.json"
    if damage == "gone":
        file.unlink()
    elif damage == "manifest":
        (store.result_folder(KEY) / RESULT).write_text("{")
    else:
        file.write_text("a pla" if damage == "cut" else "a plaN")
    assert store.find(KEY) is None
    publish(store)
    assert store.find(KEY) is not None


def test_the_first_of_two_results_stays(store: ResultStore) -> None:
    publish(store, text="first")
    publish(store, text="second")
    assert (store.result_folder(KEY) / "mission.json").read_text() == "first"
    assert not list((store.folder / "unfinished").iterdir())


def test_what_is_filled_and_not_published_leaves_nothing(store: ResultStore) -> None:
    with pytest.raises(KeyboardInterrupt), store.filling() as folder:
        (folder / "mission.json").write_text("half")
        raise KeyboardInterrupt
    assert store.find(KEY) is None
    assert not list((store.folder / "unfinished").iterdir())


def test_a_claim_is_held_by_one_at_a_time(store: ResultStore) -> None:
    held, order = threading.Event(), []

    def second() -> None:
        held.wait()
        with store.claimed(KEY):
            order.append("second")

    thread = threading.Thread(target=second)
    thread.start()
    with store.claimed(KEY):
        held.set()
        order.append("first")
        with store.claimed(OTHER):  # another key is free
            order.append("other")
    thread.join()
    assert order == ["first", "other", "second"]
    assert not list((store.folder / "claims").iterdir())


@pytest.mark.skipif(os.name != "posix", reason="only POSIX tells which processes live")
def test_the_claim_of_a_dead_process_is_taken_over(store: ResultStore) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    path = store.folder / "claims" / f"{KEY}.json"
    module._create(path, Claim("token", socket.gethostname(), ended.pid))
    with store.claimed(KEY):
        pass


def test_the_claim_of_another_machine_is_taken_over_when_its_counter_stands_still(
    store: ResultStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = store.folder / "claims" / f"{KEY}.json"
    module._create(path, Claim("token", "another machine", 1))
    times = iter(range(0, 10_000, 10))
    monkeypatch.setattr(module.time, "monotonic", lambda: float(next(times)))
    monkeypatch.setattr(module.time, "sleep", lambda seconds: None)
    with store.claimed(KEY):
        assert module._claim_in(path).host != "another machine"


def test_the_longest_unused_results_go_first(store: ResultStore) -> None:
    publish(store)
    publish(store, OTHER)
    os.utime(store.result_folder(KEY) / RESULT, (1.0, 1.0))
    size = sum(path.stat().st_size for path in store.result_folder(OTHER).iterdir())
    removed, freed = store.collect_garbage(most_bytes=size, oldest_s=None)
    assert removed == 1
    assert freed > 0
    assert store.find(KEY) is None
    assert store.find(OTHER) is not None


def test_results_are_removed_by_age(store: ResultStore) -> None:
    publish(store)
    assert store.collect_garbage(most_bytes=None, oldest_s=3600.0) == (0, 0)
    os.utime(store.result_folder(KEY) / RESULT, (1.0, 1.0))
    assert store.collect_garbage(most_bytes=None, oldest_s=3600.0)[0] == 1


def test_a_damaged_fact_is_none(store: ResultStore) -> None:
    store.write_fact("readings", "k", {"outline": "x"})
    assert store.read_fact("readings", "k") == {"outline": "x"}
    (store.folder / "readings" / "k.json").write_text("{")
    assert store.read_fact("readings", "k") is None


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="the store cannot be made"):
        ResultStore.at(tmp_path / "file" / "store")
