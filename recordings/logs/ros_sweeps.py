"""Laser scans and point clouds of ROS, as points in the scanner's frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from stopgo.mission.geometry import FloatArray
from stopgo.recordings.logs.foxglove import on_mount


def _of_laser_scan(message: Any) -> FloatArray:
    ranges = np.asarray(message.ranges, float)
    angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
    valid = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges <= message.range_max)
    ranges, angles = ranges[valid], angles[valid]
    flat = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
    return np.column_stack([flat, np.zeros(len(flat))])


KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Number types of sensor_msgs/PointField."""


def _of_point_cloud(message: Any) -> FloatArray:
    """Return the points; none if the cloud's description does not match its bytes."""
    order = ">" if message.is_bigendian else "<"
    axes = {item.name: item for item in message.fields if item.name in ("x", "y", "z")}
    if {"x", "y"} - axes.keys() or any(item.datatype not in KINDS for item in axes.values()):
        return np.empty((0, 3))
    forms = {name: np.dtype(order + KINDS[item.datatype]) for name, item in axes.items()}
    step, wide = int(message.point_step), int(message.width) * int(message.point_step)
    if any(item.offset + forms[name].itemsize > step for name, item in axes.items()):
        return np.empty((0, 3))
    kind = np.dtype({
        "names": list(forms), "formats": list(forms.values()),
        "offsets": [axes[name].offset for name in forms], "itemsize": step,
    })  # fmt: skip
    data = np.asarray(message.data, np.uint8)
    pitch = max(int(message.row_step), wide)
    if message.height > 1 and pitch > wide and len(data) >= message.height * pitch:  # rows are padded
        data = data[: message.height * pitch].reshape(message.height, pitch)[:, :wide].ravel()
    rows = np.frombuffer(data[: len(data) // step * step].tobytes(), kind)
    z = rows["z"] if "z" in axes else np.zeros(len(rows))
    xyz = np.stack([rows["x"], rows["y"], z], axis=-1).astype(float)
    return xyz[np.isfinite(xyz).all(axis=1)]


def _mounted(points: Callable[[Any], FloatArray]) -> Callable[[Any], FloatArray]:
    """Return the function for a message that also has the pose of its scanner."""
    return lambda message: on_mount(points(message), message.mount)


SWEEPS: dict[str, Callable[[Any], FloatArray]] = {
    "sensor_msgs/msg/LaserScan": _of_laser_scan,
    "sensor_msgs/msg/PointCloud2": _of_point_cloud,
    "foxglove.LaserScan": _mounted(_of_laser_scan),
    "foxglove.PointCloud": _mounted(_of_point_cloud),
}
"""Function per type that returns its points (n, 3)."""
