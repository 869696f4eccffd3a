"""The file ros2.toml: names of a robot's topics, actions and scanner, and limits."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from stopgo.mission.document.decoding import converted
from stopgo.mission.errors import InputError
from stopgo.mission.settings.toml_file import read_toml, with_quotes

Metres = Annotated[float, msgspec.Meta(gt=0, le=100)]
Seconds = Annotated[float, msgspec.Meta(gt=0, le=3600)]
Name = Annotated[str, msgspec.Meta(pattern=r"^([~/]?[A-Za-z_][A-Za-z0-9_/]*)?$")]
"""Name of a topic, service or action; empty if the robot has none."""
NeededName = Annotated[str, msgspec.Meta(pattern=r"^[~/]?[A-Za-z_][A-Za-z0-9_/]*$")]
TypeName = Annotated[str, msgspec.Meta(pattern=r"^[a-z][a-z0-9_]*/(srv|action)/[A-Z][A-Za-z0-9]*$")]


NAVIGATORS = ("navigate_to_pose", "navigate_through_poses")
"""Actions of Nav2 whose goals no other action of it sends."""


class RosSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of the file."""


class FrameNames(RosSection, frozen=True):
    """Frames of tf."""

    map: str = "map"
    base: str = "base_link"


class TopicNames(RosSection, frozen=True):
    """Topics that the robot publishes, and the one that takes velocities."""

    odometry: NeededName = "odom"
    tf: NeededName = "/tf"
    tf_static: NeededName = "/tf_static"
    battery: Name = "battery_state"
    localisation: Name = ""
    """geometry_msgs/msg/PoseWithCovarianceStamped, such as amcl_pose."""
    emergency_stop: Name = ""
    """std_msgs/msg/Bool: true while it is pressed."""
    cmd_vel: Name = ""
    """Takes zero velocity at a stop, if it is named."""
    stamped: bool = False
    """True if `cmd_vel` takes TwistStamped."""


class DriveActions(RosSection, frozen=True):
    """Nav2's actions, and what their goals name."""

    follow_path: NeededName = "follow_path"
    spin: Name = ""
    """nav2_msgs/action/Spin: turns to a stop's heading where the path's end did not."""
    navigate: NeededName = "navigate_to_pose"
    """nav2_msgs/action/NavigateToPose: drives where a mission's policy lets the robot find its own way."""
    behavior_tree: str = ""
    """Behaviour tree that goals of `navigate` name; empty for Nav2's own."""
    cancel: tuple[NeededName, ...] = NAVIGATORS
    """Other actions that may drive the robot; a stop cancels their goals, too."""
    controller_id: str = ""
    goal_checker_id: str = ""
    progress_checker_id: str = ""
    spacing_m: Metres = 0.05
    """Distance between the poses of a path."""


class RosLimits(RosSection, frozen=True):
    """RosLimits beyond which the robot stops, and is held."""

    off_path_m: Metres = 0.5
    jump_m: Metres = 1.0
    """Jump of the localisation after which a person must look where the robot is."""
    sigma_m: Metres = 0.3
    """Standard deviation of the position, from the localisation's covariance."""
    tf_age_s: Seconds = 2.0
    odometry_age_s: Seconds = 1.0
    clock_offset_s: Seconds = 1.0
    gap_s: Seconds = 10.0
    """Longest gap in tf or odometry after which the robot drives on by itself."""
    stalled_s: Seconds = 20.0
    rest_m: Metres = 0.01
    rest_rad: Metres = 0.02


class ScanCall(RosSection, frozen=True):
    """The service or action that takes a scan.

    Values of `request` are written into its fields; {label}, {stop}, {profile}, {duration_s} and {timeout_s}
    are replaced. `response` names the response's fields; a further name goes into JSON in a text field.
    """

    name: NeededName = "scan"
    type: TypeName = "std_srvs/srv/Trigger"
    request: dict[str, Any] = {}
    success: str = "success"
    message: str = "message"
    file: str = "message.file"
    size: str = "message.size"
    sha256: str = "message.sha256"
    points: str = "message.points"
    definitions: str = ""
    """Folder with packages of .msg, .srv and .action files, for a type that `ros2-zenoh` does not know."""
    folder: str = ""
    """Folder of the files on this computer: size and sha256 are then taken from the file itself."""
    late_s: Seconds = 60.0
    """Time for which the robot stays where it is when the scanner does not answer in time."""

    @property
    def kind(self) -> Literal["srv", "action"]:
        return "action" if "/action/" in self.type else "srv"


class ZenohNetwork(RosSection, frozen=True):
    """Place of the robot in a network of rmw_zenoh, for `--controller ros2-zenoh`."""

    router: str = "tcp/127.0.0.1:7447"
    domain: Annotated[int, msgspec.Meta(ge=0, le=232)] = 0
    namespace: Name = ""
    use_sim_time: bool = False
    guard: Literal["here", "robot"] = "here"
    """`robot`: the robot is driven only while `stopgo guard` at the robot answers."""


class RosSettings(RosSection, frozen=True):
    """All of ros2.toml."""

    node: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] = "stopgo"
    commands: bool = False
    """True if services of the node may start, resume, skip, retry and send home; nobody signs them."""
    autostart_node: bool = True
    """True if the node activates itself; else a manager of lifecycle nodes does."""
    frames: FrameNames = FrameNames()
    topics: TopicNames = TopicNames()
    drive: DriveActions = DriveActions()
    limits: RosLimits = RosLimits()
    scan: ScanCall = ScanCall()
    zenoh: ZenohNetwork = ZenohNetwork()


def read_ros_settings(path: Path | None) -> RosSettings:
    """Read a ros2.toml; without one, everything has its default.

    Raises
    ------
    InputError
        Naming the file, the key and what was found there.
    """
    if path is None:
        return RosSettings()
    document = read_toml(path)
    try:
        return converted(document, RosSettings)
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at ")
        keys = where.strip("`").removeprefix("$").lstrip(".")
        found = value_at(document, keys)
        raise InputError(f"{path}: {keys or 'the file'}{found}: {with_quotes(what)}") from None


def changed_settings(settings: RosSettings, changes: dict[str, Any]) -> RosSettings:
    """Return the settings with other values, by table and key, or by a key of no table.

    Raises
    ------
    InputError
        Naming the key and the value.
    """
    document = msgspec.to_builtins(settings)
    for name, value in changes.items():
        document[name] = document[name] | value if isinstance(value, dict) else value
    try:
        return converted(document, RosSettings)
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at ")
        keys = where.strip("`").removeprefix("$").lstrip(".")
        raise InputError(f"parameter {keys}{value_at(document, keys)}: {what}") from None


def value_at(document: Any, keys: str) -> str:
    """Return ` = value` as it stands in the document; empty if it is no plain value."""
    for key in filter(None, keys.split(".")):
        document = document.get(key) if isinstance(document, dict) else None
    return f" = {document!r}" if isinstance(document, str | int | float | bool) else ""
