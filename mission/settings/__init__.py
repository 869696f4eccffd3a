"""Every parameter of a plan, declared once: type, default, unit, limits, and its purpose.

plan.toml is read and printed from this declaration, `stopgo plan` gets its options from it, and values are
checked against it. Each module `*_parameters` holds one table; a new parameter is one more field there, and
nothing else. What a person types is metres, seconds and degrees, as here; docs/background/planning.md
explains each parameter. Fields keep the names that mission.json has; where people use another word, the
declaration has it as `word`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, get_type_hints

from stopgo.mission.settings.coverage_parameters import CoverageParameters
from stopgo.mission.settings.floor_parameters import FloorParameters
from stopgo.mission.settings.method_parameters import MethodParameters
from stopgo.mission.settings.parameter import Parameter
from stopgo.mission.settings.policy_parameters import PolicyParameters
from stopgo.mission.settings.robot_parameters import RobotParameters
from stopgo.mission.settings.route_parameters import RouteParameters
from stopgo.mission.settings.scanner_parameters import ScannerParameters
from stopgo.mission.settings.search_parameters import SearchParameters
from stopgo.mission.settings.space_parameters import SpaceParameters


@dataclass(frozen=True, kw_only=True)
class Settings(
    PolicyParameters,
    ScannerParameters,
    RobotParameters,
    SearchParameters,
    RouteParameters,
    SpaceParameters,
    CoverageParameters,
    MethodParameters,
    FloorParameters,
):
    """All parameters of a plan, table by table. `None` means: decided from the others or from the floor.

    A dataclass has the fields of its last base first: the order is that of mission.json, from the floor to
    the policy.
    """

    @property
    def tour_limit(self) -> tuple[str, float] | None:
        """The parameter that limits the duration of a tour, and its seconds; None without a limit."""
        limits = [(key, value) for key in ("shift", "battery") if (value := getattr(self, key)) is not None]
        return min(limits, key=lambda limit: limit[1], default=None)

    @property
    def divided(self) -> bool:
        """True if several tours or robots share the stops."""
        return self.tour_limit is not None or self.robots is not None

    @property
    def radius(self) -> float:
        """The robot's radius in metres: half of the least door width unless given."""
        return self.door_access / 2 if self.robot_radius is None else self.robot_radius


def _declared() -> dict[str, Parameter]:
    """Each parameter with its name, type and default."""
    hints = get_type_hints(Settings, include_extras=True)
    return {
        field.name: replace(
            hints[field.name].__metadata__[0],
            name=field.name,
            type=hints[field.name].__origin__,
            default=field.default,
        )
        for field in fields(Settings)
    }


PARAMETERS = _declared()
"""Every parameter of a plan by its name in missions, in the order of their declaration."""
FLOOR_PARAMETERS = tuple(name for name, item in PARAMETERS.items() if item.section == "floor")
"""Those that choose and shape the floor that is read."""


def recorded_values(settings: Settings) -> dict[str, Any]:
    """The settings as missions record them: by name, as JSON holds them."""
    import msgspec

    values = msgspec.to_builtins(settings)
    return {name: value for name, value in values.items() if not PARAMETERS[name].left_out(value)}
