"""A robot without physics and Nav2's servers on a zenoh network, as the sources of rmw_zenoh and Nav2 say.

Keys, tokens and attachments are written here from rmw_zenoh's design, not with stopgo's node. A codec gives
hashes and CDR. One goal at a time: a new one ends the old one as aborted; a cancelled one ends with zero
velocity. The base stands `VELOCITY_TIMEOUT_S` after the last velocity.

`python -m tests.bridge.ros2.zenoh_nav2 ENDPOINT DOMAIN FOLDER SPEED`: a process, with the codec of real ROS.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import zenoh

HZ = 50.0
TURN_RATE = 2.5
TOLERANCE_M, TOLERANCE_RAD = 0.02, 0.02
VELOCITY_TIMEOUT_S = 0.5
SCAN_S = 0.3
EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = 2, 3, 4, 5, 6
LIVE = (EXECUTING, CANCELING)
NOTHING = bytes(16)


Answer = Callable[[Mapping[str, Any]], None]


class Codec(Protocol):
    """CDR and hashes of types such as nav2_msgs/action/FollowPath_SendGoal_Request."""

    def hash(self, kind: str) -> str: ...

    def encode(self, kind: str, fields: Mapping[str, Any]) -> bytes: ...

    def decode(self, kind: str, data: bytes) -> Any: ...


def stamp() -> dict[str, int]:
    now_ns = time.time_ns()
    return {"sec": now_ns // 10**9, "nanosec": now_ns % 10**9}


class Network:
    """Tokens, keys and attachments of one node."""

    def __init__(self, session: Any, domain: int, codec: Codec, node: str, namespace: str = "/r1") -> None:
        self.session = session
        self.codec = codec
        self._domain = domain
        self._namespace = namespace
        self._numbers = itertools.count(1)
        self._end = f"%/{namespace.replace('/', '%')}/{node}"
        self._held: list[Any] = []
        self._token(f"{session.zid()}/0/0/NN/{self._end}")

    def _token(self, tail: str) -> None:
        self._held.append(self.session.liveliness().declare_token(f"@ros2_lv/{self._domain}/{tail}"))

    def _announce(self, letters: str, name: str, kind: str, hash_: str, qos: str) -> str:
        """Declare the token of an entity; its key."""
        package, group, bare = kind.split("/")
        dds = f"{package}::{group}::dds_::{bare}_"
        what = f"{name.replace('/', '%')}/{dds}/{hash_}/{qos}"
        self._token(f"{self.session.zid()}/0/{next(self._numbers)}/{letters}/{self._end}/{what}")
        return f"{self._domain}{name}/{dds}/{hash_}"

    def _name(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._namespace}/{name}"

    def publisher(self, name: str, kind: str, *, kept: bool = False) -> Callable[[Mapping[str, Any]], None]:
        qos = ":1:,1:,:,:,," if kept else "::,10:,:,:,,"
        key = self._announce("MP", self._name(name), kind, self.codec.hash(kind), qos)
        if kept:
            made = zenoh.ext.declare_advanced_publisher(
                self.session, key, cache=zenoh.ext.CacheConfig(1), publisher_detection=True,
                sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=1.0),
            )  # fmt: skip
        else:
            made = self.session.declare_publisher(key)
        self._held.append(made)

        numbers = itertools.count(1)

        def publish(fields: Mapping[str, Any]) -> None:
            attachment = struct.pack("<qqB16s", next(numbers), time.time_ns(), 16, b"nav2")
            made.put(self.codec.encode(kind, fields), attachment=attachment)

        return publish

    def listen(self, name: str, kind: str, take: Callable[[Any], None]) -> None:
        key = self._announce("MS", self._name(name), kind, self.codec.hash(kind), "::,10:,:,:,,")
        heard = lambda sample: take(self.codec.decode(kind, bytes(sample.payload)))  # noqa: E731
        self._held.append(self.session.declare_subscriber(key, heard))

    def serve(self, name: str, kind: str, take: Callable[[Any, Answer], None], hash_: str = "") -> None:
        """`take` gets the request, and a function that answers it, now or later."""
        key = self._announce("SS", self._name(name), kind, hash_ or self.codec.hash(kind), "::,10:,:,:,,")

        def asked(query: Any) -> None:
            number, _, length, gid = struct.unpack("<qqB16s", bytes(query.attachment))
            assert number > 0 and length == 16 and gid != NOTHING

            def answer(fields: Mapping[str, Any]) -> None:
                attachment = struct.pack("<qqB16s", number, time.time_ns(), length, gid)
                query.reply(key, self.codec.encode(f"{kind}_Response", fields), attachment=attachment)
                query.drop()

            take(self.codec.decode(f"{kind}_Request", bytes(query.payload)), answer)

        self._held.append(self.session.declare_queryable(key, asked, complete=True))

    def close(self) -> None:
        """Undeclare everything: the server has ended."""
        while self._held:
            self._held.pop().undeclare()


class Goal:
    """One goal: where it ends, and what is known of it."""

    def __init__(self, goal_id: bytes, end: tuple[float, float], heading: float, kind: str) -> None:
        self.id, self.end, self.heading, self.kind = goal_id, end, heading, kind
        self.status = EXECUTING
        self.error = ""
        self.waiting: list[Callable[[Mapping[str, Any]], None]] = []


class StandIn:
    """The robot, its servers and its scanner; one thread moves it."""

    def __init__(self, session: Any, domain: int, codec: Codec, scans: Path, speed: float) -> None:
        self._session, self._domain, self._codec = session, domain, codec
        self._scans = scans
        self.speed_limit = speed
        self.x = self.y = self.heading = 0.0
        self.speed = self.turn = 0.0
        self.path: list[tuple[float, float]] = []
        self.goals: list[Goal] = []
        self.rejects = self.answers_no_goal = False
        self.wrong_hash = ""
        self.zeros = 0
        self._commanded_s = 0.0
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self.network = Network(session, domain, codec, "base")
        self._odometry = self.network.publisher("odom", "nav_msgs/msg/Odometry")
        self._tf = self.network.publisher("/tf", "tf2_msgs/msg/TFMessage")
        self._battery = self.network.publisher("battery_state", "sensor_msgs/msg/BatteryState")
        self.network.listen("cmd_vel", "geometry_msgs/msg/Twist", self._command)
        self._fixed = self.network.publisher("/tf_static", "tf2_msgs/msg/TFMessage", kept=True)
        self.network.serve("scan", "std_srvs/srv/Trigger", self._scan)
        self._fixed({"transforms": [self._transform("map", "odom", 0.0, 0.0, 0.0)]})
        self._servers: Network | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self, *, wrong_hash: str = "") -> None:
        """Start Nav2's servers, without the goals that they had."""
        with self._lock:
            self.goals = []
            self._servers = made = Network(self._session, self._domain, self._codec, "controller_server")
            for name, kind in (("follow_path", "FollowPath"), ("spin", "Spin")):
                of, below = f"nav2_msgs/action/{kind}", f"{name}/_action"
                made.serve(f"{below}/send_goal", f"{of}_SendGoal", self._taking(kind), wrong_hash)
                made.serve(f"{below}/get_result", f"{of}_GetResult", self._result)
                made.serve(f"{below}/cancel_goal", "action_msgs/srv/CancelGoal", self._cancelling(kind))
                setattr(self, f"_status_{kind}", made.publisher(
                    f"{below}/status", "action_msgs/msg/GoalStatusArray", kept=True
                ))  # fmt: skip
        if not self._thread.is_alive():
            self._thread.start()

    def end_servers(self) -> None:
        """The servers are gone, and nobody commands the robot any more."""
        with self._lock:
            made, self._servers = self._servers, None
            if made is not None:
                made.close()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    # Nav2

    def _taking(self, kind: str) -> Callable[[Any, Any], None]:
        def take(request: Any, answer: Any) -> None:
            with self._lock:
                if not self.rejects:
                    self._begin(request, kind)
                if not self.answers_no_goal:
                    answer({"accepted": not self.rejects, "stamp": stamp()})
            self._publish_status()

        return take

    def _begin(self, request: Any, kind: str) -> None:
        self._preempt("preempted")
        goal_id = bytes(request.goal_id.uuid)
        if kind == "Spin":
            end, heading = (self.x, self.y), self.heading + float(request.goal.target_yaw)
        else:
            last = request.goal.path.poses[-1].pose
            end = (float(last.position.x), float(last.position.y))
            heading = 2 * math.atan2(last.orientation.z, last.orientation.w)
        self.goals.append(Goal(goal_id, end, heading, kind))

    def foreign_goal(self, x: float, y: float) -> None:
        """Another client sends the robot somewhere."""
        with self._lock:
            self._preempt("preempted")
            self.goals.append(Goal(b"somebody else's.", (x, y), 0.0, "FollowPath"))
        self._publish_status()

    def _preempt(self, why: str) -> None:
        for goal in self.goals:
            if goal.status in LIVE:
                goal.error = why
                self._finish(goal, ABORTED)

    def _finish(self, goal: Goal, status: int) -> None:
        goal.status = status
        for answer in goal.waiting:
            answer(self._result_of(goal))
        goal.waiting.clear()

    def _result_of(self, goal: Goal) -> dict[str, Any]:
        code = {"error_code": 0, "error_msg": goal.error}
        return {"status": goal.status, "result": code}

    def _result(self, request: Any, answer: Any) -> None:
        with self._lock:
            goal = next((one for one in self.goals if one.id == bytes(request.goal_id.uuid)), None)
            if goal is None:
                answer({"status": 0})
            elif goal.status in LIVE:
                goal.waiting.append(answer)
            else:
                answer(self._result_of(goal))

    def _cancelling(self, kind: str) -> Callable[[Any, Any], None]:
        def cancel(request: Any, answer: Any) -> None:
            wanted = bytes(request.goal_info.goal_id.uuid)
            with self._lock:
                found = [
                    goal for goal in self.goals
                    if goal.kind == kind and goal.status in LIVE and wanted in (NOTHING, goal.id)
                ]  # fmt: skip
                for goal in found:
                    goal.status = CANCELING
                infos = [{"goal_id": {"uuid": list(goal.id)}} for goal in found]
                answer({"return_code": 0, "goals_canceling": infos})
            self._publish_status()

        return cancel

    def _publish_status(self) -> None:
        with self._lock:
            if self._servers is None:
                return
            for kind in ("FollowPath", "Spin"):
                listed = [
                    {"goal_info": {"goal_id": {"uuid": list(goal.id)}}, "status": goal.status}
                    for goal in self.goals if goal.kind == kind
                ]  # fmt: skip
                getattr(self, f"_status_{kind}")({"status_list": listed})

    # The base

    def _run(self) -> None:
        while not self._closing.wait(1.0 / HZ):
            with self._lock:
                changed = self._drive()
                self._move()
            if changed:
                self._publish_status()
            self._tell()

    def _drive(self) -> bool:
        """Command the next velocity of the goal; true if its status changed."""
        goal = next((one for one in self.goals if one.status in LIVE), None)
        if goal is None or self._servers is None:
            return False
        if goal.status == CANCELING:
            self._set(0.0, 0.0)
            self._finish(goal, CANCELED)
            return True
        left = math.dist((self.x, self.y), goal.end)
        if left > TOLERANCE_M:
            away = math.atan2(goal.end[1] - self.y, goal.end[0] - self.x)
            off = math.remainder(away - self.heading, math.tau)
            self._set(min(self.speed_limit, 4 * left) if abs(off) < 0.1 else 0.0, 4 * off)
            return False
        off = math.remainder(goal.heading - self.heading, math.tau)
        if abs(off) > TOLERANCE_RAD:
            self._set(0.0, 4 * off)
            return False
        self._set(0.0, 0.0)
        self._finish(goal, SUCCEEDED)
        return True

    def _command(self, twist: Any) -> None:
        """A velocity from the network; a goal that drives on commands its own the next time."""
        with self._lock:
            self.zeros += not (twist.linear.x or twist.angular.z)
            self._set(float(twist.linear.x), float(twist.angular.z))

    def _set(self, speed: float, turn: float) -> None:
        self.speed, self.turn = speed, max(-TURN_RATE, min(TURN_RATE, turn))
        self._commanded_s = time.monotonic()

    def _move(self) -> None:
        if time.monotonic() - self._commanded_s > VELOCITY_TIMEOUT_S:
            self.speed = self.turn = 0.0
        self.heading = math.remainder(self.heading + self.turn / HZ, math.tau)
        self.x += self.speed * math.cos(self.heading) / HZ
        self.y += self.speed * math.sin(self.heading) / HZ
        self.path.append((self.x, self.y))

    def _tell(self) -> None:
        header = {"stamp": stamp(), "frame_id": "odom"}
        twist = {"linear": {"x": self.speed}, "angular": {"z": self.turn}}
        self._odometry({"header": header, "twist": {"twist": twist}})
        moving = self._transform("odom", "base_link", self.x, self.y, self.heading)
        self._tf({"transforms": [moving]})
        self._battery({"percentage": 0.75})

    def _transform(self, parent: str, child: str, x: float, y: float, heading: float) -> dict[str, Any]:
        turn = {"z": math.sin(heading / 2), "w": math.cos(heading / 2)}
        return {
            "header": {"stamp": stamp(), "frame_id": parent}, "child_frame_id": child,
            "transform": {"translation": {"x": x, "y": y}, "rotation": turn},
        }  # fmt: skip

    def _scan(self, request: Any, answer: Any) -> None:
        before = (self.x, self.y, self.heading)
        time.sleep(SCAN_S)
        moved = before != (self.x, self.y, self.heading)
        file = self._scans / f"{len(list(self._scans.glob('*.xyz'))) + 1}.xyz"
        data = f"{before[0]} {before[1]} 0 {moved}\n".encode()
        file.write_bytes(data)
        said = {
            "file": file.name, "size": len(data), "points": 1, "sha256": hashlib.sha256(data).hexdigest(),
        }  # fmt: skip
        answer({"success": True, "message": json.dumps(said)})


@contextmanager
def session_at(mode: str, endpoint: str) -> Iterator[Any]:
    """A session that listens as a router, or connects as a client."""
    config = zenoh.Config()
    where = "listen/endpoints" if mode == "router" else "connect/endpoints"
    for key, value in {
        "mode": mode, where: [endpoint], "scouting/multicast/enabled": False, "adminspace/enabled": False,
        "transport/shared_memory/enabled": False,
    }.items():  # fmt: skip
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


if __name__ == "__main__":
    from tests.ros2.real_codec import RealCodec

    with session_at("client", sys.argv[1]) as opened:
        robot = StandIn(opened, int(sys.argv[2]), RealCodec(), Path(sys.argv[3]), float(sys.argv[4]))
        robot.start()
        print("ready", flush=True)
        threading.Event().wait()
