"""Types of ROS 2 without ROS: definitions, their hashes as rosidl makes them (RIHS01), and CDR.

rosbags has the messages and their CDR; the messages used here are the same in Jazzy, Kilted and Lyrical. It
has no services and actions: they are composed here. Some have other fields in another distribution. Each
known version is kept, and the hash in a robot's token says which one it has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from stopgo.bridge.ros2.ros_types import RosFields
from stopgo.mission.console.whole_file import whole_file
from stopgo.mission.errors import InputError

Undecodable = (SerdeError, ValueError, KeyError, IndexError)
"""Errors of messages that are not what their type says."""
EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
UUID, TIME = "unique_identifier_msgs/msg/UUID", "builtin_interfaces/msg/Time"
EMPTY = [("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))]
"""Fields of a message without fields: rosidl gives it one."""
JAZZY, KILTED, LYRICAL = "Jazzy", "Kilted", "Lyrical"

FOLLOW_PATH_GOAL = (
    "nav_msgs/Path path\nstring controller_id\nstring goal_checker_id\nstring progress_checker_id"
)
ERROR = "uint16 error_code\nstring error_msg"
PATH_ERRORS = """uint16 UNKNOWN=100
uint16 INVALID_CONTROLLER=101
uint16 TF_ERROR=102
uint16 INVALID_PATH=103
uint16 PATIENCE_EXCEEDED=104
uint16 FAILED_TO_MAKE_PROGRESS=105
uint16 NO_VALID_CONTROL=106
uint16 CONTROLLER_TIMED_OUT=107
uint16 TIMEOUT=108
"""
SPIN_GOAL = "float32 target_yaw\nbuiltin_interfaces/Duration time_allowance"
SPIN_ERRORS = "uint16 UNKNOWN=700\nuint16 TIMEOUT=701\nuint16 TF_ERROR=702\nuint16 COLLISION_AHEAD=703\n"
MESSAGES = {
    "nav2_msgs/msg/TrackingFeedback": (
        "std_msgs/Header header\nfloat32 position_tracking_error\nfloat32 heading_tracking_error\n"
        "uint32 current_path_index\ngeometry_msgs/PoseStamped robot_pose\nfloat32 distance_to_goal\n"
        "float32 speed\nfloat32 remaining_path_length"
    )
}
SERVICES: dict[str, tuple[str, str]] = {
    "std_srvs/srv/Trigger": ("", "bool success\nstring message"),
    "std_srvs/srv/SetBool": ("bool data", "bool success\nstring message"),
    "std_srvs/srv/Empty": ("", ""),
    "action_msgs/srv/CancelGoal": (
        "action_msgs/GoalInfo goal_info",
        "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
    ),
}
"""Request and response of services."""
_RESULT = f"{PATH_ERRORS}std_msgs/Empty result\n{ERROR}"
_SPUN = f"{SPIN_ERRORS}builtin_interfaces/Duration total_elapsed_time\n{ERROR}"
NAVIGATE_GOAL = "geometry_msgs/PoseStamped pose\nstring behavior_tree"
NAVIGATE_ERRORS = """uint16 UNKNOWN=9000
uint16 FAILED_TO_LOAD_BEHAVIOR_TREE=9001
uint16 TF_ERROR=9002
uint16 TIMEOUT=9003
"""
_NAVIGATED = f"{NAVIGATE_ERRORS}{ERROR}"
_NAVIGATING = (
    "geometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n"
    "builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\n"
    "float32 distance_remaining"
)
_TURNED = "float32 angular_distance_traveled"
ACTIONS: dict[str, dict[tuple[str, ...], tuple[str, str, str]]] = {
    "nav2_msgs/action/FollowPath": {
        (JAZZY, KILTED): (FOLLOW_PATH_GOAL, _RESULT, "float32 distance_to_goal\nfloat32 speed"),
        (LYRICAL,): (
            f"{FOLLOW_PATH_GOAL}\nstring path_handler_id",
            _RESULT,
            "nav2_msgs/TrackingFeedback tracking_feedback",
        ),
    },
    "nav2_msgs/action/NavigateToPose": {
        (JAZZY, KILTED): (NAVIGATE_GOAL, _NAVIGATED, _NAVIGATING),
        (LYRICAL,): (
            NAVIGATE_GOAL,
            _NAVIGATED,
            f"{_NAVIGATING}\nfloat32 position_tracking_error\nfloat32 heading_tracking_error",
        ),
    },
    "nav2_msgs/action/Spin": {
        (JAZZY,): (SPIN_GOAL, _SPUN, _TURNED),
        (KILTED, LYRICAL): (f"{SPIN_GOAL}\nbool disable_collision_checks", _SPUN, _TURNED),
    },
}
"""Goal, result and feedback of actions, by the distributions that have them so."""


@dataclass(frozen=True)
class DefinitionStore:
    """Messages by their names, with what services and actions add to those of rosbags."""

    types: Any = field(default_factory=lambda: get_typestore(Stores.ROS2_JAZZY))

    def __post_init__(self) -> None:
        info = self.types.fielddefs[EVENT_INFO]  # rosidl takes a char for an uint8
        self.types.fielddefs[EVENT_INFO] = (info[0], [(name, _without_char(desc)) for name, desc in info[1]])

    def add(self, name: str, definition: str) -> CdrType:
        """Add a message by its definition, as in a .msg file."""
        package, _, type_ = name.split("/")
        parsed = get_types_from_msg(f"{definition}\n", f"{package}/msg/{type_}")
        constants, fields = parsed[f"{package}/msg/{type_}"]
        return self.add_fields(name, [(one, _without_char(desc)) for one, desc in fields], constants)

    def add_fields(self, name: str, fields: list[Any], constants: Any = ()) -> CdrType:
        self.types.register({name: (list(constants), fields or EMPTY)})
        return CdrType(name, self.types)

    def service(self, name: str, request: CdrType, response: CdrType, said: str = "") -> ServiceType:
        """Compose a service, with the message of its events, which is part of its hash."""
        known = self.types.fielddefs
        known[f"{name}_Event"] = ([], [
            ("info", (Nodetype.NAME, EVENT_INFO)),
            ("request", (Nodetype.SEQUENCE, ((Nodetype.NAME, request.name), 1))),
            ("response", (Nodetype.SEQUENCE, ((Nodetype.NAME, response.name), 1))),
        ])  # fmt: skip
        parts = (
            ("request_message", request.name),
            ("response_message", response.name),
            ("event_message", f"{name}_Event"),
        )
        known[name] = ([], [(part, (Nodetype.NAME, kind)) for part, kind in parts])
        return ServiceType(name, str(self.types.hash_rihs01(name)), request, response, said)


def _without_char(desc: Any) -> Any:
    kind, what = desc
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return (kind, (_without_char(what[0]), what[1]))
    return (kind, ("uint8", 0)) if kind == Nodetype.BASE and what[0] == "char" else desc


BASE_NAMES = {"bool": "boolean", "float32": "float", "float64": "double", "byte": "octet"}
"""Names of types in rosidl where they differ from those in definitions."""
DTYPES: dict[str, Any] = {"bool": np.bool_, "byte": np.uint8}


@dataclass(frozen=True)
class CdrType:
    """A type of message (`MessageKind`) that is read and written as CDR."""

    name: str
    types: Any = field(repr=False)

    @cached_property
    def hash(self) -> str:
        return str(self.types.hash_rihs01(self.name))

    @cached_property
    def _fields(self) -> dict[str, Any]:
        return dict(self.types.fielddefs[self.name][1])

    @cached_property
    def fields(self) -> Mapping[str, str]:
        shown = self._fields if list(self._fields.items()) != EMPTY else {}
        return {name: _rosidl_name(desc) for name, desc in shown.items()}

    def inner(self, field: str) -> CdrType:
        kind, what = self._fields[field]
        return CdrType(what if kind == Nodetype.NAME else what[0][1], self.types)

    def message(self, fields: RosFields) -> Any:
        values = {name: self._value(desc, fields.get(name)) for name, desc in self._fields.items()}
        return self.types.types[self.name](**values)

    def _value(self, desc: Any, given: Any) -> Any:
        kind, what = desc
        if kind == Nodetype.NAME:
            return CdrType(what, self.types).message(given or {})
        if kind == Nodetype.BASE:
            default = {"string": "", "bool": False}.get(what[0], 0)
            return default if given is None else given
        (inner_kind, inner), count = what
        if given is None:
            given = [None] * (count if kind == Nodetype.ARRAY else 0)
        if inner_kind == Nodetype.BASE and inner[0] != "string":
            numbers = [0 if one is None else one for one in given]
            return np.array(numbers, dtype=DTYPES.get(inner[0], inner[0]))
        return [self._value(what[0], one) for one in given]

    def encode(self, fields: RosFields) -> bytes:
        return bytes(self.types.serialize_cdr(self.message(fields), self.name))

    def decode(self, data: bytes) -> Any:
        """Return a message with attributes; raises one of `Undecodable` if the data are not of this type."""
        return self.types.deserialize_cdr(data, self.name)


def _rosidl_name(desc: Any) -> str:
    """Return a field's type as rosidl writes it."""
    kind, what = desc
    if kind == Nodetype.BASE:
        bound = f"<{what[1]}>" if what[1] else ""
        return f"{BASE_NAMES.get(what[0], what[0])}{bound}"
    if kind == Nodetype.NAME:
        package, _, type_ = what.split("/")
        return f"{package}/{type_}"
    inner, count = what
    if kind == Nodetype.ARRAY:
        return f"{_rosidl_name(inner)}[{count}]"
    return f"sequence<{_rosidl_name(inner)}{f', {count}' if count else ''}>"


@dataclass(frozen=True)
class ServiceType:
    """One version of a service."""

    name: str
    hash: str
    request: CdrType
    response: CdrType
    said: str = ""
    """Distributions that have it so, in words; empty if every one has."""

    @property
    def words(self) -> str:
        return f"{self.hash} ({self.said})" if self.said else self.hash


@dataclass(frozen=True)
class ActionType:
    """One version of an action: the services and the topic that it adds to those of every action."""

    goal: CdrType
    result: CdrType
    send_goal: ServiceType
    get_result: ServiceType
    feedback: CdrType


@cache
def _messages() -> DefinitionStore:
    return DefinitionStore()


@cache
def message_type(name: str) -> CdrType:
    """Return a message of the distributions."""
    return CdrType(name, _messages().types)


@cache
def service_types(name: str, folder: str = "") -> tuple[ServiceType, ...]:
    """Return the known versions of a service; `folder` has definitions of further packages.

    Raises
    ------
    InputError
        If there is none.
    """
    found = SERVICES.get(name) or _parts_in(folder, name, 2)
    store = _with_messages(folder)
    request, response = (
        store.add(f"{name}_{part}", text) for part, text in zip(("Request", "Response"), found, strict=True)
    )
    return (store.service(name, request, response),)


@cache
def action_types(name: str, folder: str = "") -> tuple[ActionType, ...]:
    """Return the known versions of an action; raises as `service_types`."""
    versions = ACTIONS.get(name) or {(): cast("tuple[str, str, str]", _parts_in(folder, name, 3))}
    return tuple(_action(name, folder, ", ".join(said), parts) for said, parts in versions.items())


def _action(name: str, folder: str, said: str, parts: tuple[str, str, str]) -> ActionType:
    store = _with_messages(folder)
    goal, result, feedback = (
        store.add(f"{name}_{part}", text)
        for part, text in zip(("Goal", "Result", "Feedback"), parts, strict=True)
    )
    of_goal = [("goal_id", (Nodetype.NAME, UUID))]
    stamp, status = (Nodetype.NAME, TIME), (Nodetype.BASE, ("int8", 0))
    accepted = (Nodetype.BASE, ("bool", 0))
    make = store.add_fields
    send_goal = store.service(
        f"{name}_SendGoal",
        make(f"{name}_SendGoal_Request", [*of_goal, ("goal", (Nodetype.NAME, goal.name))]),
        make(f"{name}_SendGoal_Response", [("accepted", accepted), ("stamp", stamp)]),
        said,
    )
    get_result = store.service(
        f"{name}_GetResult",
        make(f"{name}_GetResult_Request", of_goal),
        make(f"{name}_GetResult_Response", [("status", status), ("result", (Nodetype.NAME, result.name))]),
        said,
    )
    message = [*of_goal, ("feedback", (Nodetype.NAME, feedback.name))]
    return ActionType(goal, result, send_goal, get_result, make(f"{name}_FeedbackMessage", message))


def _with_messages(folder: str) -> DefinitionStore:
    """Return a store with our messages and those of a folder of packages."""
    store = DefinitionStore()
    for name, text in MESSAGES.items():
        store.add(name, text)
    for path in sorted(Path(folder).rglob("*.msg")) if folder else ():
        name = f"{path.parent.parent.name}/msg/{path.stem}"
        if name not in store.types.fielddefs:
            try:
                store.add(name, whole_file(path).decode())
            except (TypesysError, UnicodeDecodeError) as error:
                raise InputError(f"{path}: no definition of a message ({error})") from None
    return store


def _parts_in(folder: str, name: str, count: int) -> tuple[str, ...]:
    """Return the parts of a .srv or .action file below a folder of packages."""
    package, kind, type_ = name.split("/")
    suffix = f"{package}/{kind}/{type_}.{kind}"
    path = next((one for one in Path(folder).rglob(f"{type_}.{kind}") if str(one).endswith(suffix)), None)
    if not folder or path is None:
        ours = ", ".join(sorted(SERVICES))
        where = f"{folder} has no {suffix}" if folder else "name its folder with scan.definitions"
        raise InputError(f"scan.type = {name!r}: there is no such type here ({where}); without: {ours}")
    parts: list[list[str]] = [[]]
    for line in whole_file(path).decode().splitlines():
        if line.strip() == "---":
            parts.append([])
        else:
            parts[-1].append(line)
    if len(parts) != count:
        raise InputError(f"{path}: has {len(parts)} parts between lines of ---, not {count}")
    return tuple("\n".join(part) for part in parts)
