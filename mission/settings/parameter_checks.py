"""Checks of a plan's settings: each value by its own limits, then those that depend on one another."""

from __future__ import annotations

import datetime
from typing import NoReturn

from stopgo.mission.errors import InputError
from stopgo.mission.settings import PARAMETERS, Settings
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.mission.settings.given_heights import heights_by_kind
from stopgo.mission.settings.layer_kinds import check_entries
from stopgo.mission.settings.parameter import HIGHEST_M
from stopgo.mission.settings.scanners import SCANNERS


def check_settings(settings: Settings) -> None:
    """Refuse values that no plan can be made with.

    Raises
    ------
    InputError
        Naming the option, its value, and what would be right.
    """
    for key, parameter in PARAMETERS.items():
        parameter.check(getattr(settings, key))
    _check_coverage(settings)
    _check_registration(settings)
    _check_scanner(settings)
    _check_starts(settings)
    _check_division(settings)
    _check_days(settings)
    _check_lists(settings)
    _check_region(settings)
    if settings.tour == "closed" and settings.end is not None:
        raise InputError("--tour closed and --end are both given; a closed tour ends at its start")


def _refuse(settings: Settings, key: str, problem: str) -> NoReturn:
    """Refuse a parameter with its value, in the form of its option."""
    raise InputError(f"{PARAMETERS[key].shown(getattr(settings, key))}: {problem}")


def _check_coverage(settings: Settings) -> None:
    """Refuse what a coverage rule or a field of view has no use for."""
    narrow = settings.fov < 360
    for key in ("room_coverage", "kind_coverage"):
        if getattr(settings, key) is not None and settings.coverage_rule == "paper":
            _refuse(settings, key, "the paper's rule has no such fraction; give --coverage-rule length")
    if settings.refine and (settings.coverage_rule == "paper" or narrow):
        other = f"--fov {settings.fov:g}" if narrow else "--coverage-rule paper"
        _refuse(settings, "refine", f"does not work with {other}; leave one of them out")
    if settings.least_views > 1 and narrow:
        _refuse(
            settings,
            "views",
            f"does not work with --fov {settings.fov:g}, where one position may have several stops; "
            "leave one of them out",
        )


def _check_registration(settings: Settings) -> None:
    """Refuse an overlap ratio of scans that need not register."""
    if settings.least_overlap > 0 and not settings.registers:
        _refuse(settings, "overlap", f"has no effect with {_unjoined(settings)}; leave one of them out")
    for key in ("accuracy", "control"):
        if getattr(settings, key) and not settings.registers:
            _refuse(settings, key, f"has no effect with {_unjoined(settings)}; leave one of them out")
    if settings.accuracy is not None and settings.minimise == "time":
        _refuse(settings, "accuracy", "does not work with --minimise time; leave one of them out")


def _unjoined(settings: Settings) -> str:
    """The option by which scans need not register."""
    return "--no-register" if settings.register is False else "--coverage-rule paper"


def _check_scanner(settings: Settings) -> None:
    """Refuse limits of a measurement that need another parameter."""
    if settings.density is not None and settings.angular_step is None:
        known = ", ".join(SCANNERS)
        _refuse(settings, "density", f"needs the scanner's --angular-step; give it, or a scanner: {known}")
    if settings.wall_height is not None and settings.most_incidence is None and settings.density is None:
        _refuse(settings, "wall_height", "has no effect without --max-incidence or --density; give one")


def _check_starts(settings: Settings) -> None:
    """Refuse starts that do not fit the number of robots."""
    starts = len(settings.starts)
    if settings.further_starts and settings.start is None:
        raise InputError("further_starts without start; give start, of the first robot")
    if starts > 1 and starts != (settings.robots or 1):
        raise InputError(
            f"--robots {settings.robots or 1}: {starts} starts are given; give --start once for all robots, "
            "or once for each"
        )
    if settings.robots is not None and settings.tour_limit is None and not starts:
        _refuse(
            settings,
            "robots",
            "no robot has a start; give --start X,Y,HEADING once for all, or once for each",
        )


def _check_division(settings: Settings) -> None:
    """Refuse tours that cannot be driven by several robots or in several shifts."""
    if not settings.divided:
        return
    limit = settings.tour_limit
    if settings.robots is not None and limit is not None:
        raise InputError(f"--robots and {PARAMETERS[limit[0]].flag} are both given; plan for one of them")
    given = PARAMETERS["robots" if limit is None else limit[0]].flag
    if settings.end is not None:
        raise InputError(f"--end and {given} are both given; leave one of them out")
    if limit is None:
        return
    if settings.tour == "open":
        raise InputError(f"--tour open: with {given} every tour returns to its start; leave --tour out")
    least = settings.settle + settings.scan_time
    if limit[1] < least:
        raise InputError(
            f"{given} {limit[1]:g} s: is shorter than one stop, which takes {least:g} s; give more time, or "
            "a shorter --scan-time"
        )


def _check_days(settings: Settings) -> None:
    for key in ("date", "since"):
        day = getattr(settings, key)
        if day is not None and not _is_day(day):
            _refuse(settings, key, "is no day; write it as YYYY-MM-DD, such as 2024-05-31")
    for key in ("since", "schedule", "in_progress"):
        if getattr(settings, key) is not None and settings.date is None:
            _refuse(settings, key, "has no effect without a day; give --date too")
    if settings.since is not None and settings.date is not None and settings.since >= settings.date:
        _refuse(settings, "since", f"must lie before --date {settings.date}")
    for entry in settings.schedule_columns:
        role, _, column = entry.partition("=")
        if role.strip() not in ("guid", "task", "start", "finish") or not column.strip():
            raise InputError(
                f"--schedule-column {entry}: write WHAT=COLUMN; known: guid, task, start, finish"
            )


def _is_day(text: str) -> bool:
    """True if a text is a day, written as YYYY-MM-DD."""
    try:
        return datetime.date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


def _check_lists(settings: Settings) -> None:
    known = ", ".join(KINDS)
    for kind in settings.targets or ():
        if kind not in KINDS:
            raise InputError(f"--targets {kind}: unknown kind; known: {known}")
    if settings.targets == ():
        raise InputError(f"--targets: no kind is given; known: {known}")
    check_entries(settings.layers, key="--layer")
    heights_by_kind(settings.heights)
    check_entries(settings.layer_map or (), key="layer_map")
    for x, y, radius in settings.avoid:
        if radius <= 0:
            raise InputError(f"--avoid {x:g},{y:g},{radius:g}: the radius must be greater than 0")
    if settings.origin is not None:
        latitude, longitude, altitude_m, _ = settings.origin
        if not (abs(latitude) <= 90 and abs(longitude) <= 180):
            _refuse(settings, "origin", "latitude must be within ±90, longitude within ±180")
        if abs(altitude_m) > HIGHEST_M:
            _refuse(settings, "origin", f"altitude must be within ±{HIGHEST_M:g} m")


def _check_region(settings: Settings) -> None:
    if settings.region is None:
        return
    x0, y0, x1, y1 = settings.region
    if not (x0 < x1 and y0 < y1):
        _refuse(settings, "region", "the second corner must lie right of and above the first")
