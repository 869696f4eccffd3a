"""Measures cross-track errors although events come late, as from a journal after a link loss."""

from __future__ import annotations

from collections import deque

import numpy as np

from stopgo.mission.comparing.path_deviation import PathFollower
from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.run_log import Track


class DelayedDeviation:
    """Keeps poses until all earlier events are known; then measures them as in a complete log."""

    def __init__(self, mission: Mission) -> None:
        self._follower = PathFollower(mission)
        self._events: deque[tuple[AnyEvent, Mission]] = deque()
        self._poses: list[Track] = []
        self._newest = 0

    def event(self, event: AnyEvent, mission: Mission) -> None:
        """Take an event; `mission` is the revision that is followed after it."""
        self._events.append((event, mission))
        self._newest = max(self._newest, event.number)

    def poses(self, track: Track) -> None:
        """Take poses, later ones after earlier ones."""
        self._poses.append(track)

    def knows(self, number: int) -> bool:
        """True if an event of this number, and with it every earlier one, has come."""
        return number <= self._newest

    def measured(self, until_ns: int | None = None) -> tuple[IntArray, FloatArray]:
        """Return times (n,) and cross-track errors (n,) of all poses up to a time, or of all."""
        track = _joined(self._poses)
        end = len(track) if until_ns is None else int(np.searchsorted(track.ns, until_ns, side="right"))
        parts, begin = [np.empty((0, 2))], 0
        while self._events and (until_ns is None or self._events[0][0].robot_ns <= until_ns):
            event, mission = self._events.popleft()
            behind = max(begin, min(end, int(np.searchsorted(track.ns, event.robot_ns, side="right"))))
            parts.append(self._follower.measure(track.xy[begin:behind]))
            self._follower.take(event, mission)
            begin = behind
        parts.append(self._follower.measure(track.xy[begin:end]))
        self._poses = [Track(track.ns[end:], track.xy[end:], track.heading[end:])]
        return frozen(track.ns[:end], np.int64), frozen(np.concatenate(parts)[:, 0])


def _joined(tracks: list[Track]) -> Track:
    return Track.of(
        np.concatenate([np.empty(0, np.int64), *(track.ns for track in tracks)]),
        np.concatenate([np.empty((0, 2)), *(track.xy for track in tracks)]),
        np.concatenate([np.empty(0), *(track.heading for track in tracks)]),
    )
