"""Subject of a report: a mission with its plan, and any number of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.run_verdict import Judgement, judge
from stopgo.mission.document import Mission
from stopgo.mission.floor.polylines import FloorLines
from stopgo.mission.run.run_log import LogSource
from stopgo.mission.stages.figures import CoveragePair
from stopgo.mission.stages.plan_results import PlanResults
from stopgo.mission.stages.sight import Sight
from stopgo.mission.stages.stop_reasons import StopReason
from stopgo.recordings.embedded.findings import EmbeddedFindings


@dataclass(frozen=True, eq=False)
class ReportSubject:
    """One mission, or those that share a floor; what is not known is empty or None."""

    missions: tuple[Mission, ...]
    """Revisions in ascending order, of each mission; at least one."""
    comparisons: tuple[Comparison, ...] = ()
    """Runs of the missions, the earliest first."""
    sight: Sight | None = None
    """Visibility of the newest plan's stops."""
    floor: FloorLines | None = None
    results: PlanResults = field(default_factory=PlanResults)
    """Results of the plan's stages, by name."""
    reasons: tuple[StopReason, ...] = ()
    """Reasons for the stops of the newest plan."""
    found: EmbeddedFindings = field(default_factory=EmbeddedFindings)
    sources: tuple[LogSource, ...] = ()
    """Files that the report was made from."""
    problems: tuple[str, ...] = ()
    """Contradictions and missing data in these files."""

    judgements: Mapping[str | None, Judgement] = field(default_factory=dict)
    """Verdicts by run id that are not based on scans: for logs that contain no scans."""
    more: Mapping[str | None, tuple[tuple[str, tuple[str, ...]], ...]] = field(default_factory=dict)
    """Additional texts by run id: titles, each with its lines."""

    together: tuple[str, ...] = ()
    """Coverage that several runs acquired together, what is left, and what to do next."""
    rooms_together: tuple[CoveragePair, ...] = ()
    """Rooms as planned and as all runs acquired them together; empty without visibility data."""

    def judgement(self, run: Comparison) -> Judgement:
        """Return the verdict on a run, with its reasons."""
        return self.judgements.get(run.run_id) or judge(run)

    @property
    def mission(self) -> Mission:
        """Newest revision."""
        return self.missions[-1]

    @property
    def name(self) -> str:
        """Name of the mission, or of the floor with the number of its missions."""
        count = len({mission.id for mission in self.missions})
        return self.mission.name if count == 1 else f"{self.mission.origin.floor}, {count} missions"

    @property
    def title(self) -> str:
        what = "plan" if not self.comparisons else "run" if len(self.comparisons) == 1 else "runs"
        return f"{self.name}: {what}"
