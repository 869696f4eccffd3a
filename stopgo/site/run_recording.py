"""Recording of a robot's present run in the site's folder.

A recording begins with the run's plan, which may take seconds to read. Reports of that time are kept, and
handed over when the plan is there.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack

from stopgo.bridge.station.follow import Followed
from stopgo.bridge.station.watch import hand_over
from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError, StopgoError
from stopgo.site.event_feed import EventFeed
from stopgo.site.known_missions import KnownMission

OpenRecording = Callable[[str, str, KnownMission | None], AbstractContextManager[RunCollector]]
"""Opens the collector of a run, by robot, run id and mission."""


class RunRecording:
    """Recorder of one robot's runs, one after the other; used by the robot's own thread."""

    def __init__(
        self, robot: str, feed: EventFeed, recorder: OpenRecording, mission: Callable[[str, int], Mission]
    ) -> None:
        self._robot = robot
        self._feed = feed
        self._recorder = recorder
        self._mission = mission
        """Reads a revision of a mission from the robot."""
        self._run_id = ""
        self._plan_reader: threading.Thread | None = None
        self._known: Callable[[], KnownMission | None] = lambda: None
        self._early: list[Followed] | None = None
        """Reports of a run whose plan is being read; None when its recording has begun."""
        self._open = ExitStack()
        self._collector: RunCollector | None = None
        self._recorded: set[tuple[str, int]] = set()
        """Missions in the recording, by id and revision."""

    @property
    def is_open(self) -> bool:
        """True from the begin of a run to the end of its recording."""
        return self._early is not None or self._collector is not None

    def begin(
        self, run_id: str, plan_reader: threading.Thread | None, known: Callable[[], KnownMission | None]
    ) -> None:
        """Begin the recording of a run, when the thread that reads its plan has ended."""
        self.close()
        self._run_id, self._plan_reader, self._known = run_id, plan_reader, known
        self._early = []
        self._begin_if_planned()

    def take(self, report: Followed) -> None:
        """Record a report of the run."""
        self._begin_if_planned()
        if self._early is not None:
            self._early.append(report)
        elif self._collector is not None:
            self._hand_over(self._collector, report)

    def close(self) -> None:
        """Write what is left of the recording, and end it; waits for the plan if that is still being read."""
        if self._early is not None and self._plan_reader is not None:
            self._plan_reader.join()
            self._begin_if_planned()
        collector, self._collector = self._collector, None
        self._recorded = set()
        if collector is not None:
            try:
                self._open.close()
            except StopgoError as error:
                self._show(str(error))
            else:
                self._show("", over=True)

    def _begin_if_planned(self) -> None:
        early, reader = self._early, self._plan_reader
        if early is None or (reader is not None and reader.is_alive()):
            return
        self._early = None
        try:
            opened = self._recorder(self._robot, self._run_id, self._known())
            self._collector = collector = self._open.enter_context(opened)
        except InputError as error:
            self._show(str(error))
            return
        self._show("")
        for report in early:
            self._hand_over(collector, report)

    def _hand_over(self, collector: RunCollector, report: Followed) -> None:
        """Record a report, the revision of the mission that it names first."""
        mission, revision = getattr(report, "mission_id", None), getattr(report, "revision", None)
        if mission is not None and revision is not None and (mission, revision) not in self._recorded:
            self._recorded.add((mission, revision))
            collector.mission(self._mission(mission, revision))
        hand_over(collector, report)

    def _show(self, trouble: str, **more: bool) -> None:
        value = {"run": self._run_id, "trouble": trouble, **more}
        self._feed.tell(("recording", self._robot), value)
