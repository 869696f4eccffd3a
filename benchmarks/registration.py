"""Pairs of positions on many floors: simulated registration against the rules that predict it.

`python -m benchmarks.registration simulate pairs.jsonl 0 1` simulates (10 minutes of processor time), and
`... again pairs.jsonl more.jsonl 0 1` repeats the weak pairs that registered, with other noise and from every start. With the names of
files alone it counts every pair by each rule and puts the table into the README; a pair's line in a later file counts.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.floors import office
from benchmarks.shares import FLOORS, SHARED
from benchmarks.table import put, table, versions
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, frozen
from stopgo.mission.proof.plan_proof import Simulation, within_tolerance
from stopgo.mission.settings import Settings
from stopgo.mission.stages import KEPT, OUTSIDE, Candidates
from stopgo.planner.candidates import candidates
from stopgo.planner.candidates.added_scans import with_scans
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.overlap import LEAST_COMMON_M, least_hold_m, overlaps_of
from stopgo.planner.scan_simulation import registration
from stopgo.planner.scan_simulation.casting import SolidScene
from stopgo.planner.scan_simulation.extrusion import NONE
from stopgo.planner.scan_simulation.scanning import CLOUD_DEG, SPARSE_M
from stopgo.planner.scan_simulation.verification import _ScanSite as ScanSite
from stopgo.planner.space.navigable import navigable

ALONE = Settings(register=False)
"""Candidates without doorways, of which any may be required as a position."""
POSITIONS, CLUSTER = 20, 10
"""Positions on each floor, and of each cluster."""
DRAWS = 4
"""Times that a weak pair is repeated, each with noise of its own and from every start."""
WEAK_M = 0.1
"""Hold below which a pair is weak."""
STOREYS = {
    "office": ("Level 2",),
    "school": ("u4pyxnN8d1", "w85seUQP"),
    "duplex": ("Level 2",),
    "fzk-haus": ("Dachgeschoss",),
    "schependomlaan-structure": ("Begane grondvloer", "1e Verdiepingvloer"),
}


def floors() -> Iterator[tuple[str, FloorPlan, Settings]]:
    """Layered floors, storeys of models, drawings, and synthetic offices; a floor that is missing is left out."""
    for seed, size in enumerate(((24, 14), (30, 14), (40, 16), (30, 28), (18, 14), (36, 28)), start=1):
        yield f"office {size[0]} x {size[1]}, seed {seed}", office(*size, seed=seed), ALONE
    for name, (path, options) in FLOORS.items():
        if path.exists():
            yield name, read_floor(path, FloorOptions(d_dis=0.05)), Settings(**options, register=False)
    for name in ("house", "barcelona-plan"):
        path = SHARED / "dxf" / f"{name}.dxf"
        if path.exists():
            yield name, read_floor(path, FloorOptions(d_dis=0.05)), ALONE
    for name, storeys in STOREYS.items():
        path = SHARED / "ifc" / f"{name}.ifc"
        for storey in storeys if path.exists() else ():
            yield f"{name} {storey}", read_floor(path, FloorOptions(d_dis=0.05, storey=storey)), ALONE
    for seed, size in enumerate(((26, 14), (50, 14), (20, 28), (44, 30)), start=11):
        yield f"office {size[0]} x {size[1]}, seed {seed}", office(*size, seed=seed), ALONE


def standing(floor: FloorPlan, settings: Settings, xy: FloatArray) -> Candidates:
    """Candidates at given positions."""
    found = candidates(navigable(floor, settings))
    poses = np.column_stack([xy, np.zeros(len(xy))])
    joined = with_scans(found, poses)
    chosen = np.arange(len(joined.xy)) >= len(found.xy)
    return replace(joined, reason=frozen(np.where(chosen, KEPT, OUTSIDE), np.int64))


def positions(floor: FloorPlan, settings: Settings, seed: int) -> FloatArray:
    """Reachable candidates in clusters, chosen at random: most pairs of a cluster share surfaces."""
    found = candidates(navigable(floor, settings))
    kept, random = found.xy[found.kept], np.random.default_rng(1000 + seed)
    chosen: list[int] = []
    while len(chosen) < min(POSITIONS, len(kept)):
        away = np.hypot(*(kept - kept[random.integers(len(kept))]).T)
        near = np.argsort(away)[: max(60, len(kept) // 4)].tolist()
        pool = [k for k in near if k not in chosen]
        chosen += random.permutation(pool)[: min(CLUSTER, POSITIONS - len(chosen))].tolist()
    return np.asarray(kept[np.sort(chosen)])


def cloud(site: ScanSite, position: FloatArray, simulation: Simulation) -> FloatArray:
    """A scan's points without noise, with dense rays only at upright surfaces where few are sparse (n, 3)."""
    scene = SolidScene(site.solids, position, see_through=False, open_door=NONE)
    step = np.radians(CLOUD_DEG)
    azimuth, elevation = (np.arange(round(360 / CLOUD_DEG)) + 0.5) * step, (np.arange(-165, 165) + 0.5) * step
    azimuth, elevation = (item.ravel() for item in np.meshgrid(azimuth, elevation, indexing="ij"))
    few, far, normal = _hits(site, scene, position, azimuth, elevation)
    slope = np.abs((few * normal).sum(axis=1))
    within = far * np.cos(elevation) <= simulation.joining_m + 0.5
    sparse = within & (np.abs(normal[:, 2]) < registration.UPRIGHT) & (far * step > SPARSE_M * slope)
    every = round(CLOUD_DEG / simulation.step_deg)
    offset = (np.arange(every) - (every - 1) / 2) * step / every
    across, upwards = (item.ravel() for item in np.meshgrid(offset, offset))
    dense = [
        (turn[sparse][:, None] + more[None]).ravel()
        for turn, more in ((azimuth, across), (elevation, upwards))
    ]
    many, beyond, _ = _hits(site, scene, position, *dense)
    found = np.concatenate(
        [(few * far[:, None])[~sparse & np.isfinite(far)], (many * beyond[:, None])[np.isfinite(beyond)]]
    )
    return np.asarray(found[np.hypot(*found[:, :2].T) <= simulation.joining_m])


def surface(found: FloatArray, simulation: Simulation, seed: list[int]) -> registration.OrientedCloud:
    """A scan's cloud as `prove` keeps it, from its points (n, 3) without noise."""
    noise = np.random.default_rng(seed).normal(0.0, simulation.noise_m, len(found))
    noisy = found * (1 + noise / np.linalg.norm(found, axis=1))[:, None]
    return registration.surface_of(noisy, simulation)


def _hits(
    site: ScanSite, scene: SolidScene, position: FloatArray, azimuth: FloatArray, elevation: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Directions (n, 3), distances (n,), and normals (n, 3) of the surfaces met; infinity where none is."""
    level = np.cos(elevation)
    towards = np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)], axis=1)
    met = scene.cast(towards[:, None])[:, 0]
    hit = met != NONE
    far, normal = np.full(len(towards), np.inf), np.zeros(towards.shape)
    far[hit] = scene.distances(met[hit], towards[hit])
    normal[hit] = site.solids.normal[met[hit]]
    return towards, far, normal


def simulated(name: str, floor: FloorPlan, settings: Settings, seed: int) -> Iterator[dict[str, Any]]:
    """Every pair of positions with shared surfaces, registered from every start up to the first miss."""
    simulation = Simulation(range_m=settings.range, ceiling_m=floor.ceiling_m or 2.7)
    site = ScanSite.of(navigable(floor, settings), simulation, None)
    found = standing(floor, settings, positions(floor, settings, seed))
    xy = found.xy[found.kept]
    at = np.column_stack([xy - site.solids.origin, np.full(len(xy), simulation.height_m)])
    surfaces = [surface(cloud(site, place, simulation), simulation, [seed, k]) for k, place in enumerate(at)]
    for i, j in combinations(range(len(xy)), 2):
        two = registration._CloudPair(surfaces[i], surfaces[j], registration._shift(at[j] - at[i]))
        if not two.meets or two.shared_points < registration.LEAST_POINTS:
            continue
        errors = []
        for start in registration._starts(two, simulation, (i, j)):
            errors.append(two.error(two.aligned(start, simulation)))
            if not within_tolerance(*errors[-1]):
                break
        ends = {"a": xy[i].tolist(), "b": xy[j].tolist()}
        yield {"floor": name, **ends, "shared": two.share, "free_deg": two.free_deg, "errors": errors}


def repeated(
    floor: FloorPlan, settings: Settings, rows: list[dict[str, Any]], seed: int
) -> Iterator[dict[str, Any]]:
    """The weak pairs that register, repeated with other noise and from every start, up to the first miss."""
    simulation = Simulation(range_m=settings.range, ceiling_m=floor.ceiling_m or 2.7)
    site = ScanSite.of(navigable(floor, settings), simulation, None)
    figures = counted(floor, settings, rows)
    weak = [row for row, one in zip(rows, figures, strict=True) if registers(row) and one.hold_m < WEAK_M]
    ends = sorted({tuple(row[end]) for row in weak for end in "ab"})
    at = {end: np.append(np.array(end) - site.solids.origin, simulation.height_m) for end in ends}
    points = {end: cloud(site, place, simulation) for end, place in at.items()}
    for draw in range(1, DRAWS + 1):
        surfaces = {
            end: surface(points[end], simulation, [seed, number, draw]) for number, end in enumerate(ends)
        }
        for row in filter(registers, weak):
            a, b = tuple(row["a"]), tuple(row["b"])
            two = registration._CloudPair(surfaces[a], surfaces[b], registration._shift(at[b] - at[a]))
            row["free_deg"] = row["free_deg"] or two.free_deg
            for start in registration._starts(two, simulation, (draw, len(row["errors"]))):
                row["errors"].append(two.error(two.aligned(start, simulation)))
                if not registers(row):
                    break
    yield from weak


def again(known: Path, path: Path, part: int, of: int) -> None:
    """Append the repeated pairs of every `of`-th floor to a file."""
    rows = _by_floor([known])
    with path.open("a") as file:
        for number, (name, floor, settings) in enumerate(floors()):
            if number % of == part and name in rows:
                for pair in repeated(floor, settings, rows[name], number):
                    file.write(json.dumps(pair) + "\n")
                file.flush()
                print(name, file=sys.stderr)


def _by_floor(paths: Sequence[Path]) -> dict[str, list[dict[str, Any]]]:
    """Pairs by floor; of several lines of a pair the last counts."""
    found: dict[tuple[Any, ...], dict[str, Any]] = {}
    for line in (line for path in paths for line in path.read_text().splitlines()):
        row = json.loads(line)
        found[row["floor"], *row["a"], *row["b"]] = row
    known: dict[str, list[dict[str, Any]]] = {}
    for row in found.values():
        known.setdefault(row["floor"], []).append(row)
    return known


def simulate(path: Path, part: int, of: int) -> None:
    """Append the simulated pairs of every `of`-th floor to a file, one JSON object per line."""
    with path.open("a") as file:
        for number, (name, floor, settings) in enumerate(floors()):
            if number % of != part:
                continue
            for pair in simulated(name, floor, settings, number):
                file.write(json.dumps(pair) + "\n")
            file.flush()
            print(name, file=sys.stderr)


@dataclass(frozen=True)
class Figures:
    """Figures of a pair."""

    common_m: float
    share: float
    hold_m: float

    @property
    def registers(self) -> bool:
        """True for a pair that a plan promises."""
        return self.hold_m >= least_hold_m(Settings()) and self.common_m >= LEAST_COMMON_M


def counted(floor: FloorPlan, settings: Settings, rows: list[dict[str, Any]]) -> list[Figures]:
    """Figures of each pair."""
    xy = np.unique([place for row in rows for place in (row["a"], row["b"])], axis=0)
    found = standing(floor, settings, xy)
    at, overlaps, result = found.xy[found.kept], overlaps_of(found), []
    for row in rows:
        i, j = (int(np.argmin(np.hypot(*(at - np.array(row[end])).T))) for end in ("a", "b"))
        near = overlaps.of(i)
        k = np.flatnonzero(near.other == j)
        values = (
            float(getattr(near, key)[k[0]]) if len(k) else 0.0 for key in ("common_m", "share", "hold_m")
        )
        result.append(Figures(*values))
    return result


def registers(row: dict[str, Any]) -> bool:
    """True if every start ends within the tolerance and the pair is constrained."""
    good = all(within_tolerance(*error) for error in row["errors"])
    return good and row["free_deg"] is None


def _shares(least: float, pair: Figures) -> bool:
    return pair.share >= least


RULES: dict[str, Callable[[Figures], bool]] = {
    "predicted error ≤ 1 cm (99 %)": lambda pair: pair.registers,
    "the same, and overlap 0.1 (`--overlap 0.1`)": lambda pair: pair.registers and pair.share >= 0.1,
    **{f"overlap ratio {least:g} alone": partial(_shares, least) for least in (0.1, 0.2, 0.3, 0.5)},
}


def main(paths: list[str]) -> None:
    """Put the table of all simulated pairs into the README."""
    known = _by_floor([Path(path) for path in paths])
    good: list[bool] = []
    figures: list[Figures] = []
    for name, floor, settings in floors():
        rows = known.get(name, [])
        good += [registers(row) for row in rows]
        figures += counted(floor, settings, rows) if rows else []
    lines = [_line(name, rule, figures, np.array(good)) for name, rule in RULES.items()]
    head = ("rule", "promised", "wrong", "precision", "recall")
    note = (
        f"{len(good)} pairs on {len(known)} floors, {sum(good)} of which register from every start: the weak ones "
        f"with noise of {DRAWS + 1} scans each, {4 * (DRAWS + 1)} starts in all."
    )
    put("registration", f"{versions('numpy', 'embreex', 'small-gicp')}\n\n{table(head, lines)}\n\n{note}")


def _line(name: str, rule: Callable[[Figures], bool], figures: list[Figures], good: BoolArray) -> list[str]:
    told = np.array([rule(pair) for pair in figures])
    right = int((told & good).sum())
    return [
        *(name, str(told.sum()), str(told.sum() - right)),
        *(f"{100 * right / max(1, told.sum()):.1f} %", f"{100 * right / max(1, good.sum()):.1f} %"),
    ]


if __name__ == "__main__":
    if sys.argv[1] == "simulate":
        simulate(Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
    elif sys.argv[1] == "again":
        again(Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]), int(sys.argv[5]))
    else:
        main(sys.argv[1:])
