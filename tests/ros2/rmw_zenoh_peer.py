"""A robot that speaks rmw_zenoh by a third-party library (pyzeros): odometry, tf, battery, state.

`rmw_zenoh_peer.py ENDPOINT DOMAIN [wrong]`: connects to a zenoh router there.
"""

import asyncio
import json
import sys
import time
from dataclasses import dataclass, field
from typing import Any

import asyncio_for_robotics as afor
import pyzeros
import zenoh
from pyzeros.qos import DurabilityPolicy, QosProfile, ReliabilityPolicy
from ros2_pyterfaces.cyclone import all_msgs as msgs
from ros2_pyterfaces.cyclone.idl import IdlStruct, types


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs/msg/TFMessage"):
    transforms: types.sequence[msgs.TransformStamped] = field(default_factory=list)


@dataclass
class OtherOdometry(IdlStruct, typename="nav_msgs/msg/Odometry"):
    """The type of another version, with fewer fields."""

    header: msgs.Header = field(default_factory=msgs.Header)
    child_frame_id: str = ""


def _stamp() -> Any:
    ns = time.time_ns()
    return msgs.Time(sec=ns // 10**9, nanosec=ns % 10**9)


def _transform(parent: str, child: str, x: float, y: float) -> Any:
    made = msgs.TransformStamped(child_frame_id=child)
    made.header.frame_id, made.header.stamp = parent, _stamp()
    made.transform.translation.x, made.transform.translation.y = x, y
    made.transform.rotation.w = 1.0
    return made


@afor.scoped
async def main(wrong: bool) -> None:
    """Publish ten times a second until the process is ended."""
    odometry = pyzeros.Pub(OtherOdometry if wrong else msgs.Odometry, "odom")
    tf = pyzeros.Pub(TFMessage, "/tf")
    battery = pyzeros.Pub(msgs.BatteryState, "battery_state")
    state = pyzeros.Pub(msgs.String, "stopgo/state")
    poor = QosProfile(reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
    pyzeros.Pub(msgs.String, "chatter", qos_profile=poor)
    pyzeros.Sub(msgs.String, "chatter")
    is_first = True
    async for _ in afor.Rate(10).listen():
        if wrong:
            odometry.publish(OtherOdometry())
        else:
            told = msgs.Odometry()
            told.header.stamp = _stamp()
            told.twist.twist.linear.x = 0.25
            odometry.publish(told)
        tf.publish(
            TFMessage([_transform("map", "odom", 1.0, 0.0), _transform("odom", "base_link", 0.5, 2.0)])
        )
        battery.publish(msgs.BatteryState(percentage=0.75))
        text = {"state": "RUNNING", "run_id": "a1", "stop": "s2", "stop_state": "SCANNING", "done_count": 1}
        state.publish(msgs.String(data=json.dumps(text)))
        if is_first:  # the library compiles its codecs at the first use
            print("ready", flush=True)
            is_first = False


if __name__ == "__main__":
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with (
        zenoh.open(config) as session,
        pyzeros.auto_context("base", zenoh_session=session, namespace="/r1", domain_id=int(sys.argv[2])),
    ):
        asyncio.run(main(wrong=len(sys.argv) > 3))
