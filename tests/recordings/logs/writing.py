"""Writes small logs of every format, so that tests know what is in them."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

BEGIN_NS = 1_700_000_000 * 10**9
ODOMETRY, TF = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
Pose = tuple[float, float, float]
"""x, y, heading."""


class Messages:
    """Messages of one ROS's types."""

    def __init__(self, ros2: bool) -> None:
        self.ros2 = ros2
        self.store = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)

    def of(self, kind: str, **fields: Any) -> Any:
        package, _, name = kind.partition("/")
        return self.store.types[f"{package}/msg/{name}"](**fields)

    def header(self, ns: int, frame: str) -> Any:
        stamp = self.of("builtin_interfaces/Time", sec=ns // 10**9, nanosec=ns % 10**9)
        return self.of("std_msgs/Header", stamp=stamp, frame_id=frame, **({} if self.ros2 else {"seq": 0}))

    def turn(self, heading: float) -> Any:
        return self.of("geometry_msgs/Quaternion", x=0.0, y=0.0, z=np.sin(heading / 2), w=np.cos(heading / 2))

    def odometry(self, ns: int, pose: Pose, frame: str = "odom") -> Any:
        x, y, heading = pose
        zero = self.of("geometry_msgs/Vector3", x=0.0, y=0.0, z=0.0)
        place = self.of(
            "geometry_msgs/Pose",
            position=self.of("geometry_msgs/Point", x=x, y=y, z=0.0),
            orientation=self.turn(heading),
        )
        return self.of(
            "nav_msgs/Odometry",
            header=self.header(ns, frame),
            child_frame_id="base_link",
            pose=self.of("geometry_msgs/PoseWithCovariance", pose=place, covariance=np.zeros(36)),
            twist=self.of(
                "geometry_msgs/TwistWithCovariance",
                twist=self.of("geometry_msgs/Twist", linear=zero, angular=zero),
                covariance=np.zeros(36),
            ),
        )

    def transform(self, ns: int, parent: str, child: str, pose: Pose) -> Any:
        x, y, heading = pose
        move = self.of("geometry_msgs/Vector3", x=x, y=y, z=0.0)
        one = self.of(
            "geometry_msgs/TransformStamped",
            header=self.header(ns, parent),
            child_frame_id=child,
            transform=self.of("geometry_msgs/Transform", translation=move, rotation=self.turn(heading)),
        )
        return self.of("tf2_msgs/TFMessage", transforms=[one])

    def raw(self, message: Any, msgtype: str) -> bytes:
        if self.ros2:
            return bytes(self.store.serialize_cdr(message, msgtype))
        return bytes(self.store.serialize_ros1(message, msgtype))


Row = tuple[str, str, int, Any]
"""Topic, type, log time, message."""


def write_bag(path: Path, rows: Sequence[Row]) -> Path:
    """By the suffix: .bag, or a rosbag2 folder called `….mcap` or `….db3`."""
    ros2 = path.suffix != ".bag"
    messages = Messages(ros2)
    storage = {".mcap": StoragePlugin.MCAP, ".db3": StoragePlugin.SQLITE3}.get(path.suffix)
    writer = Writer2(path, version=9, storage_plugin=storage) if storage is not None else Writer1(path)
    with writer:
        known: dict[str, Any] = {}
        for topic, msgtype, ns, message in rows:
            if topic not in known:
                known[topic] = writer.add_connection(topic, msgtype, typestore=messages.store)
            writer.write(known[topic], ns, messages.raw(message, msgtype))
    return path


def odometry_rows(
    poses: Sequence[Pose], *, ros2: bool, topic: str = "/odom", step_ns: int = 10**8
) -> list[Row]:
    """An odometry message for each pose, 0.1 s apart, logged 5 ms after its stamp."""
    messages = Messages(ros2)
    times = [BEGIN_NS + k * step_ns for k in range(len(poses))]
    return [
        (topic, ODOMETRY, ns + 5_000_000, messages.odometry(ns, pose))
        for ns, pose in zip(times, poses, strict=True)
    ]


def write_dataflash(
    path: Path, rows: Sequence[tuple[str, tuple[Any, ...]]], kinds: dict[str, tuple[str, str]]
) -> Path:
    """An ArduPilot .BIN; `kinds` has format and columns by name."""
    letters = {
        "Q": "Q",
        "B": "B",
        "H": "H",
        "L": "i",
        "f": "f",
        "c": "h",
        "d": "d",
        "M": "B",
        "Z": "64s",
        "h": "h",
    }
    numbers = {name: 10 + k for k, name in enumerate(kinds)}
    packing = {name: "<" + "".join(letters[one] for one in form) for name, (form, _) in kinds.items()}
    data = bytearray()
    for name, (form, columns) in kinds.items():
        length = 3 + struct.calcsize(packing[name])
        data += b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", numbers[name], length, name.encode(), form.encode(), columns.encode()
        )
    for name, values in rows:
        data += b"\xa3\x95" + bytes([numbers[name]]) + struct.pack(packing[name], *values)
    path.write_bytes(data)
    return path


def write_telemetry_log(path: Path, told: Sequence[tuple[int, int, Any]]) -> Path:
    """A .tlog of (ns, system, message)."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    data = bytearray()
    for ns, system, message in told:
        data += struct.pack(">Q", ns // 1000) + message.pack(
            dialect.MAVLink(None, srcSystem=system, srcComponent=1)
        )
    path.write_bytes(data)
    return path


def write_ulog(path: Path, tables: dict[str, tuple[Sequence[str], Sequence[tuple[Any, ...]]]]) -> Path:
    """A PX4 .ulg; each table has its fields, such as `float x` (first `uint64_t timestamp`), and its rows."""
    letters = {"uint64_t": "Q", "float": "f", "double": "d", "bool": "?", "uint8_t": "B", "uint32_t": "I"}

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), kind[0]) + body

    data = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))
    for name, (fields, _) in tables.items():
        data += message(b"F", f"{name}:{''.join(f'{field};' for field in fields)}".encode())
    for number, name in enumerate(tables):
        data += message(b"A", struct.pack("<BH", 0, number) + name.encode())
    for number, (fields, rows) in enumerate(tables.values()):
        form = "<" + "".join(letters[field.split()[0]] for field in fields)
        for row in rows:
            data += message(b"D", struct.pack("<H", number) + struct.pack(form, *row))
    path.write_bytes(data)
    return path


def write_json_mcap(
    path: Path, rows: Sequence[tuple[str, str, int, Any]], *, chunked: bool = True, encoding: str = "json"
) -> Path:
    """An MCAP of (topic, schema, log time, JSON value), without an index, as a recorder leaves it."""
    import lz4.frame

    def record(kind: int, body: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(body)) + body

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value.encode())) + value.encode()

    numbers = {key: k for k, key in enumerate(dict.fromkeys((topic, schema) for topic, schema, _, _ in rows))}
    data = b""
    for (topic, schema), number in numbers.items():
        body = text(schema) + text("jsonschema") + struct.pack("<I", 2) + b"{}"
        data += record(3, struct.pack("<H", number + 1) + body)
        data += record(
            4, struct.pack("<HH", number, number + 1) + text(topic) + text(encoding) + struct.pack("<I", 0)
        )
    for k, (topic, schema, ns, value) in enumerate(rows):
        head = struct.pack("<HIQQ", numbers[topic, schema], k, ns, ns)
        data += record(5, head + (value if isinstance(value, bytes) else json.dumps(value).encode()))
    if chunked:
        packed = lz4.frame.compress(data)
        head = struct.pack("<QQQI", 0, 2**62, len(data), 0)
        data = record(6, head + text("lz4") + struct.pack("<Q", len(packed)) + packed)
    magic = b"\x89MCAP0\r\n"
    ends = record(0x0F, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0))
    path.write_bytes(magic + record(1, text("") + text("test")) + data + ends + magic)
    return path


def foxglove_time(ns: int) -> dict[str, int]:
    return {"sec": ns // 10**9, "nsec": ns % 10**9}


def foxglove_pose(pose: Pose, height: float = 0.0) -> dict[str, Any]:
    x, y, heading = pose
    turn = {"x": 0.0, "y": 0.0, "z": float(np.sin(heading / 2)), "w": float(np.cos(heading / 2))}
    return {"position": {"x": x, "y": y, "z": height}, "orientation": turn}


def foxglove_transform(ns: int, parent: str, child: str, pose: Pose) -> dict[str, Any]:
    given = foxglove_pose(pose)
    return {
        "timestamp": foxglove_time(ns), "parent_frame_id": parent, "child_frame_id": child,
        "translation": given["position"], "rotation": given["orientation"],
    }  # fmt: skip
