"""Visibility of a mission's stops, embedded in a recording: arrays in one entity per revision."""

from __future__ import annotations

from collections.abc import Sized

import numpy as np
import rerun as rr

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import IntArray, frozen
from stopgo.mission.stages import Targets
from stopgo.mission.stages.coverage_totals import CoverageTotals, Group, Seen
from stopgo.mission.stages.sight import SeenFrom, Sight
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.values import Cells, Values

NOT_REQUIRED = -1.0
"""Value for a fraction that is not required."""


def embed_sight(canvas: Canvas, sight: Sight) -> None:
    """Embed what the stops of a revision see."""
    values = {name: value for name, value in _values(sight).items() if len(value)}
    canvas.show(entities.sight(sight.revision), rr.DynamicArchetype("Sight", components=values))


def sights_in(values: Values, name: str) -> tuple[Sight, ...]:
    """Return what the stops of each revision see, in ascending order; error messages begin with `name`.

    Raises
    ------
    InputError
        When the arrays do not fit each other.
    """
    found = []
    for row in values.below(entities.SIGHT):
        try:
            found.append(_sight(row))
        except (KeyError, ValueError, IndexError) as error:
            raise InputError(f"{name}: visibility of its stops is damaged ({error}); plan again") from None
    return tuple(sorted(found, key=lambda sight: sight.revision))


def _values(sight: Sight) -> dict[str, Sized]:
    targets, totals = sight.targets, sight.totals
    first = targets.first_unit[:-1]
    asked = np.broadcast_to(totals.asked, len(totals.weight))
    change = _changes(np.stack([totals.room, totals.visible, asked], axis=1))
    more = {"asked": asked[change].astype(np.int32)} if (asked > 1).any() else {}
    shares = [_encoded_fraction(totals.required), _encoded_fraction(totals.kind_required)]
    return {
        "mission": [sight.mission_id, sight.digest, totals.rule],
        "revision": np.array([sight.revision]),
        "shares": np.array(shares),
        "a": targets.a.ravel(),
        "b": targets.b.ravel(),
        "units": targets.units.astype(np.int32),
        "weight": totals.weight[first],
        "element": targets.element.astype(np.int32),
        "element_ids": [item.id for item in totals.elements],
        "element_kinds": [item.kind for item in totals.elements],
        "change": change.astype(np.int32),
        "room": totals.room[change].astype(np.int32),
        "visible": totals.visible[change],
        **more,
        "room_names": [group.name for group in totals.rooms],
        "room_why": [group.why for group in totals.rooms],
        "room_shares": np.array([_encoded_fraction(group.required) for group in totals.rooms]),
        "stop_ids": [stop.id for stop in sight.stops],
        "stop_xy": np.array([(stop.x, stop.y) for stop in sight.stops]).ravel(),
        "pointer": sight.pointer.astype(np.int32),
        "first": sight.first.astype(np.int32),
        "last": sight.last.astype(np.int32),
    }


def _changes(rows: np.ndarray) -> IntArray:
    """Return the rows that differ from the row before, including the first."""
    if not len(rows):
        return frozen([], np.int64)
    return frozen(np.flatnonzero(np.concatenate([[True], np.any(rows[1:] != rows[:-1], axis=1)])), np.int64)


def _encoded_fraction(fraction: float | None) -> float:
    return NOT_REQUIRED if fraction is None else fraction


def _decoded_fraction(fraction: float) -> float | None:
    return None if fraction == NOT_REQUIRED else float(fraction)


def _sight(row: Cells) -> Sight:
    mission_id, digest, rule = row["mission"]
    units = np.asarray(row["units"], dtype=np.int64)
    targets = Targets(
        a=frozen(row["a"].reshape(-1, 2)),
        b=frozen(row["b"].reshape(-1, 2)),
        units=frozen(units, np.int64),
        element=frozen(row["element"], np.int64),
        occluding=frozen(np.zeros(len(units)), np.bool_),
        raw={},
    )
    stops = zip(row.get("stop_ids", ()), row.get("stop_xy", np.empty(0)).reshape(-1, 2), strict=True)
    first, last = (frozen(row.get(name, []), np.int64) for name in ("first", "last"))
    pointer = frozen(row["pointer"], np.int64)
    if len(first) != len(last) or pointer[-1] != len(first) or not _within(first, last, targets.total):
        raise ValueError("ranges of units do not fit")
    return Sight(
        mission_id=mission_id,
        revision=int(row["revision"][0]),
        digest=digest,
        targets=targets,
        totals=_coverage_totals(row, targets, "paper" if rule == "paper" else "length"),
        stops=tuple(SeenFrom(name, float(xy[0]), float(xy[1])) for name, xy in stops),
        pointer=pointer,
        first=first,
        last=last,
    )


def _within(first: IntArray, last: IntArray, total: int) -> bool:
    return bool(np.all(first >= 0) and np.all(first <= last) and np.all(last < total))


def _coverage_totals(row: Cells, targets: Targets, rule: str) -> CoverageTotals:
    total = targets.total
    change = np.asarray(row["change"], dtype=np.int64)
    counts = np.diff(np.concatenate([change, [total]]))
    rooms = zip(row["room_names"], row["room_shares"], row["room_why"], strict=True)
    return CoverageTotals(
        rule="paper" if rule == "paper" else "length",
        weight=frozen(np.asarray(row["weight"])[targets.unit_segment], np.int64),
        visible=frozen(np.repeat(row["visible"], counts), np.bool_),
        room=frozen(np.repeat(row["room"], counts), np.int64),
        element=frozen(targets.element[targets.unit_segment], np.int64),
        rooms=tuple(Group(name, _decoded_fraction(fraction), why) for name, fraction, why in rooms),
        elements=tuple(Seen(*pair) for pair in zip(row["element_ids"], row["element_kinds"], strict=True)),
        required=_decoded_fraction(row["shares"][0]),
        kind_required=_decoded_fraction(row["shares"][1]),
        asked=frozen(np.repeat(row["asked"], counts) if "asked" in row else [1], np.int64),
    )
