"""Every parameter of a plan, with its default; read from plan.toml, overridden by options.

Names are those of the command's options with underscores. What a person types is metres, seconds and
degrees, as here; docs/planning.md tells what each one does.
"""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import msgspec

from mission.errors import InputError
from mission.kinds import KINDS


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """All parameters of a plan. `None` means: decided from the others or from the floor."""

    # [plan]
    candidates: str = "grid"
    visibility: str = "exact"
    selector: str = "default"
    router: str = "default"
    graph: str = "exact"
    den_grid_min: float = 0.5
    """Least nodes per m² of a room's grid. The paper gives no value for this and the next: ours."""
    max_err_dist: float = 0.5
    """Greatest distance in metres from a stop to the grid's node that stands for it."""
    coverage: float = 0.9
    """c_min: least share of what is visible that the chosen stops must see, of the whole …"""
    room_coverage: float | None = None
    """… of what each room shows …"""
    kind_coverage: float | None = None
    """… and of each kind of element. None: LEAST_SHARE; by the paper's rule there are no such shares."""
    coverage_rule: Literal["length", "paper"] = "length"
    """Whether coverage counts metres of boundary; or units of the whole only, as the paper does."""
    d_sec: float = 0.7
    """Least distance from a stop to any element."""
    d_dis: float = 0.05
    """Greatest length of a unit (Eq. 1)."""
    grid: float = 1.0
    """r_grid: greatest spacing of grid candidates."""
    d_max: float = 1.6
    """Greatest distance of triangulation seeds along a line. The paper gives no value for this and the
    next two: ours come closest to its Table 3."""
    l_min: float = 2.6
    """Least side of a triangle whose middle is a candidate."""
    dens_min: float = 0.25
    """Least candidates per m² of a room, below which it is triangulated again."""
    door_access: float = 0.7
    """Least clear width of an opening that is driven through."""
    edge: float = 0.35
    """Least distance of stops and legs from floor edges and holes."""
    doors: Literal["open", "closed"] = "open"
    """Whether the laser passes doors; closed is the paper's "range restricted to rooms"."""
    targets: tuple[str, ...] | None = None
    """Element kinds to be scanned."""
    layers: tuple[str, ...] = ()
    """What layers of other names stand for, such as `A-WALL=walls`; `DIM=ignore` is nothing in the way."""
    tour: Literal["closed", "open"] | None = None
    start: tuple[float, float, float] | None = None
    """x, y in metres and heading in degrees counter-clockwise from +x."""
    end: tuple[float, float] | None = None
    use: tuple[tuple[float, float], ...] = ()
    """Places where a stop must be."""
    avoid: tuple[tuple[float, float, float], ...] = ()
    """Circles x, y, radius in which no stop may be."""
    refine: bool | None = None
    """Whether places beside the chosen stops are offered too; None: where that takes at most a second."""
    door_scan: bool = False
    """Whether a stop is added in every doorway that is driven through, to help registration."""
    door_candidates: bool = False
    """Whether doorways are candidates."""
    node_limit: int = 20_000
    """Branch-and-bound nodes of the exact selector, after which it reports its gap."""
    time_limit: float | None = None
    """Seconds after which the exact selector stops; makes a plan depend on the machine's speed."""
    origin: tuple[float, float, float, float] | None = None
    """Latitude, longitude, altitude of the drawing's origin, and the bearing of its +y axis."""
    seed: int = 1
    # [robot]
    robot_radius: float | None = None
    speed: float = 0.5
    turn_rate: float = 45.0
    """Degrees per second."""
    acceleration: float = 0.5
    """Metres per second squared."""
    # [scanner]
    range: float = 5.0
    """r: the scanner's range."""
    fov: float = 360.0
    """v: the scanner's field of view in degrees; below 360 every stop has a heading to scan along."""
    profile: str = "default"
    settle: float = 2.0
    scan_time: float = 60.0
    # [policy]
    tolerance: float = 0.05
    """Greatest distance of the robot from a stop at the start of its scan."""
    on_failure: Literal["retry", "skip", "ask", "abort", "home"] = "ask"
    retries: int = 1
    link_loss: Literal["continue", "finish_stop", "hold", "home"] = "continue"
    link_loss_after: float = 30.0
    battery_min: float = 0.15

    @property
    def layer_roles(self) -> dict[str, str]:
        """What layers stand for, by their names in capitals, where the user says so."""
        told = (entry.rpartition("=") for entry in self.layers)
        return {name.strip().upper(): role.strip().lower() for name, _, role in told}

    @property
    def least_of_room(self) -> float | None:
        """Least share of what each room shows; None where none is asked for."""
        return self._least(self.room_coverage)

    @property
    def least_of_kind(self) -> float | None:
        """Least share of what is visible of each kind of element; None where none is asked for."""
        return self._least(self.kind_coverage)

    def _least(self, given: float | None) -> float | None:
        if self.coverage_rule == "paper":
            return None
        return LEAST_SHARE if given is None else given

    @property
    def radius(self) -> float:
        """The robot's radius in metres: half of door_access unless given."""
        return self.door_access / 2 if self.robot_radius is None else self.robot_radius


LEAST_SHARE = 0.7
"""Of every room and kind: the most that cost at most one stop on small floors and 5 % on a large one."""
LAYER_ROLES = ("floor", "rooms", "doors", "passages", *KINDS, "ignore")
"""What a layer of a drawing can stand for."""

SECTIONS: dict[str, tuple[str, ...]] = {
    "plan": (
        *("candidates", "visibility", "selector", "router", "coverage", "d_sec", "d_dis", "grid"),
        *("room_coverage", "kind_coverage", "coverage_rule", "refine"),
        *("graph", "den_grid_min", "max_err_dist"),
        *("d_max", "l_min", "dens_min"),
        *("door_access", "edge", "doors", "targets", "layers", "tour", "start", "end", "use", "avoid"),
        *("door_scan", "door_candidates", "node_limit", "time_limit", "origin", "seed"),
    ),
    "robot": ("robot_radius", "speed", "turn_rate", "acceleration"),
    "scanner": ("range", "fov", "profile", "settle", "scan_time"),
    "policy": (*("tolerance", "on_failure", "retries", "link_loss", "link_loss_after", "battery_min"),),
}
"""The tables of plan.toml and the keys in each."""

_POSITIVE = (
    *("d_dis", "grid", "d_max", "door_access", "robot_radius", "speed", "turn_rate"),
    "acceleration",
    "time_limit",
    "max_err_dist",
    "range",
    "tolerance",
)
_NOT_NEGATIVE = (
    *("d_sec", "l_min", "dens_min", "edge", "settle", "scan_time", "retries", "link_loss_after"),
    *("den_grid_min", "seed", "node_limit"),
)
_LARGEST = 1e6
_FARTHEST = 1e9
"""Coordinates of a site may be this large, in metres."""


def read_settings(path: Path | None, overrides: dict[str, Any]) -> Settings:
    """Settings from plan.toml (if given) and then `overrides`; both are checked.

    Raises
    ------
    InputError
        Naming the file or option, the key, the value and what would be right.
    """
    values = {} if path is None else _read_toml(path)
    values.update({key: value for key, value in overrides.items() if value is not None})
    try:
        settings = msgspec.convert(values, Settings)
    except msgspec.ValidationError as error:
        raise InputError(_said(str(error), values, path)) from None
    check_settings(settings)
    return settings


HOW = {
    "start": "write X,Y,HEADING, such as 2.5,3.0,90",
    "end": "write X,Y, such as 2.5,3.0",
    "origin": "write LAT,LON,ALT,HEADING, such as 47.3769,8.5417,408,0",
    "use": "write X,Y for each, such as 2.5,3.0",
    "avoid": "write X,Y,RADIUS for each, such as 2.5,3.0,1",
    "layers": "write NAME=KIND for each, such as A-WALL=walls or DIM=ignore",
    "targets": f"write kinds, such as walls,columns; known: {', '.join(KINDS)}",
}
"""How to write the parameters that are more than one number or word."""


def _said(error: str, values: dict[str, Any], path: Path | None) -> str:
    """A refused value as one line: key, value, and what would be right."""
    found = re.search(r"`\$\.(\w+)", error)
    key = found.group(1) if found else ""
    choices = [choice for choice in _choices(key) if choice is not None]
    right = HOW.get(key) or (f"known: {', '.join(choices)}" if choices else error.partition(" - at ")[0])
    where = f"{path}: " if path else ""
    return f"{where}{key} = {_shown(values.get(key))}: {right}" if key else f"{where}{error}"


def _choices(key: str) -> tuple[str, ...]:
    """The words a parameter may be, where they are fixed."""
    hint = get_type_hints(Settings).get(key)
    parts = get_args(hint)
    literals = [part for part in (hint, *parts) if get_origin(part) is Literal]
    return tuple(word for part in literals for word in get_args(part))


def _shown(value: object) -> str:
    if isinstance(value, tuple | list):
        return ",".join(_shown(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({error})") from None
    values: dict[str, Any] = {}
    for table, content in document.items():
        if not isinstance(content, dict):
            raise InputError(f"{path}: {table} = {content} stands in no table; known: {_tables()}")
        if table not in SECTIONS:
            raise InputError(f"{path}: unknown table [{table}]; known: {_tables()}")
        for key, value in content.items():
            if key not in SECTIONS[table]:
                raise InputError(f"{path}: unknown key {key} in [{table}]; {_home_of(key, table)}")
            values[key] = value
    return values


def _tables() -> str:
    return ", ".join(f"[{table}]" for table in SECTIONS)


def _home_of(key: str, table: str) -> str:
    for section, keys in SECTIONS.items():
        if key in keys:
            return f"it belongs in [{section}]"
    return f"known there: {', '.join(SECTIONS[table])}"


def check_settings(settings: Settings) -> None:
    """Refuse values that no plan can be made with, naming key and value."""
    for key in settings.__struct_fields__:
        value = getattr(settings, key)
        limit = _FARTHEST if isinstance(value, tuple) else _LARGEST
        for number in _numbers(value):
            if not math.isfinite(number) or abs(number) > limit:
                raise InputError(f"{key} = {number}: must be a finite number below {limit:g}")
    for key in _POSITIVE:
        value = getattr(settings, key)
        if value is not None and value <= 0:
            raise InputError(f"{key} = {value}: must be greater than 0")
    for key in _NOT_NEGATIVE:
        if getattr(settings, key) < 0:
            raise InputError(f"{key} = {getattr(settings, key)}: must not be negative")
    _check_shares(settings)
    _check_rule(settings)
    _check_choices(settings)


def _numbers(value: object) -> list[float]:
    """All numbers in a value, however deep."""
    if isinstance(value, tuple):
        return [number for item in value for number in _numbers(item)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []


def _check_shares(settings: Settings) -> None:
    if not 0 < settings.coverage <= 1:
        raise InputError(f"coverage = {settings.coverage}: must be above 0 and at most 1 (0.9 is 90 %)")
    if not 0 <= settings.battery_min < 1:
        raise InputError(f"battery_min = {settings.battery_min}: must be at least 0 and below 1")
    if settings.d_dis < 1e-3:
        raise InputError(f"d_dis = {settings.d_dis}: units below 1 mm are not planned; use 0.001 or more")
    if not 10 <= settings.fov <= 360:
        raise InputError(f"fov = {settings.fov}: must be at least 10 and at most 360 degrees")
    if settings.d_max < 0.05:
        raise InputError(f"d_max = {settings.d_max}: seeds below 5 cm are not planned; use 0.05 or more")
    if settings.grid < 0.05:
        raise InputError(f"grid = {settings.grid}: spacing below 5 cm is not planned; use 0.05 or more")


def _check_rule(settings: Settings) -> None:
    """Refuse what a coverage rule or a field of view has no use for."""
    for key in ("room_coverage", "kind_coverage"):
        share = getattr(settings, key)
        if share is not None and not 0 <= share <= 1:
            raise InputError(f"{key} = {share}: must be between 0 and 1 (0.7 is 70 %)")
        if share is not None and settings.coverage_rule == "paper":
            raise InputError(
                f"{key} = {share}: the paper's rule has no such share; use coverage_rule = length"
            )
    if settings.refine and (settings.coverage_rule == "paper" or settings.fov < 360):
        other = "coverage_rule = paper" if settings.coverage_rule == "paper" else f"fov = {settings.fov:g}"
        raise InputError(f"refine = true: is not done with {other}; leave one of them out")


def _check_choices(settings: Settings) -> None:
    for kind in settings.targets or ():
        if kind not in KINDS:
            raise InputError(f"targets = {kind}: unknown kind; known: {', '.join(KINDS)}")
    for entry in settings.layers:
        name, _, role = entry.rpartition("=")
        if not name.strip() or role.strip().lower() not in LAYER_ROLES:
            raise InputError(f"layers = {entry}: write NAME=KIND; kinds: {', '.join(LAYER_ROLES)}")
    for x, y, radius in settings.avoid:
        if radius <= 0:
            raise InputError(f"avoid = {x:g},{y:g},{radius:g}: the radius must be greater than 0")
    if settings.targets == ():
        raise InputError(f"targets is empty; known: {', '.join(KINDS)}")
    if settings.tour == "closed" and settings.end is not None:
        raise InputError("tour = closed and end are both given; a closed tour ends where it starts")
    if settings.origin is not None and not (abs(settings.origin[0]) <= 90 and abs(settings.origin[1]) <= 180):
        raise InputError(f"origin = {settings.origin}: latitude must be within ±90, longitude ±180")


def settings_toml(settings: Settings) -> str:
    """The settings as a plan.toml that reads back the same; what is undecided stands as a comment."""
    lines: list[str] = []
    for section, keys in SECTIONS.items():
        lines.append(f"[{section}]")
        for key in keys:
            value = getattr(settings, key)
            lines.append(f"# {key} = (decided by stopgo)" if value is None else f"{key} = {_toml(value)}")
        lines.append("")
    return "\n".join(lines)


def _toml(value: object) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)
