"""Peers of a third-party library (pyzeros) for a robot's end over zenoh: a scanner, and a client of its run.

`zenoh_peers.py ENDPOINT DOMAIN`: serves /r1/peer_scan; prints the state that /r1/stopgo/state has, and what
/r1/stopgo/resume answers, once each, as JSON.
"""

import asyncio
import hashlib
import json
import sys
from typing import Any

import asyncio_for_robotics as afor
import pyzeros
import zenoh
from ros2_pyterfaces.cyclone import all_msgs as msgs
from ros2_pyterfaces.cyclone import all_srvs as srvs


def scanned(number: int) -> Any:
    data = f"scan {number}".encode()
    told = {
        "file": f"{number}.e57", "size": len(data), "points": 1, "sha256": hashlib.sha256(data).hexdigest(),
    }  # fmt: skip
    return srvs.Trigger.Response(success=True, message=json.dumps(told))


async def serve() -> None:
    """Serve the scanner until the process is ended."""
    server, number = pyzeros.Server(srvs.Trigger, "/r1/peer_scan"), 0
    async for responder in server.listen_reliable():
        number += 1
        responder.response = scanned(number)
        responder.send()


async def look() -> None:
    state = await pyzeros.Sub(msgs.String, "/r1/stopgo/state").wait_for_value()
    client = pyzeros.Client(srvs.Trigger, "/r1/stopgo/resume")
    await client.wait_for_service()
    answer = await client.call_async(srvs.Trigger.Request())
    print(json.dumps({"state": json.loads(state.data)["state"], "resume": answer.message}), flush=True)


@afor.scoped
async def main() -> None:
    """Serve the scanner, and look once."""
    print("ready", flush=True)
    await asyncio.gather(serve(), look())


if __name__ == "__main__":
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with (
        zenoh.open(config) as session,
        pyzeros.auto_context("peer", zenoh_session=session, namespace="/r1", domain_id=int(sys.argv[2])),
    ):
        asyncio.run(main())
