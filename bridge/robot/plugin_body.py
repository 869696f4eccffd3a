"""A third-party base and scanner: `stopgo robot --controller package.module:function`."""

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

OURS: dict[str, Any] = {"sim": None, "mavlink:URL": None, "ros2[:FILE]": None, "ros2-zenoh[:FILE]": None}
"""Values of `--controller` that need no plugin."""
OPTIONAL = ("health", "scan_outcome")
"""Methods that a base or a scanner may lack."""
FORMER_SCAN_OUTCOME = "what_became"
"""Older name of `scan_outcome`."""


@dataclass(frozen=True)
class PluginBody:
    """Base and scanner that a plugin's function returns: `function(state: Path) -> (base, scanner)`."""

    made: Variant[Any]
    state: Path
    to_map: Transform | None = None

    @contextmanager
    def __call__(self, clock: Clock) -> Iterator[Body]:
        made = self.made
        base, scanner = made.several(made.called(self.state), "base, scanner")
        for given, protocol in ((base, Base), (scanner, Scanner)):
            required = [name for name in _methods_of(protocol) if name not in OPTIONAL]
            missing = [name for name in required if not hasattr(given, name)]
            if missing:
                raise made.wrong(
                    f"its {type(given).__name__} is no {protocol.__name__}: it lacks {', '.join(missing)}"
                )
        guarded = GuardedBase(made, base)
        guarded.pose()  # a base without a pose at the start is refused
        if guarded.fault:
            raise InputError(guarded.fault)
        on_map = OnMap(guarded, self.to_map)
        yield Body(on_map, GuardedScanner(made, scanner), on_map.take)


def plugin_body(name: str, state: Path, to_map: Transform | None = None) -> PluginBody:
    """Load the controller of this name; raises InputError if there is none."""
    return PluginBody(variant("controller", name, OURS, said=f"--controller {name}"), state, to_map)


def _methods_of(protocol: type) -> list[str]:
    return [name for name in vars(protocol) if not name.startswith("_")]


class GuardedBase:
    """A third-party base. Once it has failed it drives no more, and reports why."""

    def __init__(self, made: Variant[Any], base: Base) -> None:
        self.fault = ""
        """The first failure; empty if there was none."""
        self._made = made
        self._base = base
        self._last = Pose(x=0.0, y=0.0, heading=0.0)

    def _tried(self, call: Callable[[], T], otherwise: T, right: Callable[[T], bool]) -> T:
        """Return the base's answer, or `otherwise` if it fails or the answer is not `right`."""
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
        """Return the pose; the last known one if the base fails."""
        self._last = self._tried(self._base.pose, self._last, _is_pose)
        return self._last

    def speed(self) -> float:
        return self._tried(self._base.speed, 0.0, _is_number)

    def battery(self) -> float | None:
        empty: float | None = 0.0
        return self._tried(self._base.battery, empty, _is_charge)

    def health(self) -> BaseHealth:
        """Return the base's health; an empty one if it has no such method."""
        if not hasattr(self._base, "health"):
            return BaseHealth()
        return self._tried(self._base.health, BaseHealth(), _is_health)

    def endurance_s(self) -> float | None:
        return self._tried(
            self._base.endurance_s, None, lambda seconds: seconds is None or _is_number(seconds)
        )

    def rest(self) -> Rest:
        return self._tried(self._base.rest, Rest(), lambda rest: isinstance(rest, Rest))

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        """Drive, unless the base has failed before; a failure meanwhile stops it, and the path is blocked."""
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
        """Stop the base, also after it has failed; raises `InputError` if it does not take the command."""

        def is_taken() -> bool:
            self._base.stop()
            return True

        if not self._tried(is_taken, False, bool):
            raise InputError(self.fault)

    def unfit(self, mission: Mission) -> str:
        return self.fault or self._tried(lambda: self._base.unfit(mission), "", _is_text) or self.fault

    def not_ready(self) -> str:
        return self.fault or self._tried(self._base.not_ready, "", _is_text) or self.fault

    def blocked_by(self) -> str:
        return self.fault or self._tried(self._base.blocked_by, "", _is_text) or self.fault


class GuardedScanner:
    """A third-party scanner. If it raises an error, the scan has failed."""

    def __init__(self, made: Variant[Any], scanner: Scanner) -> None:
        self._made = made
        self._scanner = scanner

    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        """Scan, and return the result or the failure."""
        try:
            with self._made.named_errors():
                result = self._scanner.scan(label, scan, interrupt=interrupt)
            if isinstance(result, ScanResult | ScanFailed):
                return result
            raise self._made.wrong(f"its scan gave a {type(result).__name__}, not a ScanResult or ScanFailed")
        except InputError as error:
            return ScanFailed(reason=str(error))

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """Return the outcome of an interrupted scan; `None` if the scanner has no such method."""
        former = getattr(self._scanner, FORMER_SCAN_OUTCOME, None)
        scan_outcome = getattr(self._scanner, "scan_outcome", former)
        if scan_outcome is None:
            return None
        try:
            with self._made.named_errors():
                result = scan_outcome(label)
        except InputError:
            return None
        return result if isinstance(result, ScanResult | ScanFailed) else None

    @property
    def profiles(self) -> tuple[str, ...] | None:
        return self._scanner.profiles


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_charge(level: object) -> bool:
    return level is None or (isinstance(level, int | float) and _is_number(level) and 0 <= level <= 1)


def _is_health(value: object) -> bool:
    if not isinstance(value, BaseHealth):
        return False
    good = value.localisation
    flags = (
        value.emergency_stop, value.safety_field, value.battery_ok, value.position_ok, value.fence_ok,
    )  # fmt: skip
    return (good is None or (_is_number(good) and 0 <= good <= 1)) and set(flags) <= {
        None,
        True,
        False,
    }


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_pose(value: object) -> bool:
    return isinstance(value, Pose) and all(map(_is_number, (value.x, value.y, value.heading)))
