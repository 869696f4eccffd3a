"""Reading of a mission of any length without delay for a pause or an abort that comes meanwhile.

One call that decodes ten megabytes blocks every other thread for a quarter of a second. Garbage collection
of its million objects takes another tenth. So stops are read one by one, with the collector off.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec

from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.decoding import decoded


class MissionOfRawStops(Mission, frozen=True, kw_only=True):
    """A mission whose stops are still JSON."""

    stops: tuple[msgspec.Raw, ...]  # type: ignore[assignment]


def read_mission(document: bytes) -> Mission:
    """Return the mission in its JSON.

    Raises
    ------
    msgspec.DecodeError
        If it is not a mission.
    """
    with _collector_off():
        raw = decoded(document, MissionOfRawStops)
        stops = tuple(_stop(number, body) for number, body in enumerate(raw.stops))
        return Mission(**(msgspec.structs.asdict(raw) | {"stops": stops}))


def _stop(number: int, body: msgspec.Raw) -> Stop:
    try:
        return decoded(body, Stop)
    except msgspec.ValidationError as error:
        message = str(error)
        where = f"$.stops[{number}]"
        message = message.replace("`$", f"`{where}", 1) if "`$" in message else f"{message} - at `{where}`"
        raise msgspec.ValidationError(message) from None


MANY_OBJECTS = 20_000
"""The garbage collector handles this many new objects in about 2 ms."""


@contextmanager
def _collector_off() -> Iterator[None]:
    """Collect no garbage in the block; many new objects count as old after it, so collections skip them."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if gc.get_count()[0] > MANY_OBJECTS and not gc.get_freeze_count():  # unfreezing is all or nothing
            gc.freeze()
            gc.unfreeze()
        if collects:
            gc.enable()
