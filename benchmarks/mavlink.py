"""Measures missions sent to autopilots over lossy links: success rate, time, and MAVSDK's client.

Run: python -m benchmarks.mavlink [--seeds 10] [--peer-seeds 2]; the vehicle is the simulated one, the line
20 ms long each way, and every run has a seed, a line and an empty vehicle of its own.
"""

from __future__ import annotations

import argparse
import contextlib
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from benchmarks.table import put, table, versions
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.bridge.mavlink.transfer.upload import upload
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, reached
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.console.ports import free_port
from stopgo.mission.errors import StopgoError
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.read_back import differences, upload_of
from tests.bridge.mavlink.lists import stops
from tests.bridge.mavlink.lossy import Lossy, Roughness

DELAY_S = 0.02
RATES = (0.0, 0.05, 0.1, 0.2, 0.3)
LONG_RATES = (0.0, 0.1, 0.3)
KINDS = {"ardupilot": "ardupilot", "px4": "px4", "strict": "generic"}
"""Autopilot of each profile of the simulated vehicle."""
HEAD = ("vehicle", "items", "loss each way", "succeeded", "median s", "least s", "most s")


@dataclass(frozen=True)
class Outcome:
    """One run: True if the vehicle then had every item, and the seconds it took."""

    right: bool
    seconds: float


Row = list[Any]
"""A row of the tables, as in `HEAD`."""
Run = Callable[[str, ItemList, float, int], Outcome]
"""Of a profile, with a list, at a rate of loss and from a seed."""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", type=int, default=10)
    options.add_argument("--peer-seeds", type=int, default=3, help="MAVSDK's runs, and those of long lists")
    given = options.parse_args()
    seeds, few = range(given.seeds), range(given.peer_seeds)
    ours = [row for profile in KINDS for row in rows(profile, sent, 50, RATES, seeds)]
    long = rows("ardupilot", sent, 325, LONG_RATES, few)
    read = rows("ardupilot", fetched, 50, RATES, seeds) + rows("ardupilot", fetched, 325, LONG_RATES, few)
    theirs = rows("strict", sent_by_mavsdk, 50, RATES, few)
    print(written(ours + long, read, theirs))


def written(ours: list[Row], read: list[Row], theirs: list[Row]) -> str:
    """The section of the README, which is also put there."""
    beside = [(*row, share_of(row, ours)) for row in theirs]
    text = "\n\n".join((
        "Lists of waypoint and delay over UDP, 20 ms each way, the simulated vehicle in the same process; each "
        "run has a seed and an empty vehicle of its own. A run has succeeded if the vehicle, asked over a clean "
        "line, then holds every item as its kind keeps it; seconds are of the runs that did. "
        + versions("mavsdk", "pymavlink"),
        "`push` reads what the vehicle held, sends, reads back and compares:",
        table(HEAD, ours),
        "PX4 gives its items only one after another, so a read-back takes a round trip for each (4 s here).",
        "`fetch-mission` reads:",
        table(HEAD, read),
        "MAVSDK's own client (`mission_raw`) on the same lines in the same run; it sends, and does not read back. "
        "The last column is our median for the same vehicle and loss, read-back included, over its median:",
        table((*HEAD, "ours ÷ theirs"), beside),
    ))  # fmt: skip
    put("mavlink", text)
    return text


def share_of(row: Row, ours: list[Row]) -> object:
    """Our median over theirs, for the same vehicle, items and loss."""
    same = next(one for one in ours if one[:3] == row[:3])
    both = isinstance(same[4], float) and isinstance(row[4], float)
    return f"{same[4] / row[4]:.2f}" if both else "-"


def rows(profile: str, run: Run, stop_count: int, rates: Sequence[float], seeds: Sequence[int]) -> list[Row]:
    """One row of the table for each rate of loss."""
    made = []
    for rate in rates:
        listed = stops(stop_count, KINDS[profile])
        outcomes = [run(profile, listed, rate, seed) for seed in seeds]
        row = [profile, len(upload_of(listed)), f"{rate:.0%}", *told(outcomes)]
        print(*row, flush=True)
        made.append(row)
    return made


def told(outcomes: Sequence[Outcome]) -> Row:
    right = [outcome.seconds for outcome in outcomes if outcome.right]
    share = f"{len(right)} of {len(outcomes)}"
    if not right:
        return [share, "-", "-", "-"]
    return [share, statistics.median(right), min(right), max(right)]


@contextmanager
def line(profile: str, rate: float, seed: int) -> Iterator[tuple[Url, Url]]:
    """An empty vehicle behind a lossy link, and the same vehicle without the link."""
    port = free_port()
    with (
        vehicle_on(Url("udpin", "127.0.0.1", port), VehicleSetup(PROFILES[profile])),
        Lossy(port, Roughness(delay_s=DELAY_S, loss=rate), seed=seed) as rough,
    ):
        yield rough.url, Url("udpout", "127.0.0.1", port)


def sent(profile: str, listed: ItemList, rate: float, seed: int) -> Outcome:
    """By our uploader."""
    with line(profile, rate, seed) as (rough, clean):
        with reached(rough, vehicle=1, timeout_s=5.0) as peer:
            seconds = timed(lambda: upload(peer, listed))
        return Outcome(holds(clean, listed), seconds)


def fetched(profile: str, listed: ItemList, rate: float, seed: int) -> Outcome:
    """By our reader, from a vehicle that received the list over a lossless link."""
    with line(profile, rate, seed) as (rough, clean):
        with reached(clean, vehicle=1) as peer:
            upload(peer, listed)
        read: list[Any] = []
        with reached(rough, vehicle=1) as peer:
            seconds = timed(lambda: read.extend(download(peer)))
        return Outcome(not differences(listed, read), seconds)


def sent_by_mavsdk(profile: str, listed: ItemList, rate: float, seed: int) -> Outcome:
    """By MAVSDK's client, which gives up by itself."""
    import mavsdk
    from mavsdk.plugins.mission_raw.mission_raw import MissionRaw

    mavsdk.log_subscribe(lambda *_: True)
    kind = mavsdk.ComponentType.GROUND_STATION
    with line(profile, rate, seed) as (rough, clean):
        sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
        try:
            sdk.add_any_connection(f"udpout://{rough.host}:{rough.number}")
            system = sdk.first_autopilot(20.0)
            assert system is not None, "MAVSDK sees no autopilot"
            client = MissionRaw(system)
            seconds = timed(lambda: attempt(client, listed))
        finally:
            sdk.destroy()
        return Outcome(holds(clean, listed), seconds)


def attempt(client: Any, listed: ItemList) -> None:
    import mavsdk
    from mavsdk.plugins.mission_raw.mission_raw import MissionItem

    items = [
        MissionItem(
            number, item.frame, item.command, int(number == 0), 1, *item.params, item.x, item.y, item.z, 0
        )
        for number, item in enumerate(upload_of(listed))
    ]
    with contextlib.suppress(mavsdk.MavsdkError):
        client.upload_mission(items)


def timed(action: Callable[[], object]) -> float:
    """Seconds of an action, successful or not."""
    began = time.monotonic()
    with contextlib.suppress(StopgoError):
        action()
    return time.monotonic() - began


def holds(clean: Url, listed: ItemList) -> bool:
    with reached(clean, vehicle=1) as peer:
        return not differences(listed, read_now(peer))


def read_now(peer: Peer) -> Sequence[Any]:
    try:
        return download(peer)
    except StopgoError:
        return ()


if __name__ == "__main__":
    main()
