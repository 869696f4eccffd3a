"""Reader of Foxglove's JSON messages in MCAP: they become objects with the fields of ROS's messages.

Poses, transforms, fixes, laser scans and point clouds are read. A trajectory in one message (PosesInFrame
with several poses) has a single time, and is left out.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray
from stopgo.recordings.logs.ros_bag import Bag, BagMessage, Topic, UnknownType
from stopgo.recordings.logs.salvage import Salvaged, is_mcap, salvage

FORMAT = "Foxglove JSON (mcap)"
PARTS = {"foxglove.FrameTransforms": "transforms", "foxglove.LocationFixes": "fixes"}
"""Types that contain several of another type, and the field with them."""
NUMBER_TYPES = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5, 7: 7, 8: 8}
"""Numeric types of Foxglove's packed fields, as those of sensor_msgs/PointField."""


ROS = {"", "cdr", "ros1"}
"""Encodings of ROS, and of damaged channels."""


@contextmanager
def json_bag(files: Sequence[Path]) -> Iterator[Bag | None]:
    """Open MCAP files as a bag if a channel of them has another encoding than ROS's; else None.

    Raises
    ------
    InputError
        When no channel is JSON.
    """
    if not all(map(is_mcap, files)):
        yield None
        return
    with salvage(files, "") as found:
        others = sorted({c.encoding for c in found.connections} - ROS)
        if others and "json" not in others:
            raise InputError(
                f"{files[0]}: its channels are in {', '.join(others)}; record or convert them as JSON"
            )
        yield _bag(found) if others else None


def _bag(found: Salvaged) -> Bag:
    known = [c for c in found.connections if c.encoding == "json"]
    topics = {c.number: Topic(c.number, c.topic, c.msgtype, None) for c in known}
    others = sorted({c.encoding or "unknown" for c in found.connections} - {"json"})

    def messages(wanted: Sequence[Topic]) -> Iterator[BagMessage]:
        numbers = {topic.number for topic in wanted}
        for number, ns, raw in found.messages():
            if number in numbers:
                yield from ((topics[number], ns, part) for part in _parts(topics[number].msgtype, raw))

    notes = (f"channels in {', '.join(others)} are not read; export them as JSON",) if others else ()
    return Bag(
        ros2=True, topics=tuple(topics.values()), messages=messages, decode=_decoded, lost=found.lost,
        form=FORMAT, notes=notes,
    )  # fmt: skip


def _parts(kind: str, raw: bytes) -> Iterator[bytes]:
    """Yield a message, or each of its parts; one that has none is left to `_decoded`."""
    if kind not in PARTS:
        yield raw
        return
    try:
        parts = [json.dumps(part).encode() for part in json.loads(raw)[PARTS[kind]]]
    except (ValueError, KeyError, TypeError, RecursionError):
        parts = [raw]
    yield from parts


def _decoded(topic: Topic, raw: bytes) -> Any:
    """Return a message as an object.

    Raises
    ------
    UnknownType
        If it is no JSON, or not of its type.
    """
    try:
        return KINDS[topic.msgtype](json.loads(raw))
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise UnknownType(f"text that is not a {topic.msgtype}") from None


def _stamp(given: Any) -> SimpleNamespace:
    return SimpleNamespace(sec=int(given["sec"]), nanosec=int(given.get("nsec", given.get("nanosec", 0))))


def _header(given: Any, frame: str = "frame_id") -> SimpleNamespace:
    return SimpleNamespace(stamp=_stamp(given["timestamp"]), frame_id=str(given[frame]))


def _vector(given: Any, names: str = "xyz") -> SimpleNamespace:
    return SimpleNamespace(**{name: float(given[name]) for name in names})


def _pose(given: Any) -> SimpleNamespace:
    return SimpleNamespace(
        position=_vector(given["position"]), orientation=_vector(given["orientation"], "xyzw")
    )


def _pose_in_frame(given: Any) -> SimpleNamespace:
    return SimpleNamespace(header=_header(given), pose=_pose(given["pose"]))


def _single_pose(given: Any) -> SimpleNamespace:
    """Return the one pose of a message; of several at one time, none is the robot's.

    Raises
    ------
    UnknownType
        When there are several, or none.
    """
    if len(given["poses"]) != 1:
        raise UnknownType("several poses at one time, or none")
    return _pose_in_frame({**given, "pose": given["poses"][0]})


def _transform(given: Any) -> SimpleNamespace:
    move = SimpleNamespace(
        translation=_vector(given["translation"]), rotation=_vector(given["rotation"], "xyzw")
    )
    header = _header(given, "parent_frame_id")
    one = SimpleNamespace(header=header, child_frame_id=str(given["child_frame_id"]), transform=move)
    return SimpleNamespace(transforms=[one])


def _fix(given: Any) -> SimpleNamespace:
    return SimpleNamespace(
        header=_header({"frame_id": "", **given}),
        status=SimpleNamespace(status=0),
        latitude=float(given["latitude"]),
        longitude=float(given["longitude"]),
    )


def _laser_scan(given: Any) -> SimpleNamespace:
    """Return ranges at even angles; a range of 0 or less is no measurement."""
    ranges = np.array(given["ranges"], float).reshape(-1)
    begin, end = float(given["start_angle"]), float(given["end_angle"])
    return SimpleNamespace(
        header=_header(given), mount=_pose(given["pose"]), ranges=ranges,
        angle_min=begin, angle_increment=(end - begin) / max(1, len(ranges) - 1),
        range_min=np.nextafter(0, 1), range_max=np.inf,
    )  # fmt: skip


def _point_cloud(given: Any) -> SimpleNamespace:
    data = np.frombuffer(base64.b64decode(given["data"], validate=True), np.uint8)
    step = int(given["point_stride"])
    if step <= 0:
        raise ValueError(step)
    fields = [
        SimpleNamespace(
            name=str(item["name"]),
            offset=int(item["offset"]),
            datatype=NUMBER_TYPES.get(int(item["type"]), 0),
        )
        for item in given["fields"]
    ]
    if any(item.offset < 0 for item in fields):
        raise ValueError(fields)
    count = len(data) // step
    return SimpleNamespace(
        header=_header(given), mount=_pose(given["pose"]), is_bigendian=False, fields=fields,
        point_step=step, row_step=count * step, width=count, height=1, data=data,
    )  # fmt: skip


KINDS: dict[str, Callable[[Any], SimpleNamespace]] = {
    "foxglove.PoseInFrame": _pose_in_frame,
    "foxglove.PosesInFrame": _single_pose,
    "foxglove.FrameTransform": _transform,
    "foxglove.FrameTransforms": _transform,
    "foxglove.LocationFix": _fix,
    "foxglove.LocationFixes": _fix,
    "foxglove.LaserScan": _laser_scan,
    "foxglove.PointCloud": _point_cloud,
}


def on_mount(xyz: FloatArray, mount: Any) -> FloatArray:
    """Return points (n, 3) in the message's frame: they are measured from the pose `mount` in it."""
    at, turn = mount.position, mount.orientation
    axis, w = np.array([turn.x, turn.y, turn.z]), turn.w
    if not 0.5 < w * w + axis @ axis < 2.0:
        return np.empty((0, 3))
    across = np.cross(axis, xyz)
    return np.asarray(xyz + 2 * (w * across + np.cross(axis, across)) + (at.x, at.y, at.z))


POSES = ("foxglove.PoseInFrame", "foxglove.PosesInFrame")
TRANSFORMS = ("foxglove.FrameTransform", "foxglove.FrameTransforms")
FIXES = ("foxglove.LocationFix", "foxglove.LocationFixes")


__all__ = ["FIXES", "POSES", "TRANSFORMS", "json_bag", "on_mount"]
