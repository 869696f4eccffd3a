"""Decoding into typed objects: from several threads at once, and every fault as one kind of error."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import msgspec
import pytest

from stopgo.mission.document.decoding import converted, decoded, decoder_of, unpacked

FIRST_USE_AT_ONCE = """
import sys, threading
import msgspec
from stopgo.mission.document.decoding import converted, decoded, unpacked

sys.setswitchinterval(1e-6)
KINDS = '''
class Inner(msgspec.Struct):
    x: int | None = None
    y: tuple[float, ...] = ()
class Middle(msgspec.Struct):
    inner: Inner | None = None
    by_name: dict[str, Inner] = {}
    listed: tuple[Inner, ...] = ()
class Outer(msgspec.Struct):
    middle: Middle | None = None
    listed: list[Middle] = []
    by_name: dict[str, list[Inner]] = {}
'''
VALUES = {"middle": {"inner": {"x": 1}}, "listed": [{"listed": [{}]}]}
JSON, PACKED = msgspec.json.encode(VALUES), msgspec.msgpack.encode(VALUES)
for _ in range(100):
    kinds = {"msgspec": msgspec}
    exec(KINDS, kinds)
    ready = threading.Barrier(4)
    def run(work):
        ready.wait()
        work()
    works = (
        lambda: decoded(JSON, kinds["Outer"]), lambda: unpacked(PACKED, kinds["Outer"]),
        lambda: converted(VALUES, kinds["Outer"]), lambda: decoded(b"{}", kinds["Middle"]),
    )
    threads = [threading.Thread(target=run, args=(work,)) for work in works]
    for thread in threads: thread.start()
    for thread in threads: thread.join()
"""


def test_threads_may_decode_a_kind_first_at_once() -> None:
    """`msgspec` itself ends the process in a segmentation fault here."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST_USE_AT_ONCE], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


class Point(msgspec.Struct):
    x: float
    of: str = ""


@pytest.mark.parametrize(
    "document",
    [
        b"\xff\xfe", b'{"x": 1, "of": "\xff"}', b"", "\ud800", b"{", b'{"x": "one"}', b'{"of": ""}', None, 5,
        b'{"x": 1, "more": ' + b"[" * 20_000, b"[" * 20_000,
    ],
)  # fmt: skip
def test_every_fault_is_one_kind_of_error(document: Any) -> None:
    with pytest.raises(msgspec.DecodeError):
        decoded(document, Point)
    with pytest.raises(msgspec.DecodeError):
        unpacked(document, Point)


@pytest.mark.parametrize("values", ["\ud800", {"x": "\ud800"}])
def test_values_that_are_no_text_are_no_traceback(values: Any) -> None:
    with pytest.raises(msgspec.ValidationError):
        converted(values, dict[str, float])


FORKED = """
import os, signal, sys, threading, time
from stopgo.mission.document import decoding

held, forking = threading.Event(), threading.Event()

def prepare():
    with decoding._PREPARING:
        held.set()
        forking.wait()
        time.sleep(0.2)

threading.Thread(target=prepare).start()
held.wait()
forking.set()
if process := os.fork():
    sys.exit(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))
signal.alarm(20)
decoding.decoded(b"{}", dict[str, int])
os._exit(0)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="without fork there is no such process")
def test_a_process_that_is_forked_while_a_thread_prepares_a_kind_decodes() -> None:
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_what_is_whole_is_decoded() -> None:
    assert decoded(b'{"x": 1}', Point) == unpacked(msgspec.msgpack.encode({"x": 1}), Point) == Point(1.0)
    assert converted({"x": 1}, Point) == converted(Point(1.0), Point, from_attributes=True) == Point(1.0)
    assert decoded('[{"x": 2}]', tuple[Point, ...]) == (Point(2.0),)
    assert decoder_of(dict[str, Point]) is decoder_of(dict[str, Point])
