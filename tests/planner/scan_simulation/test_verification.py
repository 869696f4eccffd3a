"""Verification by simulation: counts on small floors, false claims, and registration."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as changed

from stopgo.mission.document import MissionAllocation
from stopgo.mission.errors import NegativeResult
from stopgo.mission.files.coverage_json import Coverage, coverage_json
from stopgo.mission.floor import FloorPlan
from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.proof.plan_proof import PlanProof, Simulation
from stopgo.mission.proof.proof_text import network_words
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace
from stopgo.mission.stages.network import network_of
from stopgo.planner import plan
from stopgo.planner.floors import read_floor
from stopgo.planner.scan_simulation import registration
from stopgo.planner.scan_simulation.casting import RayFan, SolidScene
from stopgo.planner.scan_simulation.extrusion import NONE, extruded
from stopgo.planner.scan_simulation.model_scans import ModelScene, scanned_model
from stopgo.planner.scan_simulation.registration import (
    _CloudPair,
    _shift,
    _starts,
    off,
    registered,
    surface_of,
)
from stopgo.planner.scan_simulation.scanning import ScannerPose, scanned, scene_at
from stopgo.planner.scan_simulation.strips import strips_of
from stopgo.planner.scan_simulation.verification import verify
from stopgo.planner.space.navigable import navigable
from tests.faults.sizes import size, some
from tests.planner.worlds import (
    SHARED,
    box,
    column,
    door,
    element,
    floor_of,
    hall,
    room,
    shell,
    two_rooms,
    wall,
)

COARSE = Simulation(range_m=10.0, step_deg=0.2)
COARSEST = Simulation(range_m=10.0, step_deg=0.5)


def verified(floor: FloorPlan, settings: Settings, simulation: Simulation = COARSE) -> PlanProof:
    """The verification of a floor's own plan."""
    import msgspec

    made = plan(floor, settings)
    told = msgspec.json.decode(coverage_json(made.route, made.mission, made.figures), type=Coverage)
    return verify(made.mission, made.space, replace(simulation, range_m=settings.range), told)


def test_rays_meet_what_they_must_where_it_is() -> None:
    solids = extruded(hall(6, 4), [], 2.5)
    place = np.array([3.0, 2.0, 1.0]) - [*solids.origin, 0.0]
    scene = SolidScene(solids, place, see_through=False, open_door=NONE)
    corners = np.array([(3, 0, 0.2), (-3, 0, 0.2), (0, 2, -0.2), (0, -2, 0.2), (0, 0.5, 1.5), (0.5, 0, -1)])
    inward = corners * (1 - 1e-3)
    assert scene.unobstructed(inward).all()
    assert not scene.unobstructed(corners * 1.05).any(), "nothing beyond walls, floor and ceiling"


def test_points_on_a_wall_are_as_many_as_its_angle_has_rays() -> None:
    """A wall 6 m long, 2 m before the scanner: 2 atan(3 / 2) of the turn falls on it."""
    space = space_of(hall(6, 4))
    simulation = replace(COARSE, step_deg=0.25)
    solids = extruded(space.floor, [], simulation.ceiling_m)
    strips = strips_of(solids, space.targets, space.floor, simulation.ceiling_m)
    place = np.array([3.0, 2.0, 1.3]) - [*solids.origin, 0.0]
    pose = ScannerPose(place, 0.0)
    found = scanned(scene_at(solids, pose), strips, pose, simulation)
    cell = strips.middle[found.cell]
    level = np.abs(cell[:, 2] - 1.25) < 0.06
    south = level & (np.abs(cell[:, 1] - place[1] + 2.0) < 1e-6)
    azimuths = math.degrees(2 * math.atan(3 / 2)) / simulation.step_deg
    widest = math.degrees(2 * math.atan(0.1 / 2)) / simulation.step_deg
    assert azimuths * 1 < found.points[south].sum() < azimuths * (widest + 1)
    assert found.incidence[south].max() == pytest.approx(math.atan(3 / 2), abs=0.02)
    flat = np.hypot(found.cloud[:, 0], found.cloud[:, 1])
    assert flat.max() <= math.hypot(3, 2) + 0.02, "nothing is met beyond the corners"


def test_every_target_of_a_hall_is_acquired_from_its_middle() -> None:
    proof = verified(hall(3, 2), Settings(range=10.0))
    assert proof.met
    assert proof.whole.acquired == pytest.approx(10.0)
    assert proof.quality.seen_m2 == pytest.approx(10.0 * 2.7)
    assert proof.quality.by_stops[1] == 1.0


@pytest.mark.usefixtures("no_pairs")
def test_what_stops_claim_is_in_sight_one_by_one() -> None:
    """By another program's rays: the plan's own sight has no part in it."""
    floor = two_rooms(0.9, more=[column("c1", 2.2, 1.0), column("c2", 6.1, 2.9)])
    proof = verified(floor, Settings(range=4.0), COARSEST)
    for stop in proof.stops:
        assert abs(stop.sighted - stop.claimed) <= 1, "at most one sight line that touches a corner"


@pytest.mark.usefixtures("no_pairs")
def test_a_stop_that_was_moved_is_caught() -> None:
    made = plan(two_rooms(0.9), Settings(range=3.0, register=False))
    first, *others = made.mission.stops
    lying = changed(made.mission, stops=(changed(first, x=0.8, y=0.8), *others))
    proof = verify(lying, made.space, replace(COARSEST, range_m=3.0), None)
    assert not proof.met
    assert any(first.id in line for line in proof.unmet)


@pytest.mark.usefixtures("no_pairs")
def test_a_stop_that_was_removed_is_caught() -> None:
    floor = two_rooms(0.9)
    made = plan(floor, Settings(range=4.0, register=False))
    told = coverage_of(made)
    lying = changed(made.mission, stops=made.mission.stops[:-1])
    proof = verify(lying, made.space, replace(COARSEST, range_m=4.0), told)
    assert not proof.met
    assert "coverage" in proof.unmet[0]
    assert sum(proof.missed.values()) > 1.0


def test_of_one_mission_of_several_no_share_is_asked_that_is_asked_of_all() -> None:
    made = plan(hall(3, 2), Settings(range=10.0))
    share = changed(made.mission, share=MissionAllocation(kind="robot", number=1, of=2))
    alone, one_of_two = (verify(item, made.space, COARSEST, None) for item in (made.mission, share))
    assert all(item.required for item in (*alone.rooms[:1], *alone.kinds))
    assert not any(item.required for item in (one_of_two.whole, *one_of_two.rooms, *one_of_two.kinds))
    assert network_words(one_of_two)[0].startswith("of this mission, one of 2, all scans are connected")


def test_an_accuracy_is_of_all_scans_that_register_and_not_of_one_mission_of_them() -> None:
    """A follow-up mission's scans register with those of the run before, which are not simulated."""
    made = plan(two_rooms(0.9), Settings(range=6.0))
    space = replace(made.space, settings=replace(made.space.settings, accuracy=0.001))
    share = changed(made.mission, share=MissionAllocation(kind="robot", number=1, of=2))
    further = changed(made.mission, id="0" * 32, name=f"{made.mission.name}-top-up")
    whole, *others = (verify(item, space, COARSEST, None) for item in (made.mission, share, further))
    assert any("mm required" in line for line in whole.unmet)
    for proof in others:
        assert not any("mm required" in line for line in proof.unmet)
        assert any("together: not compared" in line for line in network_words(proof))
    assert not any("not compared" in line for line in network_words(whole))


def test_a_mission_without_stops_is_no() -> None:
    made = plan(hall(), Settings())
    with pytest.raises(NegativeResult, match="no stops"):
        verify(changed(made.mission, stops=()), made.space, COARSE, None)


@pytest.mark.usefixtures("no_pairs")
def test_beams_are_seen_from_below_and_windows_seen_through() -> None:
    beam = element("beam", "beams", box(2.0, 0.0, 2.3, 4.0))
    pane = element("pane", "windows", box(4.0, 1.0, 4.05, 3.0))
    proof = verified(
        hall(6, 4, beam, pane), Settings(range=10.0, targets=("walls", "beams", "windows")), COARSE
    )
    by_kind = {share.name: share for share in proof.kinds}
    assert by_kind["beams"].simulated == pytest.approx(1.0, abs=0.05)
    assert by_kind["windows"].acquired > 0
    assert by_kind["walls"].acquired > 0.95 * by_kind["walls"].promised, "behind the pane too"


@pytest.mark.usefixtures("no_pairs")
def test_closed_doors_stop_rays_except_from_the_doorway() -> None:
    settings = Settings(range=10.0, doors="closed", door_scan=True)
    proof = verified(two_rooms(0.9), settings, COARSEST)
    assert not [stop for stop in proof.stops if stop.short]
    shut = {stop.stop: stop for stop in proof.stops}
    doorway = next(stop.id for stop in proof.mission.stops if stop.doorway)
    assert shut[doorway].sighted >= 0.98 * shut[doorway].claimed


def test_the_same_seed_gives_the_same_proof() -> None:
    one, other = (verified(hall(4, 3, column("c", 2, 2)), Settings(range=3.0), COARSEST) for _ in range(2))
    assert len(one.clouds) > 1
    assert one.network == other.network
    assert all(np.array_equal(a.xyz, b.xyz) for a, b in zip(one.clouds, other.clouds, strict=True))


# ---- registration ----


def clouds_of(
    floor: FloorPlan, places: list[tuple[float, float]], simulation: Simulation, *, model: bool = False
) -> list[FloatArray]:
    """Clouds at the extruded floor, or at the same solids as those of a `model`."""
    space = space_of(floor)
    solids = extruded(space.floor, [], simulation.ceiling_m)
    strips = strips_of(solids, space.targets, space.floor, simulation.ceiling_m)
    stands = [
        ScannerPose(frozen([x, y, 1.3] - np.array([*solids.origin, 0.0])), 0.0, number=k)
        for k, (x, y) in enumerate(places)
    ]
    if model:
        triangles = solids.corners + np.array([*solids.origin, 0.0])
        scene = ModelScene(ModelSolids(frozen(triangles), simulation.ceiling_m), solids.origin)
        return [scanned_model(scene, strips, stand, simulation).cloud for stand in stands]
    return [scanned(scene_at(solids, stand), strips, stand, simulation).cloud for stand in stands]


def pair_of(floor: FloorPlan, a: tuple[float, float], b: tuple[float, float], simulation: Simulation):
    surfaces = [surface_of(cloud, simulation) for cloud in clouds_of(floor, [a, b], simulation)]
    found = registered(("a", "b"), np.array([(*a, 1.3), (*b, 1.3)]), surfaces, simulation)
    return [item.pair for item in found]


@pytest.mark.parametrize("model", [False, True])
def test_a_cloud_has_all_rays_where_few_would_lie_too_far_apart(model: bool) -> None:
    """A hall 30 m long: rays every 0.4° lie 2 cm apart on the near end and 18 cm on the far one."""
    simulation = Simulation(range_m=5.0, joining_m=40.0, step_deg=0.2)
    (cloud,) = clouds_of(hall(30, 4), [(3.0, 2.0)], simulation, model=model)
    level = np.abs(cloud[:, 2]) < 0.3
    for end, step in ((27.0, 1), (-3.0, 2)):
        there = level & (np.abs(cloud[:, 0] - end) < 0.1)
        azimuth = np.degrees(np.arctan(cloud[there, 1] / end)) / simulation.step_deg
        ray = np.unique(np.rint(azimuth[np.abs(azimuth) < 15] - 0.5))
        assert (np.diff(ray) == step).all()


def test_pairs_are_the_same_with_and_without_a_second_process(monkeypatch: pytest.MonkeyPatch) -> None:
    places, simulation = [(1.5, 1.0), (4.5, 3.0), (4.5, 1.0)], replace(COARSEST, step_deg=3.0)
    surfaces = [surface_of(cloud, simulation) for cloud in clouds_of(hall(6, 4), places, simulation)]
    found = []
    for many in (0, 100):
        monkeypatch.setattr(registration, "MANY", many)
        positions = np.array([(*place, 1.3) for place in places])
        found.append([item.pair for item in registered("abc", positions, surfaces, simulation)])
    assert [(pair.a, pair.b) for pair in found[0]] == [("a", "b"), ("a", "c"), ("b", "c")]
    assert found[0] == found[1]


@cache
def pair_in_a_room():
    (pair,) = pair_of(hall(6, 4, column("c", 2, 2)), (1.5, 1.0), (4.5, 3.0), replace(COARSEST, step_deg=1.6))
    return pair


@cache
def pair_in_a_corridor():
    """Its ends are out of range: nothing holds the pair along x."""
    simulation = replace(COARSEST, range_m=4.0, joining_m=4.0, step_deg=0.8)
    (pair,) = pair_of(hall(30, 2), (13.0, 1.0), (15.0, 1.0), simulation)
    return pair


def test_two_scans_of_one_room_register_from_a_given_error() -> None:
    pair = pair_in_a_room()
    assert pair.registered
    assert pair.free_deg is None
    assert pair.error_m < 0.003


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_pair_starts_along_its_weakest_direction_with_every_seed(seed: int) -> None:
    """A corridor with one step in it: whatever the seed, two starts are 5 cm off along the corridor."""
    simulation = replace(COARSEST, range_m=4.0, joining_m=4.0, seed=seed)
    places = [(13.0, 1.0), (15.0, 1.0)]
    one, other = (surface_of(cloud, simulation) for cloud in clouds_of(hall(30, 2), places, simulation))
    two = _CloudPair(one, other, _shift(np.array([2.0, 0.0, 0.0])))
    along = [start[0, 3] - 2.0 for start in _starts(two, simulation, (0, 1))]
    assert sorted(np.abs(along))[-2:] == pytest.approx([0.05, 0.05], abs=1e-3)


def test_the_first_start_that_misses_decides() -> None:
    pair, good = pair_in_a_corridor(), pair_in_a_room()
    assert pair.starts == 1 and pair.error_m > 0.01
    assert good.starts == 4 and good.least_error_m <= good.error_m


def test_scans_along_a_corridor_are_free_along_it_and_reported_so() -> None:
    pair = pair_in_a_corridor()
    assert not pair.registered
    assert pair.free_deg is not None
    assert min(pair.free_deg, 180 - pair.free_deg) < 5


def test_a_pair_that_comes_back_along_its_weakest_direction_is_constrained(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever fraction of its points face that direction: two of four starts are 5 cm off along it."""
    monkeypatch.setattr(registration, "WEAKEST", 0.9)
    places = (1.5, 1.0), (4.5, 3.0)
    (pair,) = pair_of(hall(6, 4, column("c", 2, 2)), *places, replace(COARSEST, step_deg=1.6))
    assert pair.registered and pair.starts == 4


def test_the_two_sides_of_a_wall_are_no_pair() -> None:
    floor = two_rooms(0.9, thick=0.1, at=0.5)
    assert pair_of(floor, (2.0, 3.0), (6.0, 3.0), replace(COARSEST, range_m=3.0, joining_m=3.0)) == []


def test_how_far_off_a_pose_is() -> None:
    turned = np.eye(4)
    angle = math.radians(3)
    turned[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    turned[:3, 3] = (0.03, 0.04, 0.0)
    assert off(turned) == pytest.approx((0.05, 3.0))


def test_rays_are_reported_by_the_step() -> None:
    fan = RayFan.of(replace(COARSE, fov_deg=90.0, step_deg=1.0, cone_deg=60.0), heading=0.0)
    assert len(fan.azimuth) == 90
    assert math.degrees(fan.azimuth[0]) == pytest.approx(-44.5)
    assert math.degrees(fan.elevation[0]) == pytest.approx(-59.5)
    assert math.degrees(fan.elevation[-1]) == pytest.approx(89.5)


def space_of(floor: FloorPlan) -> NavigableSpace:
    return navigable(floor, Settings())


def coverage_of(made) -> Coverage:
    import msgspec

    return msgspec.json.decode(coverage_json(made.route, made.mission, made.figures), type=Coverage)


def test_limits_are_held_by_what_was_measured() -> None:
    """A scanner half as fine as planned makes points twice as far apart: too far."""
    settings = Settings(range=6.0, angular_step=0.4, density=25.0, max_incidence=60.0)
    simulation = replace(COARSEST, step_deg=0.4)
    assert verified(hall(4, 3), settings, simulation).met
    coarser = verified(hall(4, 3), settings, replace(simulation, step_deg=0.8))
    assert not coarser.met
    assert coarser.whole.missed > 1.0


def test_a_pair_that_is_to_register_and_does_not_is_caught() -> None:
    from stopgo.mission.document import Overlap

    made = plan(two_rooms(0.9, thick=0.1, at=0.5), Settings(range=3.0))
    names = [stop.id for stop in made.mission.stops]
    promised = (Overlap(a=names[0], b=names[-1], common_m=3.0, share=0.2, hold_m=1.0),)
    lying = changed(made.mission, network=promised)
    simulation = replace(COARSEST, range_m=3.0, joining_m=1.0)
    proof = verify(lying, made.space, simulation, None)
    assert f"{names[0]} and {names[-1]}: planned to register, but do not" in proof.unmet


def rooms_in_a_row(count: int) -> FloorPlan:
    """Rooms of 4 m x 4 m in a row, with a door between neighbours."""
    low = [wall(f"w{k}", box(4.2 * k - 0.2, 0, 4.2 * k, 1.55)) for k in range(1, count)]
    high = [wall(f"v{k}", box(4.2 * k - 0.2, 2.45, 4.2 * k, 4)) for k in range(1, count)]
    return floor_of(
        box(0, 0, 4.2 * count - 0.2, 4),
        rooms=[room(f"r{k}", box(4.2 * k, 0, 4.2 * k + 4, 4)) for k in range(count)],
        openings=[door(f"d{k}", (4.2 * k - 0.1, 1.55), (4.2 * k - 0.1, 2.45)) for k in range(1, count)],
        elements=[shell(0, 0, 4.2 * count - 0.2, 4), *low, *high],
    )


SMALL: dict[str, Callable[[], FloorPlan]] = {
    "two rooms, narrow door": lambda: two_rooms(0.75),
    "hall": lambda: hall(8, 6),
    "corridor": lambda: hall(12, 2.2),
    "rooms in a row": lambda: rooms_in_a_row(3),
}
READ = {
    "office": Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf",
    **{name: SHARED / "layered" / f"{name}.dxf" for name in ("duplex-l1", "fzk-haus-eg", "office-l1")},
    "case1_structural": SHARED / "paper" / "synthetic_case1_structural.dxf",
}
JOINED = some([*SMALL, *READ], every=2)[: size(short=2, full=99)]


@pytest.mark.parametrize("name", JOINED)
def test_the_components_of_a_plan_are_those_of_its_simulated_scans(name: str) -> None:
    if name in READ and not READ[name].exists():
        pytest.skip(f"{READ[name]} is not at hand")
    floor = SMALL[name]() if name in SMALL else read_floor(READ[name])
    settings = Settings(range=4.0) if name in SMALL else Settings()
    step, cone = (0.5, 0.0) if name in SMALL else (0.1, 60.0)  # degrees
    simulation = Simulation(range_m=settings.range, step_deg=step, cone_deg=cone)
    proof = verified(floor, settings, simulation)
    network = network_of(proof.mission)
    assert network is not None
    planned, simulated = ({frozenset(piece) for piece in item.pieces} for item in (network, proof.network))
    assert planned == simulated
    assert not [line for line in proof.unmet if "planned to register" in line]


def test_scans_of_a_real_floor_register_without_the_robots_poses() -> None:
    """Five of the six pairs of duplex do; the two stops of the other one share no second direction."""
    if not READ["duplex-l1"].exists():
        pytest.skip(f"{READ['duplex-l1']} is not at hand")
    simulation = Simulation(range_m=Settings().range, poses=False)
    proof = verified(read_floor(READ["duplex-l1"]), Settings(), simulation)
    assert proof.network.closed
    registered = [pair for pair in proof.network.pairs if pair.registered]
    assert (len(registered), len(proof.network.pairs)) == (5, 6)
