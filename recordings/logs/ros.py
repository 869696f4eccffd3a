"""Reader of ROS logs: ROS 1 .bag, and of ROS 2 a folder, a raw .mcap or .db3, complete or damaged."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.recordings.logs import foxglove
from stopgo.recordings.logs.bag_sizes import LARGEST_CHUNK, LONGEST_MESSAGE
from stopgo.recordings.logs.field_log import Channel, FieldLog, Poses, Reading, Sweep, fixes_of, poses_of
from stopgo.recordings.logs.ros_bag import Bag, Damaged, Topic, UnknownType, files_of, salvaged_bag, whole_bag
from stopgo.recordings.logs.ros_poses import TYPES, WITH_CHILD, PoseColumns, heading_of
from stopgo.recordings.logs.ros_sweeps import SWEEPS
from stopgo.recordings.logs.transforms import TransformTree

POSES = (*TYPES, *foxglove.POSES)
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage", *foxglove.TRANSFORMS)
FIXES = ("sensor_msgs/msg/NavSatFix", *foxglove.FIXES)
BATTERY = "sensor_msgs/msg/BatteryState"
LONGEST = dict.fromkeys((*POSES, *TRANSFORMS, *FIXES, BATTERY), LONGEST_MESSAGE)
LONGEST_SWEEPS = dict.fromkeys(SWEEPS, LARGEST_CHUNK)
"""Bytes that a message may have at most, by the types that are read."""
SIMULATED_BELOW_NS = 10**18
"""Times before September 2001 are simulated, or count from a start."""
NOT_THE_ROBOT = ("goal", "target", "setpoint", "initialpose", "plan", "desired", "reference")
"""Words in the names of topics that contain goals, not the robot's pose."""
TICK_EVERY = 20_000
LATEST_NS = (1 << 63) - 1


def read_ros(path: Path, reading: Reading) -> FieldLog:
    """Read a bag to its end, or the readable part of it.

    Raises
    ------
    InputError
        When it is not a bag, or nothing in it can be read.
    """
    try:
        with whole_bag(path, LONGEST) as bag:
            return _read_bag(path, bag, reading)
    except Damaged as damage:
        with _readable_bag(path, damage) as bag:
            found = _read_bag(path, bag, reading)
    if not found.messages and not found.oddities:
        raise InputError(f"{path}: nothing in it can be read ({found.lost}); incomplete copy?")
    return found


@contextmanager
def _readable_bag(path: Path, damage: Damaged) -> Iterator[Bag]:
    """Open a bag that rosbags does not read: one with JSON, else the readable part of a damaged one."""
    with foxglove.json_bag(files_of(path)) as bag:
        if bag is not None:
            yield bag
            return
    with salvaged_bag(path, str(damage)) as bag:
        yield bag


def _read_bag(path: Path, bag: Bag, reading: Reading) -> FieldLog:
    sorter = _TopicSorter(bag, reading)
    wanted = [topic for topic in bag.topics if topic.count is None or sorter.wants(topic)]
    total = sum(topic.count or 0 for topic in wanted)
    for number, message in enumerate(bag.messages(wanted)):
        sorter.take(*message)
        if number % TICK_EVERY == 0:
            reading.tick(number / total if total else 0.0)
    counts = {t: sorter.counts[t] if t.count is None else t.count for t in bag.topics}
    begin, end = sorter.span()
    return FieldLog(
        path=str(path),
        format=_format(path, bag),
        digest=file_digest(*files_of(path)),
        messages=sum(counts.values()),
        clock="simulated" if 0 < end < SIMULATED_BELOW_NS else "wall",
        begin_ns=begin,
        end_ns=end,
        channels=_channels(counts),
        poses=(*sorter.poses(), *sorter.earth_poses()),
        battery=tuple(sorter.battery),
        mounts=sorter.mounts(),
        sweeps=lambda: _sweeps(path, reading),
        lost=bag.lost(),
        oddities=(*bag.notes, *sorter.oddities()),
    )


def _format(path: Path, bag: Bag) -> str:
    if bag.form or not bag.ros2:
        return bag.form or "ROS 1 bag"
    kinds = sorted({file.name.removesuffix(".zstd").rpartition(".")[2] for file in files_of(path)})
    return f"ROS 2 bag ({', '.join(kinds)})"


def _channels(counts: dict[Topic, int]) -> tuple[Channel, ...]:
    """Return one channel per topic, whatever the number of its connections."""
    merged: Counter[tuple[str, str]] = Counter()
    for topic, count in counts.items():
        merged[topic.name, topic.msgtype] += count
    return tuple(Channel(name, kind, count) for (name, kind), count in sorted(merged.items()))


@dataclass
class _TopicSorter:
    """Reads messages one after another, each by its type."""

    bag: Bag
    reading: Reading
    columns: dict[str, PoseColumns] = field(default_factory=dict)
    tree: TransformTree = field(default_factory=TransformTree)
    fixes: dict[str, list[tuple[int, float, float]]] = field(default_factory=dict)
    battery: list[tuple[int, float]] = field(default_factory=list)
    counts: Counter[Topic] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    logged: list[int] = field(default_factory=list)
    """First and last time."""

    def wants(self, topic: Topic) -> bool:
        return topic.msgtype in LONGEST

    def take(self, topic: Topic, ns: int, raw: bytes) -> None:
        self.counts[topic] += 1
        if not 0 <= ns <= LATEST_NS:
            self.faults[f"{topic.name}: a time of logging that is no date"] += 1
            return
        self.logged = [min(self.logged[0], ns), max(self.logged[1], ns)] if self.logged else [ns, ns]
        handler = self._handler_of(topic)
        if handler is None:
            return
        if len(raw) > LONGEST_MESSAGE:
            self.faults[f"{topic.name}: longer than any {topic.msgtype}"] += 1
            return
        try:
            handler(topic, ns, raw)
        except UnknownType as error:
            self.faults[f"{topic.name}: {error}"] += 1
        except (struct.error, IndexError, AttributeError):
            self.faults[f"{topic.name}: bytes that are not a {topic.msgtype}"] += 1

    def _handler_of(self, topic: Topic) -> Callable[[Topic, int, bytes], None] | None:
        if topic.msgtype in POSES:
            return self._pose
        if topic.msgtype in TRANSFORMS:
            return self._transforms
        if topic.msgtype in FIXES:
            return self._fix
        return self._charge if topic.msgtype == BATTERY else None

    def _pose(self, topic: Topic, ns: int, raw: bytes) -> None:
        if topic.name not in self.columns:
            decode = lambda data: self.bag.decode(topic, data)  # noqa: E731
            self.columns[topic.name] = PoseColumns(topic.name, topic.msgtype, self.bag.ros2, decode)
        self.columns[topic.name].take(ns, raw)

    def _transforms(self, topic: Topic, ns: int, raw: bytes) -> None:
        for item in self.bag.decode(topic, raw).transforms:
            move, rotation = item.transform.translation, item.transform.rotation
            heading = heading_of((rotation.x, rotation.y, rotation.z, rotation.w))
            stamp = self._time(item.header.stamp.sec * 10**9 + item.header.stamp.nanosec, ns)
            static = topic.name.endswith("tf_static")
            self.tree.add(
                item.header.frame_id, item.child_frame_id, stamp, (move.x, move.y, heading), static=static
            )

    def _fix(self, topic: Topic, ns: int, raw: bytes) -> None:
        fix = self.bag.decode(topic, raw)
        stamp = self._time(fix.header.stamp.sec * 10**9 + fix.header.stamp.nanosec, ns)
        if fix.status.status >= 0:
            self.fixes.setdefault(topic.name, []).append((stamp, fix.latitude, fix.longitude))

    def _charge(self, topic: Topic, ns: int, raw: bytes) -> None:
        fraction = float(self.bag.decode(topic, raw).percentage)
        if 0 <= fraction <= 1:
            self.battery.append((ns, fraction))

    def _time(self, stamp_ns: int, logged_ns: int) -> int:
        """Return the time that counts; a stamp of 0 was never set."""
        return logged_ns if self.reading.stamps == "log" or stamp_ns == 0 else stamp_ns

    def span(self) -> tuple[int, int]:
        """Return the begin and end of the log, from its poses if it has any."""
        tracks = [*self.poses(), *self.earth_poses()]
        if tracks:
            return min(int(t.ns[0]) for t in tracks), max(int(t.ns[-1]) for t in tracks)
        return (self.logged[0], self.logged[1]) if self.logged else (0, 0)

    def poses(self) -> tuple[Poses, ...]:
        """Return poses from every topic and frame that contains any, and from transforms."""
        if self._poses is None:
            found = [track for column in self.columns.values() for track in self._of(column)]
            chained = self._of_transforms()
            self._poses = tuple(([chained] if chained is not None else []) + found)
        return self._poses

    _poses: tuple[Poses, ...] | None = None

    def _of(self, column: PoseColumns) -> Iterator[Poses]:
        for frame in column.frames:
            stamps, logged, xyz, heading = column.of_frame(frame)
            ns = logged if self.reading.stamps == "log" else np.where(stamps == 0, logged, stamps)
            track = poses_of(
                column.topic, frame, ns, xyz[:, :2], heading, height=xyz[:, 2],
                robot=_namespace(column.topic), rank=_rank(column.topic, column.msgtype, frame),
            )  # fmt: skip
            if track is not None:
                yield track

    def _of_transforms(self) -> Poses | None:
        chain = self.tree.robot_chain(self.reading.frame)
        if not chain:
            return None
        ns, xy, heading = self.tree.poses(chain)
        names = " > ".join([chain[0][0], *(child for _, child in chain)])
        rank = 0 if self.reading.frame is not None or chain[0][0] == "map" else 5
        return poses_of(f"tf {names}", chain[0][0], ns, xy, heading, rank=rank)

    def earth_poses(self) -> tuple[Poses, ...]:
        tracks = []
        for topic, rows in self.fixes.items():
            table = np.array(rows)
            nowhere = np.full(len(rows), np.nan)
            ns = [row[0] for row in rows]
            tracks.append(
                fixes_of(topic, "wgs84", ns, table[:, 1:], nowhere, robot=_namespace(topic), rank=6)
            )
        return tuple(track for track in tracks if track is not None)

    def mounts(self) -> tuple[tuple[str, float, float, float], ...]:
        chain = self.tree.robot_chain(self.reading.frame)
        return self.tree.mounts(chain[-1][1]) if chain else self.tree.mounts("base_link")

    def oddities(self) -> tuple[str, ...]:
        lines = [f"{fault} ({count} messages, left out)" for fault, count in self.faults.items()]
        apart = self._clocks_apart()
        return (*lines, apart) if apart else tuple(lines)

    def _clocks_apart(self) -> str:
        """Return a note if the messages' stamps are from another clock than the log's times."""
        for column in self.columns.values():
            stamps, logged = np.array(column.stamp_ns, np.int64), np.array(column.logged_ns, np.int64)
            difference = np.abs(stamps - logged)[stamps != 0] / 1e9
            if len(difference) and float(np.median(difference)) > APART_S:
                counts = "stamps count" if self.reading.stamps == "header" else "log times count"
                return (
                    f"{column.topic}: stamps differ by {np.median(difference):.0f} s from the log's own times"
                    f" (simulated time, or clocks that were not set); the {counts}"
                )
        return ""


APART_S = 60.0


def _namespace(topic: str) -> str:
    """Return the robot's part of a topic: `r1` of `/r1/odom`."""
    return "/".join(topic.strip("/").split("/")[:-1])


def _rank(topic: str, msgtype: str, frame: str) -> int:
    """Return the priority of a source: map matching first, then odometry."""
    if any(word in topic.lower() for word in NOT_THE_ROBOT):
        return 9
    if msgtype.endswith("PoseWithCovarianceStamped"):
        return 1
    if frame == "map":
        return 2
    return 3 if msgtype == WITH_CHILD else 4


def _sweeps(path: Path, reading: Reading) -> Iterator[Sweep]:
    """Yield the scans of the log, in order; of a damaged log, the readable ones."""
    try:
        with whole_bag(path, LONGEST_SWEEPS) as bag:
            for _ in bag.messages(_with_sweeps(bag)):  # damage is found only by reading
                pass
    except Damaged as damage:
        with _readable_bag(path, damage) as bag:
            yield from _sweeps_of(bag, reading)
        return
    with whole_bag(path, LONGEST_SWEEPS) as bag:
        yield from _sweeps_of(bag, reading)


def _with_sweeps(bag: Bag) -> list[Topic]:
    return [topic for topic in bag.topics if topic.msgtype in SWEEPS]


def _sweeps_of(bag: Bag, reading: Reading) -> Iterator[Sweep]:
    for topic, ns, raw in bag.messages(_with_sweeps(bag)):
        try:
            message = bag.decode(topic, raw)
        except UnknownType:
            continue  # counted when the log was read
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        when = ns if reading.stamps == "log" or stamp == 0 else stamp
        frame = message.header.frame_id.lstrip("/")
        yield Sweep(when, topic.name, frame, SWEEPS[topic.msgtype](message))
