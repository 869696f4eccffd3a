"""Parts of a mission that follow from the parameters alone, planned or imported."""

from __future__ import annotations

import math
from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from stopgo.mission import __version__
from stopgo.mission.document import LimitsSpec, Origin, Policy, RobotSpec, Scan, ScannerSpec
from stopgo.mission.document.limits import blind_range, most_spacing_mm
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.settings import FLOOR_PARAMETERS, Settings, recorded_values

DECIMALS = 6
"""Missions hold micrometres and microradians: more digits would be float noise."""
SCAN_TIMEOUT = 2.0
"""A scan may take this many times its planned duration, and at least SCAN_PATIENCE more."""
SCAN_PATIENCE = 30.0


def robot_of(settings: Settings) -> RobotSpec:
    """Return the robot, with its turn rate in radians per second."""
    return RobotSpec(
        radius=settings.radius,
        speed=settings.speed,
        turn_rate=rounded(math.radians(settings.turn_rate)),
        acceleration=settings.acceleration,
    )


def scanner_of(settings: Settings) -> ScannerSpec:
    """Return the scanner, with all that is known of it."""
    facts: dict[str, Any] = {
        "model": settings.scanner,
        "step_deg": settings.angular_step,
        "near": settings.near,
        "blind_cone_deg": settings.blind_cone,
        "height": settings.scanner_height,
    }
    known = {key: value for key, value in facts.items() if value is not None}
    return ScannerSpec(profile=settings.profile, range=settings.range, fov_deg=settings.fov, **known)


def limits_spec_of(settings: Settings) -> LimitsSpec | UnsetType:
    """Return the limits at which a target counts as covered; absent if there is no limit."""
    limits = {
        "max_incidence_deg": settings.most_incidence,
        "near": blind_range(settings) or None,
        "density_mm": most_spacing_mm(settings),
        "wall_height": settings.wall_height,
        "views": settings.least_views if settings.least_views > 1 else None,
    }
    known: dict[str, Any] = {key: value for key, value in limits.items() if value is not None}
    return LimitsSpec(**known) if known else UNSET


def policy_of(settings: Settings) -> Policy:
    """Return the robot's reaction to failures during the run."""
    return Policy(
        link_loss=settings.link_loss,
        link_loss_after_s=settings.link_loss_after,
        battery_min=settings.battery_min,
        own_way=True if settings.own_way else UNSET,
    )


def scan_of(profile: str, duration_s: float) -> Scan:
    """Return a scan, with its timeout."""
    timeout_s = max(SCAN_TIMEOUT * duration_s, duration_s + SCAN_PATIENCE)
    return Scan(profile=profile, duration_s=duration_s, timeout_s=timeout_s)


def site_origin_of(settings: Settings) -> SiteOrigin | None:
    """Return the georeference, if one is set."""
    if settings.origin is None:
        return None
    lat, lon, alt, heading_deg = settings.origin
    return SiteOrigin(lat=lat, lon=lon, alt=alt, heading_deg=heading_deg)


def origin_of(settings: Settings, *, floor: str, digest: str) -> Origin:
    """Return the mission's source: the file's name and digest, and every parameter that was decided."""
    told = msgspec.json.decode(msgspec.json.encode(recorded_values(settings)))
    parameters = {
        key: value for key, value in told.items() if value not in (None, []) or key not in FLOOR_PARAMETERS
    }
    return Origin(floor=floor, floor_digest=digest, parameters=parameters, stopgo=__version__)


def rounded(value: float) -> float:
    """Return a plain number without float noise, and never minus zero."""
    return round(float(value), DECIMALS) + 0.0
