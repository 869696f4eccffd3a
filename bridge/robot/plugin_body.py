"""A base and a scanner of somebody's own: `stopgo robot --controller package.module:function`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any, TypeVar, get_args

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import Base, BaseHealth, Outcome, Rest, Scanner
from stopgo.bridge.robot.map_frame import OnMap
from stopgo.bridge.robot.robot_hardware import Body
from stopgo.mission.console.plugins import Variant, variant
from stopgo.mission.document import Mission, Point, RobotSpec, Scan
from stopgo.mission.errors import InputError
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scans import ScanFailed, ScanResult

T = TypeVar("T")

OURS: dict[str, Any] = {"sim": None, "mavlink:URL": None}
"""What `--controller` takes besides."""
NOT_EVERYONES = ("health", "scan_outcome")
"""What a base or a scanner need not tell."""


@dataclass(frozen=True)
class PluginBody:
    """What another's function gives: `function(state: Path) -> (base, scanner)`."""

    made: Variant[Any]
    state: Path
    to_map: Transform | None = None

    @contextmanager
    def __call__(self, clock: Clock) -> Iterator[Body]:
        made = self.made
        base, scanner = made.several(made.called(self.state), "base, scanner")
        for given, protocol in ((base, Base), (scanner, Scanner)):
            asked = [name for name in _asked_of(protocol) if name not in NOT_EVERYONES]
            missing = [name for name in asked if not hasattr(given, name)]
            if missing:
                raise made.wrong(
                    f"its {type(given).__name__} is no {protocol.__name__}: it lacks {', '.join(missing)}"
                )
        guarded = GuardedBase(made, base)
        guarded.pose()  # a base that cannot tell where it is at the start is refused
        if guarded.fault:
            raise InputError(guarded.fault)
        on_map = OnMap(guarded, self.to_map)
        yield Body(on_map, GuardedScanner(made, scanner), on_map.take)


def plugin_body(name: str, state: Path, to_map: Transform | None = None) -> PluginBody:
    """The body of a controller of this name, loaded; raises InputError if there is none."""
    return PluginBody(variant("controller", name, OURS, said=f"--controller {name}"), state, to_map)


def _asked_of(protocol: type) -> list[str]:
    return [name for name in vars(protocol) if not name.startswith("_")]


class GuardedBase:
    """Another's base. Once it has failed it drives no more, and says why; orders are still heard."""

    def __init__(self, made: Variant[Any], base: Base) -> None:
        self.fault = ""
        """What went wrong first; empty if nothing has."""
        self._made = made
        self._base = base
        self._last = Pose(x=0.0, y=0.0, heading=0.0)

    def _tried(self, call: Callable[[], T], otherwise: T, right: Callable[[T], bool]) -> T:
        """What the base answers, or `otherwise` where it fails or answers nonsense."""
        try:
            with self._made.named_errors():
                answer = call()
            if right(answer):
                return answer
            raise self._made.wrong(f"answered {answer!r}")
        except InputError as error:
            self.fault = self.fault or str(error)
            return otherwise

    def pose(self) -> Pose:
        """Where it is; where it last was known to be, if it no longer tells."""
        self._last = self._tried(self._base.pose, self._last, _is_pose)
        return self._last

    def speed(self) -> float:
        return self._tried(self._base.speed, 0.0, _is_number)

    def battery(self) -> float:
        return self._tried(self._base.battery, 0.0, lambda share: _is_number(share) and 0 <= share <= 1)

    def health(self) -> BaseHealth:
        """What it tells of itself; nothing, where it has no such word."""
        if not hasattr(self._base, "health"):
            return BaseHealth()
        return self._tried(self._base.health, BaseHealth(), _is_health)

    def endurance_s(self) -> float | None:
        return self._tried(self._base.endurance_s, None, lambda told: told is None or _is_number(told))

    def rest(self) -> Rest:
        return self._tried(self._base.rest, Rest(), lambda rest: isinstance(rest, Rest))

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        """Drive, unless it has failed before; a failure on the way stops it and blocks the way."""
        if self.fault:
            return "blocked"
        blocked: Outcome = "blocked"
        outcome = self._tried(
            lambda: self._base.goto(path, heading=heading, limits=limits, interrupt=interrupt),
            blocked,
            lambda outcome: outcome in get_args(Outcome),
        )
        if self.fault:
            self.stop()
        return outcome

    def stop(self) -> None:
        """Stand still: asked of it also after it has failed."""
        self._tried(self._base.stop, None, lambda _: True)

    def unfit(self, mission: Mission) -> str:
        return self.fault or self._tried(lambda: self._base.unfit(mission), "", _is_text) or self.fault

    def not_ready(self) -> str:
        return self.fault or self._tried(self._base.not_ready, "", _is_text) or self.fault

    def blocked_by(self) -> str:
        return self.fault or self._tried(self._base.blocked_by, "", _is_text) or self.fault


class GuardedScanner:
    """Another's scanner: a scan in which it fails has failed."""

    def __init__(self, made: Variant[Any], scanner: Scanner) -> None:
        self._made = made
        self._scanner = scanner

    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        """A scan's result, or why there is none."""
        try:
            with self._made.named_errors():
                result = self._scanner.scan(label, scan, interrupt=interrupt)
            if isinstance(result, ScanResult | ScanFailed):
                return result
            raise self._made.wrong(f"its scan gave a {type(result).__name__}, not a ScanResult or ScanFailed")
        except InputError as error:
            return ScanFailed(reason=str(error))

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """What it says of a scan that was cut off; nothing, where it has no such word."""
        if not hasattr(self._scanner, "scan_outcome"):
            return None
        try:
            with self._made.named_errors():
                result = self._scanner.scan_outcome(label)
        except InputError:
            return None
        return result if isinstance(result, ScanResult | ScanFailed) else None

    @property
    def profiles(self) -> tuple[str, ...] | None:
        return self._scanner.profiles


def _is_number(told: object) -> bool:
    return isinstance(told, int | float) and not isinstance(told, bool) and math.isfinite(told)


def _is_health(told: object) -> bool:
    if not isinstance(told, BaseHealth):
        return False
    share = told.localisation
    flags = (told.emergency_stop, told.safety_field)
    return (share is None or (_is_number(share) and 0 <= share <= 1)) and set(flags) <= {None, True, False}


def _is_text(told: object) -> bool:
    return isinstance(told, str)


def _is_pose(told: object) -> bool:
    return isinstance(told, Pose) and all(map(_is_number, (told.x, told.y, told.heading)))
