"""Poses of ROS messages of known types, read from their bytes: a log contains hundreds of thousands.

Reading only stamp and pose is twice as fast as a whole decoder. The first message of every topic is also
decoded as a whole; if the results differ, all messages of that topic are.
"""

from __future__ import annotations

import math
import struct
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from stopgo.mission.geometry import FloatArray


class Stamped(NamedTuple):
    """Pose in a message, with its stamp."""

    stamp_ns: int
    frame: str
    x: float
    y: float
    z: float
    quaternion: tuple[float, float, float, float]
    """x, y, z, w."""


WITH_CHILD = "nav_msgs/msg/Odometry"
TYPES = (WITH_CHILD, "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")


def heading_of(quaternion: tuple[float, float, float, float]) -> float:
    """Return the rotation about z, radians; NaN for an invalid quaternion."""
    x, y, z, w = quaternion
    if not 0.5 < x * x + y * y + z * z + w * w < 2.0:
        return math.nan
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _from_cdr(raw: bytes, child: bool) -> Stamped:
    """Read ROS 2 bytes: each value is at a multiple of its size, counted from byte 4."""
    order = "<" if raw[1] & 1 else ">"
    seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", raw, 4)
    frame = raw[16 : 15 + length].decode("utf-8", "replace")
    at = 16 + length
    if child:
        at = _next(at, 4)
        at += 4 + struct.unpack_from(f"{order}I", raw, at)[0]
    values = struct.unpack_from(f"{order}7d", raw, _next(at - 4, 8) + 4)
    return Stamped(seconds * 10**9 + nanoseconds, frame, values[0], values[1], values[2], values[3:])


def _next(at: int, size: int) -> int:
    return -(-at // size) * size


def _from_ros1(raw: bytes, child: bool) -> Stamped:
    """Read ROS 1 bytes: values follow each other without padding."""
    _, seconds, nanoseconds, length = struct.unpack_from("<IIII", raw)
    frame = raw[16 : 16 + length].decode("utf-8", "replace")
    at = 16 + length
    if child:
        at += 4 + struct.unpack_from("<I", raw, at)[0]
    values = struct.unpack_from("<7d", raw, at)
    return Stamped(seconds * 10**9 + nanoseconds, frame, values[0], values[1], values[2], values[3:])


def _from_message(message: Any) -> Stamped:
    """Read a message that was decoded as a whole."""
    header, pose = message.header, message.pose
    while hasattr(pose, "pose"):
        pose = pose.pose
    position, rotation = pose.position, pose.orientation
    stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
    return Stamped(
        stamp,
        header.frame_id,
        position.x,
        position.y,
        position.z,
        (rotation.x, rotation.y, rotation.z, rotation.w),
    )


@dataclass
class PoseColumns:
    """Poses of one topic, while they are read."""

    topic: str
    msgtype: str
    ros2: bool
    decode: Callable[[bytes], Any]
    stamp_ns: array[int] = field(default_factory=lambda: array("q"))
    logged_ns: array[int] = field(default_factory=lambda: array("q"))
    values: array[float] = field(default_factory=lambda: array("d"))
    frames: dict[str, int] = field(default_factory=dict)
    """Index of each frame."""
    in_frame: array[int] = field(default_factory=lambda: array("l"))
    _read: Callable[[bytes], Stamped] | None = None

    def take(self, logged_ns: int, raw: bytes) -> None:
        """Read a message; raises struct.error if it has too few bytes."""
        if self._read is None:
            self._read = self._reader(raw)
        pose = self._read(raw)
        x, y, z, w = pose.quaternion
        self.stamp_ns.append(pose.stamp_ns)
        self.logged_ns.append(logged_ns)
        self.values.extend((pose.x, pose.y, pose.z, x, y, z, w))
        number = self.frames.setdefault(pose.frame.lstrip("/"), len(self.frames))
        self.in_frame.append(number)

    def _reader(self, raw: bytes) -> Callable[[bytes], Stamped]:
        child = self.msgtype == WITH_CHILD
        fast = _from_cdr if self.ros2 else _from_ros1
        whole = _from_message(self.decode(raw))
        try:
            if fast(raw, child) == whole._replace(frame=whole.frame):
                return lambda data: fast(data, child)
        except (struct.error, IndexError):
            pass
        return lambda data: _from_message(self.decode(data))

    def of_frame(self, frame: str) -> tuple[np.ndarray, np.ndarray, FloatArray, FloatArray]:
        """Return stamps, log times, positions (n, 3) and headings (n,) in a frame."""
        in_frame = np.array(self.in_frame, np.int64) == self.frames[frame]
        values = np.array(self.values).reshape(-1, 7)[in_frame]
        stamps, logged = (np.array(times, np.int64)[in_frame] for times in (self.stamp_ns, self.logged_ns))
        return stamps, logged, values[:, :3], headings_of(values[:, 3:])


def headings_of(quaternions: FloatArray) -> FloatArray:
    """Return rotations about z of quaternions (n, 4) x, y, z, w; NaN for invalid ones."""
    x, y, z, w = quaternions.T
    rotation = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    size = (quaternions**2).sum(axis=1)
    return np.where((size > 0.5) & (size < 2.0), rotation, np.nan)
