"""Parameters of the policy: the robot's reaction to a failed scan, a lost link or a low battery."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from stopgo.mission.settings.parameter import Parameter

_policy = partial(Parameter, "policy", group="Robot")


@dataclass(frozen=True, kw_only=True)
class PolicyParameters:
    """Table `policy` of plan.toml."""

    tolerance: Annotated[
        float, _policy("Maximum position error of the robot at the start of a scan", "m", above=0)
    ] = 0.05
    on_failure: Annotated[
        Literal["retry", "skip", "ask", "abort", "home"], _policy("Reaction to a failed scan")
    ] = "ask"
    retries: Annotated[int, _policy("Repetitions of a failed scan", least=0)] = 1
    link_loss: Annotated[
        Literal["continue", "finish_stop", "hold", "home"], _policy("Reaction to link loss")
    ] = "continue"
    link_loss_after: Annotated[float, _policy("Duration of a link loss until then", "s", least=0)] = 30.0
    own_way: Annotated[
        bool,
        _policy("The robot may leave the legs and find its own way to each stop, if it can", quiet=True),
    ] = False
    battery_min: Annotated[
        float, _policy("Minimum charge with which the run goes on", least=0, below=1, why="0.15 is 15 %")
    ] = 0.15
