"""Check of an item by the simulated vehicle: the MAV_MISSION_RESULT of a refusal, else ACCEPTED."""

from __future__ import annotations

import math

from stopgo.bridge.mavlink.simulated.vehicle_store import FENCE, MISSION
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.enums import MissionResult
from stopgo.mission.mavlink.fields import PLACED
from stopgo.mission.mavlink.items import Item, MavFrame

ACCEPTED = MissionResult.ACCEPTED
FENCE_COMMANDS = range(5000, 5005)
RALLY_COMMANDS = range(5100, 5101)
GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})
PX4_FRAMES = frozenset({0, 3, 5, 6})
INVALID_PARAM = (
    MissionResult.INVALID_PARAM1, MissionResult.INVALID_PARAM2,
    MissionResult.INVALID_PARAM3, MissionResult.INVALID_PARAM4,
)  # fmt: skip
MAY_BE_NAN = {16: (3,), 17: (3,), 19: (3,), 21: (3,), 22: (3,), 2000: (1, 2, 3), 1000: (0, 1, 2, 3)}
"""Params that may be NaN, "not given", in a mission's item; nowhere else."""


def verdict(autopilot: Autopilot, kind: int, item: Item) -> int:
    """The MAV_MISSION_RESULT for one item of a mission, fence or rally list."""
    if kind != MISSION:
        return _of_area(kind, item)
    if item.command not in autopilot.behaviour.takes:
        return MissionResult.UNSUPPORTED
    placed = item.command in PLACED
    if autopilot.behaviour.checks_frame_first:
        return _frame_first(item, placed)
    if placed and item.frame not in GLOBAL_FRAMES | {MavFrame.MISSION}:
        return MissionResult.UNSUPPORTED_FRAME
    if placed and abs(item.z) >= autopilot.behaviour.highest_m:
        return MissionResult.INVALID_PARAM7
    return _of_numbers(item, MAY_BE_NAN.get(item.command, ())) or (_of_place(item) if placed else ACCEPTED)


def _frame_first(item: Item, placed: bool) -> int:
    """Check the frame first, and numbers hardly; positions off the earth are refused here."""
    if item.frame not in PX4_FRAMES | {MavFrame.MISSION}:
        return MissionResult.UNSUPPORTED_FRAME
    if placed != (item.frame in PX4_FRAMES):
        return MissionResult.UNSUPPORTED
    return _of_numbers(item, (0, 1, 2, 3)) or (_of_place(item) if placed else ACCEPTED)


def _of_area(kind: int, item: Item) -> int:
    if item.command not in (FENCE_COMMANDS if kind == FENCE else RALLY_COMMANDS):
        return MissionResult.UNSUPPORTED
    if item.frame not in GLOBAL_FRAMES:
        return MissionResult.UNSUPPORTED_FRAME
    return _of_numbers(item, (1, 2, 3)) or _of_place(item)


def _of_numbers(item: Item, may_be_nan: tuple[int, ...]) -> int:
    for index, value in enumerate(item.params):
        if math.isinf(value) or (math.isnan(value) and index not in may_be_nan):
            return int(INVALID_PARAM[index])
    return ACCEPTED if math.isfinite(item.z) else int(MissionResult.INVALID_PARAM7)


def _of_place(item: Item) -> int:
    if abs(item.x) > 90 * STEPS_PER_DEGREE:
        return int(MissionResult.INVALID_PARAM5_X)
    if abs(item.y) > 180 * STEPS_PER_DEGREE:
        return int(MissionResult.INVALID_PARAM6_Y)
    return int(ACCEPTED)
