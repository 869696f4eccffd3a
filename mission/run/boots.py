"""Boots of a robot within one run: their events and poses in the order of the boots, on one time axis.

The clock of a restarted robot may be behind its last one. Times of two boots are therefore never compared. A
boot that begins before the end of the last one is shifted behind it, and a note says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import msgspec
import numpy as np

from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.run_log import Track

UNKNOWN = ""
"""Boot of poses in recordings that do not name it."""
APART_NS = 1_000_000
"""Time from the end of a boot to the shifted begin of the next; the true time is unknown."""


@dataclass(frozen=True, eq=False)
class JoinedBoots:
    """Events and poses of a run on one time axis."""

    events: tuple[AnyEvent, ...]
    poses: Track
    notes: tuple[str, ...] = ()


def joined_boots(events: Sequence[AnyEvent], poses: Mapping[str, Track]) -> JoinedBoots:
    """Join the boots of a run: `events` in the order of their numbers, `poses` by boot id."""
    order = _order(events, poses)
    if len(order) <= 1:
        return JoinedBoots(tuple(events), poses.get(order[0], Track.empty()) if order else Track.empty())
    if UNKNOWN in poses and UNKNOWN not in {event.boot_id for event in events}:
        return _without_boots(events, order, poses[UNKNOWN])
    return _joined(events, order, poses)


def _order(events: Iterable[AnyEvent], poses: Mapping[str, Track]) -> list[str]:
    """Return boot ids in the order of their events; boots without an event go where their clock says."""
    order = list(dict.fromkeys(event.boot_id for event in events))
    begins = {boot: int(track.ns[0]) for boot, track in poses.items() if len(track)}
    for boot in sorted(begins, key=begins.__getitem__):
        if boot not in order:
            earlier = [k for k, other in enumerate(order) if begins.get(other, 0) <= begins[boot]]
            order.insert(earlier[-1] + 1 if earlier else 0, boot)
    return order


def _joined(events: Sequence[AnyEvent], order: Sequence[str], poses: Mapping[str, Track]) -> JoinedBoots:
    joined: list[AnyEvent] = []
    tracks: list[Track] = []
    restarts: list[int] = []
    notes: list[str] = []
    end: int | None = None
    for boot in order:
        track = poses.get(boot, Track.empty())
        mine = [event for event in events if event.boot_id == boot]
        times = [event.robot_ns for event in mine] + track.ns[:1].tolist() + track.ns[-1:].tolist()
        if not times:
            continue
        shift = 0 if end is None or min(times) > end else end + APART_NS - min(times)
        if shift:
            notes.append(
                f"the robot restarted and its clock went back {shift / 1e9:.1f} s; later times are shifted"
            )
        if end is not None:
            restarts.append(min(times) + shift)
        joined += [_shifted(event, shift) for event in mine]
        tracks.append(Track(track.ns + shift, track.xy, track.heading))
        end = max(times) + shift
    whole = Track.of(
        np.concatenate([track.ns for track in tracks]),
        np.concatenate([track.xy for track in tracks]),
        np.concatenate([track.heading for track in tracks]),
        restarts_ns=restarts,
    )
    return JoinedBoots(tuple(sorted(joined, key=lambda event: event.number)), whole, tuple(notes))


def _shifted(event: AnyEvent, shift_ns: int) -> AnyEvent:
    if not shift_ns:
        return event
    seconds = event.mission_time_s + shift_ns / 1e9
    return msgspec.structs.replace(event, robot_ns=event.robot_ns + shift_ns, mission_time_s=seconds)


def _without_boots(events: Sequence[AnyEvent], order: Sequence[str], poses: Track) -> JoinedBoots:
    """Join the boots of a recording that does not name the boots of its poses."""
    boots = [boot for boot in order if boot != UNKNOWN]
    edges = [[event.robot_ns for event in events if event.boot_id == boot] for boot in boots]
    if any(min(after) <= max(before) for before, after in pairwise(edges)):
        joined = _joined(events, boots, {})
        note = "its poses are left out: at a restart the clock went back, so their order is unknown"
        return JoinedBoots(joined.events, joined.poses, (*joined.notes, note))
    restarts = [min(after) for after in edges[1:]]
    track = Track.of(poses.ns, poses.xy, poses.heading, restarts_ns=restarts)
    return JoinedBoots(tuple(events), track)
