"""When a target counts as seen: how flat, how near, how finely scanned, and from how many stops."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msgspec import UNSET, UnsetType

from stopgo.mission.document import LimitsSpec
from stopgo.mission.settings import Settings

SCANNER_HEIGHT_M = 1.3
"""Of a scanner of which nobody says how high it stands."""


@dataclass(frozen=True, kw_only=True)
class ViewLimits:
    """What a line of sight must be, besides within range and free.

    The spacing at a target, at distance d and incidence i, is d · step / cos i: how far two neighbouring
    points lie apart on a wall.
    """

    max_incidence: float | None = None
    """Radians from the face's normal; None where any will do."""
    near: float = 0.0
    """Metres from the scanner."""
    spacing: float | None = None
    """Metres between neighbouring points; None where any will do."""
    step: float | None = None
    """Radians between neighbouring rays; known where `spacing` is."""
    rise: float = 0.0
    """Metres above and below the scanner up to which incidence and spacing must hold."""

    @property
    def none(self) -> bool:
        """Whether there is no limit at all."""
        return self.max_incidence is None and self.near <= 0 and self.spacing is None

    @property
    def farthest_per_height(self) -> float | None:
        """Metres k such that the spacing holds where d² <= k h, h being the distance from the face's line."""
        if self.spacing is None or self.step is None:
            return None
        return self.spacing / self.step


def limits_of(settings: Settings) -> ViewLimits:
    """The limits that the settings ask for.

    Under the scanner lies a cone it does not see. A wall is seen down to its foot from as far as the cone
    reaches on the floor: nearer than that counts as too near.
    """
    incidence, density, step = settings.max_incidence, settings.density, settings.angular_step
    return ViewLimits(
        max_incidence=None if incidence is None else math.radians(incidence),
        near=blind_range(settings),
        spacing=None if density is None else density / 1000,
        step=None if step is None else math.radians(step),
        rise=rise_of(settings),
    )


def rise_of(settings: Settings) -> float:
    """Metres from the scanner up to the height asked for, or down to the floor if that is more."""
    if settings.wall_height is None:
        return 0.0
    height = scanner_height(settings)
    return max(height, settings.wall_height - height)


def blind_range(settings: Settings) -> float:
    """Metres round the scanner in which it does not see, or does not see the foot of a wall."""
    cone = math.radians(settings.blind_cone or 0.0)
    return max(settings.near or 0.0, round(scanner_height(settings) * math.tan(cone / 2), 6))


def scanner_height(settings: Settings) -> float:
    """Metres from the floor to the scanner."""
    return settings.scanner_height or settings.scan_height or SCANNER_HEIGHT_M


def limits_in_words(limits: LimitsSpec | UnsetType, *, brief: bool = False) -> dict[str, str]:
    """The limits that there are, by the parameters that set them, as people read them."""
    if isinstance(limits, UnsetType):
        return {}
    told = {
        "max_incidence": (limits.max_incidence_deg, "up to {:g}°", "≤ {:g}°"),
        "near": (limits.near, "from {:.3g} m on", "≥ {:.3g} m"),
        "density": (limits.density_mm, "points at most {:g} mm apart", "≤ {:g} mm"),
        "wall_height": (limits.wall_height, "over walls of {:g} m", "walls {:g} m"),
        "views": (limits.views, "from {:g} stops", "{:g} stops"),
    }
    known = {key: item for key, item in told.items() if item[0] is not UNSET}
    return {key: (short if brief else words).format(value) for key, (value, words, short) in known.items()}
