"""Log formats of installed packages: entry points in the group `stopgo.log`, each a `LogFormat`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from stopgo.mission.console.plugins import Variant, installed, variant
from stopgo.recordings.logs.field_log import FieldLog

CLOCKS = ("wall", "since boot", "simulated")
"""Allowed values of `FieldLog.clock`."""


def foreign_formats(kind: type[Any]) -> Iterator[Variant[Any]]:
    """Yield each log format that an installed package adds; all are instances of `kind`."""
    for name in installed("log"):
        found: Variant[Any] = variant("log", name, {}, said=f"log reader {name}")
        found.of_kind(found.what, kind)
        yield found


def sound_log(reader: Variant[Any], given: object) -> FieldLog:
    """Return a third-party reader's log, if its poses are finite and in order of time."""
    log: FieldLog = reader.of_kind(given, FieldLog)
    if log.clock not in CLOCKS:
        raise reader.wrong(f"its clock is '{log.clock}'; known: {', '.join(CLOCKS)}")
    for poses in log.poses:
        count = len(poses.ns)
        reader.check_array(poses.ns, f"the times of {poses.source}", (count,))
        reader.check_array(poses.xy, f"the positions of {poses.source}", (count, 2))
        heading = np.asarray(poses.heading)
        reader.check_array(
            np.where(np.isnan(heading), 0.0, heading), f"the headings of {poses.source}", (count,)
        )
        if (np.diff(poses.ns) < 0).any():
            raise reader.wrong(f"the times of {poses.source} are not in order")
    return log
