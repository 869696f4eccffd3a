"""Limits at which a target counts as covered: incidence, distance, point spacing, and number of stops."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msgspec import UNSET, UnsetType

from stopgo.mission.document import LimitsSpec
from stopgo.mission.settings import Settings

SCANNER_HEIGHT_M = 1.3
"""Assumed height of a scanner whose height is not given."""


@dataclass(frozen=True, kw_only=True)
class ViewLimits:
    """Limits on a line of sight, in addition to being free and within range.

    The point spacing on a target at distance d and incidence i is d · step / cos i: the distance of two
    neighbouring points on a wall.
    """

    max_incidence: float | None = None
    """Radians from the face's normal; None for any."""
    near: float = 0.0
    """Minimum distance from the scanner in metres."""
    spacing: float | None = None
    """Metres between neighbouring points; None for any."""
    step: float | None = None
    """Radians between neighbouring rays; known if `spacing` is."""
    rise: float = 0.0
    """Metres above and below the scanner up to which incidence and spacing must hold."""

    @property
    def none(self) -> bool:
        """True if there is no limit."""
        return self.max_incidence is None and self.near <= 0 and self.spacing is None

    @property
    def farthest_per_height(self) -> float | None:
        """Metres k such that the spacing holds where d² <= k h, h being the distance from the face's line."""
        if self.spacing is None or self.step is None:
            return None
        return self.spacing / self.step


def limits_of(settings: Settings) -> ViewLimits:
    """Return the limits of the parameters.

    The scanner does not see a cone below it. A wall is visible down to its foot only from outside the cone's
    radius on the floor, so that smaller distances count as too near.
    """
    incidence, step, spacing = settings.most_incidence, settings.angular_step, most_spacing_mm(settings)
    return ViewLimits(
        max_incidence=None if incidence is None else math.radians(incidence),
        near=blind_range(settings),
        spacing=None if spacing is None else spacing / 1000,
        step=None if step is None else math.radians(step),
        rise=rise_of(settings),
    )


def most_spacing_mm(settings: Settings) -> float | None:
    """Return the largest distance between neighbouring points, mm; None if the angular step is not known.

    Without a density it is a unit's length, so that a point falls on every unit; with the paper's rule any.
    """
    known = settings.angular_step is not None and settings.coverage_rule != "paper"
    if settings.density is None and known:
        return round(1000 * settings.d_dis, 6)
    return settings.density


def rise_of(settings: Settings) -> float:
    """Return the metres from the scanner up to the required height, or down to the floor if that is more."""
    if settings.wall_height is None:
        return 0.0
    height = scanner_height(settings)
    return max(height, settings.wall_height - height)


def blind_range(settings: Settings) -> float:
    """Return the radius in metres in which the scanner does not see, or does not see the foot of a wall."""
    cone = math.radians(blind_cone_deg(settings))
    return max(settings.near or 0.0, round(scanner_height(settings) * math.tan(cone / 2), 6))


def blind_cone_deg(settings: Settings) -> float:
    """Return the opening angle of the blind cone below the scanner; 0 if the settings have none."""
    return settings.blind_cone or 0.0


def scanner_height(settings: Settings) -> float:
    """Return the metres from the floor to the scanner."""
    return settings.scanner_height or section_height(settings)


def section_height(settings: Settings) -> float:
    """Return the metres from the floor to the section of its model that the floor is drawn by."""
    return settings.scan_height or SCANNER_HEIGHT_M


def limits_in_words(limits: LimitsSpec | UnsetType, *, brief: bool = False) -> dict[str, str]:
    """Return the texts of the limits, by the parameters that set them."""
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
