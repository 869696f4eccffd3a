"""Parameters of the robot."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from stopgo.mission.settings.parameter import Parameter, seconds

_robot = partial(Parameter, "robot", group="Robot")


@dataclass(frozen=True, kw_only=True)
class RobotParameters:
    """Table `robot` of plan.toml."""

    robot_radius: Annotated[
        float | None,
        _robot("Radius of the robot", "m", first=True, above=0, undecided="half of min_door_width"),
    ] = None
    speed: Annotated[float, _robot("Speed of the robot", "m/s", least=0.001)] = 0.5
    turn_rate: Annotated[float, _robot("Turn rate of the robot", "degrees/s", least=0.01)] = 45.0
    battery: Annotated[
        float | None,
        _robot(
            "Runtime per charge; it limits tours as a shift does",
            "s",
            group="Fleet",
            above=0,
            form="DURATION",
            example="5400, 90min or 1h30min",
            read=seconds,
            quiet=True,
            word="battery_life",
        ),
    ] = None
    acceleration: Annotated[float, _robot("Acceleration of the robot", "m/s²", least=0.001)] = 0.5
