"""Measures cross-track errors although events or poses come late, as from a journal after a link loss."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from stopgo.mission.comparing.path_deviation import PathFollower
from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.run_log import Track

BootTime = tuple[int, int]
"""Number of a boot within the run, and time on the robot's clock: times of two boots are never compared."""


class DelayedDeviation:
    """Keeps poses until all earlier events are known, and events until all earlier poses are known.

    Then it measures them as in a complete log.
    """

    def __init__(self, mission: Mission) -> None:
        self._follower = PathFollower(mission)
        self._events: deque[tuple[BootTime, AnyEvent, Mission]] = deque()
        self._poses: deque[tuple[int, Track]] = deque()
        self._boots: dict[str, int] = {}
        self._last_pose: BootTime | None = None
        self._newest = 0

    def event(self, event: AnyEvent, mission: Mission) -> None:
        """Take an event; `mission` is the revision that is followed after it."""
        moment = (self._boots.setdefault(event.boot_id, len(self._boots)), event.robot_ns)
        self._events.append((moment, event, mission))
        self._newest = max(self._newest, event.number)

    def poses(self, track: Track, boot_id: str = "") -> None:
        """Take poses, later ones after earlier ones; of an unnamed boot, those of the newest event's."""
        if not len(track):
            return
        last = max(self._boots.values(), default=0)
        boot = self._boots.setdefault(boot_id, len(self._boots)) if boot_id else last
        self._poses.append((boot, track))
        self._last_pose = (boot, int(track.ns[-1]))

    def knows(self, number: int) -> bool:
        """True if an event of this number, and with it every earlier one, has come."""
        return number <= self._newest

    def measured(self, until_ns: int | None = None) -> tuple[IntArray, FloatArray]:
        """Return times (n,) and cross-track errors (n,) of all poses up to a time, or of all.

        The time is of the newest pose's boot. Events after the newest pose wait: poses of before may come.
        """
        until = None if until_ns is None or self._last_pose is None else (self._last_pose[0], until_ns)
        times, parts = [np.empty(0, np.int64)], [np.empty((0, 2))]
        while self._events and self._is_due(self._events[0][0], until_ns):
            moment, event, mission = self._events.popleft()
            for track in self._taken(moment if until is None else min(moment, until)):
                times.append(track.ns)
                parts.append(self._follower.measure(track.xy))
            self._follower.take(event, mission)
        for track in self._taken(until):
            times.append(track.ns)
            parts.append(self._follower.measure(track.xy))
        return frozen(np.concatenate(times), np.int64), frozen(np.concatenate(parts)[:, 0])

    def _is_due(self, moment: BootTime, until_ns: int | None) -> bool:
        """True if no earlier pose can come: at the end, or once a later pose has come."""
        if until_ns is None:
            return True
        last = self._last_pose
        return last is not None and moment <= min(last, (last[0], until_ns))

    def _taken(self, until: BootTime | None) -> Iterator[Track]:
        """Yield and forget the poses up to a moment, or all."""
        while self._poses:
            boot, track = self._poses[0]
            if until is None or boot < until[0]:
                self._poses.popleft()
                yield track
                continue
            if boot > until[0]:
                return
            count = int(np.searchsorted(track.ns, until[1], side="right"))
            if count == len(track):
                self._poses.popleft()
            else:
                self._poses[0] = (boot, Track(track.ns[count:], track.xy[count:], track.heading[count:]))
            if count:
                yield Track(track.ns[:count], track.xy[:count], track.heading[:count])
            if count < len(track):
                return
