"""MCAP bag of ROS 2: the route as `nav_msgs/Path`, the stops as `geometry_msgs/PoseArray`.

The rosbags writer creates a folder for a bag. It contains one .mcap file, which ROS 2, Foxglove and rosbags
open without the folder.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stopgo.mission.document import Mission, Point
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.nav2_yaml import unmapped
from stopgo.mission.files.exports.waypoints import Waypoint, frame_name, mapped, way
from stopgo.mission.frames.transform import SAME

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

PATH = "/stopgo/path"
STOPS = "/stopgo/stops"


def write(mission: Mission, supplements: Supplements) -> bytes:
    """Return the route with a pose per corner and stop on /stopgo/path, the stops alone on /stopgo/stops.

    Stamps in the headers are zero, which a viewer takes as "any time"; the log time is
    `supplements.written`.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    types = _types()
    time_ns = int(supplements.written.timestamp()) * 1_000_000_000
    with tempfile.TemporaryDirectory(prefix="stopgo-") as folder:
        bag = Path(folder) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            for topic, message in _messages(mission, types).items():
                kind = message.__msgtype__
                connection = writer.add_connection(
                    topic, kind, typestore=types, offered_qos_profiles=[_latched()]
                )
                writer.write(connection, time_ns, types.serialize_cdr(message, kind))
        return (bag / "bag.mcap").read_bytes()


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """Return the positions in the PoseArray, back in the site's frame."""
    poses = [pose.position for pose in read_messages(data)[STOPS].poses]
    to_map = mission.frame.to_map or SAME
    return [to_map.back((position.x, position.y)) for position in poses]


def read_messages(data: bytes) -> dict[str, Any]:
    """The bag's last message of each topic."""
    from rosbags.highlevel import AnyReader

    with tempfile.TemporaryDirectory(prefix="stopgo-") as folder:
        bag = Path(folder) / "bag.mcap"
        bag.write_bytes(data)
        with AnyReader([bag], default_typestore=_types()) as reader:
            return {
                connection.topic: reader.deserialize(raw, connection.msgtype)
                for connection, _, raw in reader.messages()
            }


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """In which frame the poses are, where that is not the map."""
    return unmapped(mission)


def _messages(mission: Mission, types: Typestore) -> dict[str, Any]:
    kinds = types.types
    header = _header(mission, kinds)
    poses = [(waypoint, _pose(waypoint, kinds)) for waypoint in way(mapped(mission))]
    stamped = [kinds["geometry_msgs/msg/PoseStamped"](header=header, pose=pose) for _, pose in poses]
    stops = [pose for waypoint, pose in poses if waypoint.stop is not None]
    return {
        PATH: kinds["nav_msgs/msg/Path"](header=header, poses=stamped),
        STOPS: kinds["geometry_msgs/msg/PoseArray"](header=header, poses=stops),
    }


def _header(mission: Mission, kinds: Any) -> Any:
    time = kinds["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    return kinds["std_msgs/msg/Header"](stamp=time, frame_id=frame_name(mission))


def _pose(waypoint: Waypoint, kinds: Any) -> Any:
    half = waypoint.heading / 2
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
    return kinds["geometry_msgs/msg/Pose"](
        position=kinds["geometry_msgs/msg/Point"](x=waypoint.x, y=waypoint.y, z=0.0),
        orientation=kinds["geometry_msgs/msg/Quaternion"](**turn),
    )


def _latched() -> Any:
    """Quality of service for late subscribers: transient local, as for maps."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    ever = QosTime(sec=9_223_372_036, nsec=854_775_807)  # as ROS 2 writes "no limit"
    return Qos(
        QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
        ever, ever, QosLiveliness.AUTOMATIC, ever, avoid_ros_namespace_conventions=False,
    )  # fmt: skip


def _types() -> Typestore:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)
