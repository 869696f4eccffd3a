"""A mission: the content of mission.json, as it is sent to the robot.

Metres, radians counter-clockwise from +x, seconds; keys that end in `_deg` are degrees.
"""

from __future__ import annotations

import hashlib
from typing import Any, Final, Literal

import msgspec
from msgspec import UNSET, UnsetType

from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.frames.transform import Point, SiteOrigin, Transform
from stopgo.mission.settings import FLOOR_PARAMETERS, Settings, recorded_values

SCHEMA: Final = "stopgo/mission"
VERSION: Final = 1

OnFailure = Literal["retry", "skip", "ask", "abort", "home"]


class Document(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of every part of the document: frozen, and strict about unknown keys."""


class Frame(Document, frozen=True):
    name: str
    to_map: Transform | None = None


class RobotSpec(Document, frozen=True):
    radius: float
    speed: float
    turn_rate: float
    """Radians per second."""
    acceleration: float


class ScannerSpec(Document, frozen=True):
    profile: str
    range: float
    fov_deg: float = 360.0
    model: str | UnsetType = UNSET
    """Name among the scanners that stopgo knows; the following fields are absent if not given."""
    step_deg: float | UnsetType = UNSET
    """Angle between neighbouring points."""
    near: float | UnsetType = UNSET
    """Minimum scanner range."""
    blind_cone_deg: float | UnsetType = UNSET
    """Opening angle of the blind cone below the scanner, from side to side."""
    height: float | UnsetType = UNSET
    """Height above the floor."""


class LimitsSpec(Document, frozen=True):
    """Limits at which a target counts as covered; an absent value is no limit."""

    max_incidence_deg: float | UnsetType = UNSET
    """Greatest angle from the surface normal."""
    near: float | UnsetType = UNSET
    """Minimum distance from the scanner, for a wall measured to its foot."""
    density_mm: float | UnsetType = UNSET
    """Greatest distance between neighbouring points."""
    wall_height: float | UnsetType = UNSET
    """Incidence and spacing hold from the floor up to it; if absent, only at the scanner's height."""
    views: int | UnsetType = UNSET
    """Number of stops that must see it."""


class MissionAllocation(Document, frozen=True):
    """Part of this mission in a floor that several missions cover together."""

    kind: Literal["robot", "tour"]
    """`robot`: robots drive at the same time. `tour`: one robot drives the tours one after another."""
    number: int
    """From 1."""
    of: int


class Start(Document, frozen=True):
    x: float
    y: float
    heading: float
    reason: str


class Scan(Document, frozen=True):
    profile: str
    duration_s: float
    timeout_s: float


class Sees(Document, frozen=True):
    units: int
    """Target units that this stop sees."""
    new_units: int
    """Those of them that count as seen from this stop of the route on."""


class PositionError(Document, frozen=True):
    """Predicted error of a scan's position in the frame of its network: the standard error ellipse."""

    major_m: float
    """Standard deviation in the worst direction, metres."""
    minor_m: float
    """Standard deviation across it, metres."""
    direction: float
    """Worst direction, radians counter-clockwise from +x, from 0 to π."""


class Stop(Document, frozen=True):
    id: str
    x: float
    y: float
    heading: float
    doorway: bool
    tolerance_m: float
    settle_s: float
    scan: Scan
    on_failure: OnFailure
    retries: int
    approach: tuple[Point, ...]
    """Polyline from the previous stop (or the start) to this stop, both ends included."""
    sees: Sees
    error: PositionError | UnsetType = UNSET
    """Absent if no network holds the scan; 0 for the scan whose frame the network has."""


class Overlap(Document, frozen=True):
    """Two stops whose scans register with one another, and their common boundary."""

    a: str
    b: str
    common_m: float
    """Metres of boundary that both see."""
    share: float
    """Overlap ratio: common boundary as a fraction of what the stop sees that sees less."""
    hold_m: float
    """Registration strength: metres of wall that resist the weakest small move in x, y and heading."""


class Policy(Document, frozen=True):
    link_loss: Literal["continue", "finish_stop", "hold", "home"]
    link_loss_after_s: float
    battery_min: float
    own_way: bool | UnsetType = UNSET
    """True if the robot may leave the legs and find its own way to each stop; absent if it may not."""


class Origin(Document, frozen=True):
    """Source of the mission: floor, parameters and version."""

    floor: str
    floor_digest: str
    parameters: dict[str, Any]
    """The plan's parameters by name; only recorded, so that a robot older than the plan reads it."""
    stopgo: str


class Mission(Document, frozen=True, kw_only=True):
    """A route of scan stops, in the order of driving."""

    schema: Literal["stopgo/mission"] = SCHEMA
    version: Literal[1] = VERSION
    id: str
    revision: int
    name: str
    digest: str
    frame: Frame
    georeference: SiteOrigin | None
    robot: RobotSpec
    scanner: ScannerSpec
    limits: LimitsSpec | UnsetType = UNSET
    """Absent if there are no limits."""
    share: MissionAllocation | UnsetType = UNSET
    """Absent if this mission alone covers its part of the floor."""
    start: Start
    stops: tuple[Stop, ...]
    return_: tuple[Point, ...] | None = msgspec.field(name="return")
    policy: Policy
    origin: Origin
    network: tuple[Overlap, ...] | msgspec.UnsetType = msgspec.UNSET
    """Pairs of stops that register with one another; absent if the plan does not require it."""


def stop_names(count: int) -> list[str]:
    """Return the ids of `count` stops, in the order of driving."""
    width = max(2, len(str(count)))
    return [f"s{number:0{width}d}" for number in range(1, count + 1)]


def canonical(document: Any) -> bytes:
    """Return canonical JSON: keys sorted, no spaces, shortest numbers that read back the same."""
    return msgspec.json.encode(document, order="deterministic")


def digest_of(mission: Mission) -> str:
    """Return the sha256 of the mission's canonical JSON without its `digest`, hexadecimal.

    Hashed stop by stop, so that other threads can run: a robot must still receive a pause command.
    """
    document = msgspec.to_builtins(msgspec.structs.replace(mission, stops=()))
    del document["digest"]
    hashed, before = hashlib.sha256(), b"{"
    for key in sorted(document):
        hashed.update(before + canonical(key) + b":")
        if key == "stops":
            _add_stops(hashed, mission.stops)
        else:
            hashed.update(canonical(document[key]))
        before = b","
    hashed.update(b"}")
    return hashed.hexdigest()


def _add_stops(hashed: hashlib._Hash, stops: tuple[Stop, ...]) -> None:
    before = b"["
    for stop in stops:
        hashed.update(before + canonical(msgspec.to_builtins(stop)))
        before = b","
    hashed.update(b"]" if stops else b"[]")


def with_digest(mission: Mission) -> Mission:
    """Return the same mission with its `digest` set."""
    return msgspec.structs.replace(mission, digest=digest_of(mission))


BY_HAND = ("use", "avoid")
"""Parameters by which a person moves, adds or forbids single stops."""


def floor_plan_id(mission: Mission) -> str:
    """Return the id of the plan of a floor that a mission is a part of; its own id if it is the whole plan.

    All missions that share a floor have the same one.
    """
    if mission.share is UNSET:
        return mission.id
    origin = mission.origin
    parameters = {key: value for key, value in origin.parameters.items() if key not in BY_HAND}
    basis = [origin.floor_digest, parameters, origin.stopgo, mission.share.kind, mission.share.of]
    return hashlib.sha256(canonical({"basis": basis})).hexdigest()[:32]


def mission_id(source: FloorSource, settings: Settings, version: str, part: int = 0) -> str:
    """Return the hash of floor, parameters, version and part: known before planning, and the recording id.

    Parameters of the floor's reader are hashed as part of the source. Stops that are required or forbidden
    by hand make another revision, not another mission.
    """
    return _id_of(source, recorded_values(settings), version, part)


def _id_of(source: FloorSource, recorded: dict[str, Any], version: str, part: int) -> str:
    values = recorded | {name: [] for name in BY_HAND}
    parameters = {key: value for key, value in values.items() if key not in FLOOR_PARAMETERS}
    basis = [source.basis, parameters, version, part]
    return hashlib.sha256(canonical({"basis": basis})).hexdigest()[:32]


UNDIVIDED = -1
"""Part number of the plan that robots or tours divide: its mission is not driven, and has its own id."""


def ids_of_plan(mission: Mission, source: FloorSource, settings: Settings, parts: int) -> frozenset[str]:
    """Return the ids that a plan of a floor has by the parameters and version that a mission records.

    Parameters count as recorded, and as `settings` read from them have them: a later version may record more.
    """
    origin, shares = mission.origin, 1 if mission.share is UNSET else mission.share.of
    numbers = range(UNDIVIDED, max(parts, shares))
    recorded = (origin.parameters, recorded_values(settings))
    return frozenset(_id_of(source, values, origin.stopgo, k) for values in recorded for k in numbers)
