"""The simulated vehicle drives as a real one did, and by its parameters."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.run.events import Pose
from tests.bridge.mavlink.simulated.bench import Bench, delay, waypoint

LOG = Path(__file__).parents[4].parent / "shared" / "data" / "logs" / "rover-stop-and-go.BIN"
CORNERS = [(3.0, 0.0), (3.0, 3.0), (6.0, 3.0), (6.0, 0.0), (9.0, 0.0)]
"""East and north of the origin: the stops of the log."""
MEASURED_MM = [202, 218, 218, 201, 217]
"""True position errors of the Rover of the log while it waited at each of them."""
MEASURED_S = 12.5
"""From one stop to the next."""
START = Pose(x=-0.083, y=0.0, heading=0.0)


def driven(bench: Bench) -> list[tuple[float, Pose]]:
    """The log's mission in AUTO: when, and where it truly stood, at the end of each wait."""
    items = [item for x, y in CORNERS for item in (waypoint(y, x), delay(3.0))]
    assert bench.upload(items) == 0
    bench.vehicle.arm()
    bench.vehicle.set_mode("auto")
    stood: list[tuple[float, Pose]] = []
    for tick in range(1200):
        bench.pass_time(0.1, step_s=0.1)
        reached = len(bench.said("MISSION_ITEM_REACHED"))
        if reached > 2 * len(stood) + 1:
            stood.append((tick / 10, truth(bench)))
    assert len(stood) == len(CORNERS)
    return stood


def truth(bench: Bench) -> Pose:
    return bench.vehicle.rover.at(bench.clock.now_ns())[0]


def beside_mm(stood: list[tuple[float, Pose]]) -> list[float]:
    pairs = zip(stood, CORNERS, strict=True)
    return [1000 * math.dist((pose.x, pose.y), corner) for (_, pose), corner in pairs]


def test_its_stops_in_auto_have_errors_as_those_of_the_log() -> None:
    stood = driven(Bench("ardupilot", at=START, seed=1))
    assert beside_mm(stood) == pytest.approx(MEASURED_MM, abs=50)
    legs = [after - before for (before, _), (after, _) in pairwise(stood)]
    assert legs == pytest.approx([MEASURED_S] * 4, abs=1.0)


def test_what_was_measured_is_in_the_log() -> None:
    if not LOG.exists():
        pytest.skip(f"{LOG} is not here")
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(str(LOG))
    here, found = (0.0, 0.0), []
    while (message := log.recv_match(type=["SIM", "MISE"])) is not None:
        if message.get_type() == "SIM":
            east = (message.Lng - 8.5456) * 1e7 * 0.011131884502145034 * math.cos(math.radians(47.3977))
            here = (east, (message.Lat - 47.3977) * 1e7 * 0.011131884502145034)
        elif message.CId == 16 and message.CNum > 1:
            found.append(here)
    found.append(here)
    beside = [1000 * math.dist(place, corner) for place, corner in zip(found, CORNERS, strict=True)]
    assert beside == pytest.approx(MEASURED_MM, abs=12)  # the log has steps of 11 mm


def test_px4_stops_within_its_acceptance_radius() -> None:
    beside = beside_mm(driven(Bench("px4", at=START, seed=1)))
    assert all(50 < mm < 500 for mm in beside)


def test_slower_is_nearer() -> None:
    slow = Bench("ardupilot", at=START, seed=1)
    slow.say(dialect.MAVLink_param_set_message(1, 1, b"WP_SPEED", 0.3, 9))
    assert max(beside_mm(driven(slow))) < 0.7 * min(MEASURED_MM)


def test_without_pivot_turns_it_leaves_the_path() -> None:
    """As a Rover that may not turn on the spot does: it drives a bow to the next place."""
    bench = Bench("ardupilot", at=START, seed=1, WP_PIVOT_ANGLE=0.0)
    driven_to_north = beside_mm(driven(bench))
    assert max(driven_to_north) > 300


@pytest.mark.parametrize(
    ("profile", "changed"), [("ardupilot", {"SERVO1_FUNCTION": 26.0}), ("px4", {"CA_AIRFRAME": 5.0})]
)
def test_one_that_steers_like_a_car_turns_only_as_it_drives(profile: str, changed: dict[str, float]) -> None:
    bench = Bench(profile, at=Pose(x=0.0, y=0.0, heading=0.0), seed=1, **changed)
    chassis = bench.vehicle.rover.motion.chassis
    for _ in range(100):
        chassis.move(0.0, 1.0, 0.02)
    assert chassis.heading == 0.0
    for _ in range(500):
        chassis.move(0.2, 1.0, 0.02)
    assert abs(chassis.turning) == pytest.approx(abs(chassis.speed) / 0.9)
    assert len(driven(Bench(profile, at=START, seed=1, **changed))) == len(CORNERS)


def test_the_same_seed_drives_the_same_way() -> None:
    first, again, other = (driven(Bench("ardupilot", at=START, seed=seed)) for seed in (1, 1, 2))
    assert first == again != other


def guided(bench: Bench, vx: float, vy: float, yaw: float) -> None:
    message = dialect.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0x09C7, 0.0, 0.0, 0.0, vx, vy, 0.0, 0.0, 0.0, 0.0, yaw, 0.0
    )
    bench.say(message)


def test_ardupilot_drives_along_the_yaw_backwards_if_the_first_number_is_negative() -> None:
    bench = Bench("ardupilot", at=Pose(x=0.0, y=0.0, heading=0.0), seed=1)
    bench.vehicle.arm()
    bench.vehicle.set_mode("guided")
    guided(bench, -0.3, 0.0, math.pi / 2)
    bench.pass_time(2.0, step_s=0.1)
    assert truth(bench).x < -0.3
    bench.pass_time(4.0, step_s=0.1)
    stands = truth(bench).x
    bench.pass_time(2.0, step_s=0.1)
    assert truth(bench).x == pytest.approx(stands, abs=0.01)
    assert "target not received" in bench.last("STATUSTEXT").text


def test_px4_turns_on_the_spot_and_drives_where_the_velocity_points() -> None:
    bench = Bench("px4", at=Pose(x=0.0, y=0.0, heading=0.0), seed=1)
    bench.vehicle.arm()
    guided(bench, 0.3, 0.0, 0.0)
    bench.vehicle.set_mode("guided")
    for _ in range(60):
        guided(bench, 0.3, 0.0, 0.0)
        bench.pass_time(0.1, step_s=0.1)
    assert abs(truth(bench).x) < 0.05
    assert truth(bench).y > 0.3


def test_its_estimate_wanders_by_millimetres_and_jumps_on_request() -> None:
    bench = Bench("ardupilot", at=START, seed=1, faults=("jump@10=0.4",))
    off = []
    for _ in range(200):
        bench.pass_time(0.1, step_s=0.1)
        told, true = bench.vehicle.motion().pose, truth(bench)
        off.append(math.hypot(told.x - true.x, told.y - true.y))
    assert 0.001 < max(off[:90]) < 0.03
    assert min(off[110:]) > 0.37


@pytest.mark.parametrize("fault", ["gap@5=3", "restart@5=2"])
def test_a_gap_and_a_restart_are_silence(fault: str) -> None:
    bench = Bench("ardupilot", at=START, seed=1, faults=(fault,))
    bench.vehicle.arm()
    bench.pass_time(4.9, step_s=0.1)
    before = len(bench.all)
    bench.pass_time(0.2, step_s=0.1)
    bench.all.clear()
    bench.pass_time(2.5, step_s=0.1)
    assert (before > 0, bench.all) == (True, [])
    bench.pass_time(2.0, step_s=0.1)
    assert bench.said("HEARTBEAT")
    assert bench.vehicle.armed == fault.startswith("gap")


def test_all_its_parameters_are_reported_and_kept() -> None:
    bench = Bench("ardupilot", at=START, seed=1)
    bench.say(dialect.MAVLink_param_request_list_message(1, 1))
    told = {message.param_id: message.param_value for message in bench.said("PARAM_VALUE")}
    assert {"WP_RADIUS", "WP_SPEED", "WP_PIVOT_ANGLE", "ATC_STR_ANG_P", "SIM_LAG"} <= set(told)
    bench.say(dialect.MAVLink_param_set_message(1, 1, b"ATC_STR_ANG_P", 2.5, 9))
    bench.say(dialect.MAVLink_param_set_message(1, 1, b"ATC_STR_ANG_P", math.nan, 9))
    assert bench.last("PARAM_VALUE").param_value == 2.5
    assert bench.vehicle.report(MessageId.HEARTBEAT)
