"""Parameters of the search: extra candidates, limits, the seed, and the origin on Earth."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from stopgo.mission.settings.parameter import Parameter

_plan = partial(Parameter, "plan", group="Quality")


@dataclass(frozen=True, kw_only=True)
class SearchParameters:
    """Table `plan`: extra candidates and limits of the search."""

    refine: Annotated[
        bool | None, _plan("Offer positions near the chosen stops too", undecided="up to 25 stops")
    ] = None
    door_scan: Annotated[bool, _plan("Add a stop in every doorway driven through")] = False
    door_candidates: Annotated[bool, _plan("Offer doorways as candidates")] = False
    node_limit: Annotated[int, _plan("Maximum nodes of the exact selector's search", least=0)] = 20_000
    time_limit: Annotated[
        float | None, _plan("Time limit of that search; plans then depend on the machine", "s", above=0)
    ] = None
    origin: Annotated[
        tuple[float, float, float, float] | None,
        _plan(
            "Position of the drawing's origin on Earth, and the bearing of its +y axis",
            "degrees and m",
            group="Floor",
            form="LAT,LON,ALT,HEADING",
            example="47.3769,8.5417,408,0",
        ),
    ] = None
    seed: Annotated[int, _plan("Seed of the tour search", least=0)] = 1
