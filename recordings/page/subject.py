"""What a report is of: a mission with its plan, and any number of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.run_verdict import Judgement, judge
from stopgo.mission.document import Mission
from stopgo.mission.run.run_log import LogSource
from stopgo.mission.stages.sight import Sight
from stopgo.mission.stages.stop_reasons import StopReason
from stopgo.recordings.embedded.findings import CarriedFindings
from stopgo.recordings.embedded.floor_lines import FloorLines


@dataclass(frozen=True, eq=False)
class ReportSubject:
    """One mission; what is not known of it is empty or None."""

    missions: tuple[Mission, ...]
    """Its revisions, in ascending order; at least one."""
    comparisons: tuple[Comparison, ...] = ()
    """Its runs, the one begun first before others."""
    sight: Sight | None = None
    """What its newest plan's stops see."""
    floor: FloorLines | None = None
    results: dict[str, Any] = field(default_factory=dict)
    """What the stages of the plan came to, by name."""
    reasons: tuple[StopReason, ...] = ()
    """Why the stops of the newest plan are there."""
    found: CarriedFindings = field(default_factory=CarriedFindings)
    sources: tuple[LogSource, ...] = ()
    """The files that it was made from."""
    problems: tuple[str, ...] = ()
    """What of these files is missing or contradicts itself."""

    judgements: Mapping[str | None, Judgement] = field(default_factory=dict)
    """What is answered of a run otherwise than by its scans, by run id: of logs that tell of none."""
    told: Mapping[str | None, tuple[tuple[str, tuple[str, ...]], ...]] = field(default_factory=dict)
    """What else is told of a run, by run id: titles, each with its lines."""

    def judgement(self, run: Comparison) -> Judgement:
        """What is answered of a run, and why."""
        return self.judgements.get(run.run_id) or judge(run)

    @property
    def mission(self) -> Mission:
        """The newest revision."""
        return self.missions[-1]

    @property
    def title(self) -> str:
        what = "plan" if not self.comparisons else "run" if len(self.comparisons) == 1 else "runs"
        return f"{self.mission.name}: {what}"
