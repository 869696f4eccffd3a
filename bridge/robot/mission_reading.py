"""Reads a mission of any length in such a way that a stop given meanwhile is heard.

One call that decodes ten megabytes keeps every other thread of the program from going on for a quarter of a
second, and a collection of its million parts for another tenth. So stops are read one by one, and nothing is
collected until they are.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

from stopgo.mission.document import Mission, Stop


class MissionOfRawStops(Mission, frozen=True, kw_only=True):
    """A mission whose stops are still JSON."""

    stops: tuple[msgspec.Raw, ...]  # type: ignore[assignment]


def read_mission(document: bytes) -> Mission:
    """The mission in its JSON.

    Raises
    ------
    msgspec.DecodeError, UnicodeDecodeError, RecursionError
        If it is none.
    """
    with _nothing_collected():
        raw = msgspec.json.decode(document, type=MissionOfRawStops)
        stops = tuple(_stop(number, body) for number, body in enumerate(raw.stops))
        return Mission(**(msgspec.structs.asdict(raw) | {"stops": stops}))


_STOP = msgspec.json.Decoder(Stop)


def _stop(number: int, body: msgspec.Raw) -> Stop:
    try:
        return _STOP.decode(body)
    except msgspec.ValidationError as error:
        told = str(error)
        where = f"$.stops[{number}]"
        told = told.replace("`$", f"`{where}", 1) if "`$" in told else f"{told} - at `{where}`"
        raise msgspec.ValidationError(told) from None


MANY_PARTS = 20_000
"""So many new parts are collected in some 2 ms, and need no care."""


@contextmanager
def _nothing_collected() -> Iterator[None]:
    """Where much is read meanwhile it counts as old at once: the next quick collection passes it over."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if gc.get_count()[0] > MANY_PARTS and not gc.get_freeze_count():  # unfreezing is of all or nothing
            gc.freeze()
            gc.unfreeze()
        if collects:
            gc.enable()
