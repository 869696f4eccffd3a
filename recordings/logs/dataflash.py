"""ArduPilot's own logs (.BIN, DataFlash): columns of each kind of message, read from the bytes.

The file describes itself: FMT messages give the length and the column names of each kind of message.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.frames.geodesy import Geodetic, from_geodetic
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
from stopgo.mission.mavlink.autopilots.kind import Mode
from stopgo.mission.mavlink.items import Command, Item
from stopgo.recordings.logs.field_log import (
    Channel,
    FieldLog,
    LoggedMission,
    Poses,
    Reading,
    Remark,
    RemarkKind,
    fixes_of,
    poses_of,
)

HEAD = b"\xa3\x95"
FMT = 0x80
FMT_LENGTH = 89
TYPES = {
    "a": ("i2", 32), "b": ("i1", 1), "B": ("u1", 1), "h": ("<i2", 1), "H": ("<u2", 1), "i": ("<i4", 1),
    "I": ("<u4", 1), "f": ("<f4", 1), "d": ("<f8", 1), "n": ("S4", 1), "N": ("S16", 1), "Z": ("S64", 1),
    "c": ("<i2", 1), "C": ("<u2", 1), "e": ("<i4", 1), "E": ("<u4", 1), "L": ("<i4", 1), "M": ("u1", 1),
    "q": ("<i8", 1), "Q": ("<u8", 1), "g": ("<f2", 1),
}  # fmt: skip
"""Letters of a message's format: numpy's type name, and the number of values."""
HUNDREDTHS = frozenset("cCeE")
WANTED = frozenset(
    {"POS", "XKF1", "NKF1", "SIM", "ATT", "ORGN", "CMD", "MISE", "MODE", "MSG", "BAT", "GPS", "CAM", "TRIG"}
)
GPS_EPOCH_S = 315_964_800
LEAP_S = 18
"""Seconds by which GPS time is ahead of UTC since 2017."""
TICK_EVERY = 200_000
ITEM_COLUMNS = ("CNum", "CId", "Prm1", "Prm2", "Prm3", "Prm4", "Lat", "Lng", "Alt")
EKF_ORIGIN = 0
"""Type of the ORGN rows that contain the filter's origin."""
RULE = "ardupilot"
LOCAL, GLOBAL, WITHOUT_ORIGIN = 1, 2, 3
"""Ranks of poses in metres from a known origin, of latitudes and longitudes, and of metres from nowhere."""
END_NS = np.iinfo(np.int64).max


def read_dataflash(path: Path, reading: Reading) -> FieldLog:
    """Read a .BIN to its end; invalid bytes between messages are skipped and counted.

    Raises
    ------
    InputError
        When no message in it can be read.
    """
    scan = _scanned(path, reading)
    if not scan.counts:
        raise InputError(f"{path}: no readable message; check that it is an ArduPilot .BIN")
    tables = _Tables(path, scan)
    poses = tuple(_poses(tables))
    begin, end = tables.span()
    return FieldLog(
        path=str(path),
        format="ArduPilot BIN",
        digest=file_digest(path),
        messages=sum(scan.counts.values()),
        clock="wall" if tables.offset_ns else "since boot",
        begin_ns=begin,
        end_ns=end,
        channels=tuple(Channel(name, "", count) for name, count in sorted(scan.counts.items())),
        poses=poses,
        uploads=tuple(_uploads(tables)),
        remarks=tuple(sorted(_remarks(tables), key=lambda remark: remark.ns)),
        battery=tuple(_battery(tables)),
        lost=scan.lost,
        oddities=scan.oddities,
    )


@dataclass(frozen=True)
class _Kind:
    """Kind of message, as its FMT message describes it."""

    name: str
    dtype: np.dtype[Any]
    """Type of the whole message, with its header of three bytes."""
    hundredths: frozenset[str]


@dataclass
class _Scan:
    """Positions of the wanted messages in a file."""

    kinds: dict[str, _Kind] = field(default_factory=dict)
    offsets: dict[str, array[int]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    lost_bytes: int = 0
    size: int = 0

    tail_bytes: int = 0
    """Bytes of a last message that is truncated, as when the vehicle is switched off."""

    @property
    def lost(self) -> str:
        if not self.lost_bytes:
            return ""
        return f"{self.lost_bytes} of {self.size} bytes are invalid"

    @property
    def oddities(self) -> tuple[str, ...]:
        if not self.tail_bytes:
            return ()
        return (
            f"the last message is truncated ({self.tail_bytes} bytes), as when a vehicle is switched off",
        )


def _scanned(path: Path, reading: Reading) -> _Scan:
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        return _walk(data, reading)


def _walk(data: mmap, reading: Reading) -> _Scan:
    """Read one message per step; an FMT message comes before the messages that it describes."""
    scan = _Scan(size=len(data))
    lengths = [0] * 256
    lengths[FMT] = FMT_LENGTH
    names = [""] * 256
    names[FMT] = "FMT"
    seen = [0] * 256
    wanted: list[array[int] | None] = [None] * 256
    at, end, steps = 0, len(data), 0
    while at + 3 <= end:
        kind = data[at + 2]
        length = lengths[kind] if data[at] == HEAD[0] and data[at + 1] == HEAD[1] else 0
        if not length or at + length > end:
            next_head = data.find(HEAD, at + 1)
            if next_head < 0 and length:
                scan.tail_bytes, at = end - at, end
                break
            next_head = end if next_head < 0 else next_head
            scan.lost_bytes += next_head - at
            at = next_head
            continue
        if kind == FMT:
            _describe(data[at : at + length], scan, lengths, names, wanted)
        seen[kind] += 1
        offsets = wanted[kind]
        if offsets is not None:
            offsets.append(at)
        at += length
        steps += 1
        if steps % TICK_EVERY == 0:
            reading.tick(at / end)
    scan.tail_bytes += end - at
    scan.counts = Counter({names[kind]: count for kind, count in enumerate(seen) if count})
    return scan


def _describe(
    message: bytes, scan: _Scan, lengths: list[int], names: list[str], wanted: list[array[int] | None]
) -> None:
    """Add the kind that a FMT message describes; a contradictory one is ignored."""
    number, length = message[3], message[4]
    name, form, columns = (_text(message[a:b]) for a, b in ((5, 9), (9, 25), (25, 89)))
    kind = _kind(name, form, columns.split(","))
    if number == FMT or kind is None or kind.dtype.itemsize != length:
        return
    if name in WANTED and scan.kinds.setdefault(name, kind) != kind:
        return
    lengths[number], names[number] = length, name
    if name in WANTED:
        wanted[number] = scan.offsets.setdefault(name, array("q"))


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("ascii", "replace")


def _kind(name: str, form: str, columns: list[str]) -> _Kind | None:
    if len(columns) != len(form) or len(set(columns)) != len(columns) or set(form) - TYPES.keys():
        return None
    fields: list[Any] = [("head", "S3")]
    for column, letter in zip(columns, form, strict=True):
        kind, count = TYPES[letter]
        fields.append((column, kind) if count == 1 else (column, kind, (count,)))
    scaled = frozenset(column for column, letter in zip(columns, form, strict=True) if letter in HUNDREDTHS)
    return _Kind(name, np.dtype(fields), scaled)


class _Tables:
    """Columns of the wanted kinds, read on demand."""

    def __init__(self, path: Path, scan: _Scan) -> None:
        self._data = np.memmap(path, np.uint8, "r")
        self._scan = scan
        self._known: dict[str, np.ndarray | None] = {}
        self.offset_ns = self._since_1970()

    def rows(self, name: str) -> np.ndarray | None:
        """Return the messages of a kind as a structured array (n,); None if next_head is none."""
        if name not in self._known:
            offsets = np.array(self._scan.offsets.get(name, ()), np.int64)
            self._known[name] = self._rows_at(name, offsets) if len(offsets) else None
        return self._known[name]

    def _rows_at(self, name: str, offsets: IntArray) -> np.ndarray:
        kind = self._scan.kinds[name].dtype
        raw = self._data[offsets[:, None] + np.arange(kind.itemsize)]
        return np.ascontiguousarray(raw).view(kind)[:, 0]

    def numbers(self, name: str, column: str) -> FloatArray:
        """Return a column in its own unit (n,)."""
        rows = self.rows(name)
        assert rows is not None
        scale = 0.01 if column in self._scan.kinds[name].hundredths else 1.0
        return np.asarray(rows[column], float) * scale

    def has(self, name: str, *columns: str) -> bool:
        """Return True if there are messages of a kind, with their time and these columns of numbers."""
        rows = self.rows(name)
        fields: Any = {} if rows is None else rows.dtype.fields or {}
        return all(column in fields and fields[column][0].kind in "iuf" for column in ("TimeUS", *columns))

    def ns(self, name: str) -> IntArray:
        """Return the time of each message of a kind (n,)."""
        rows = self.rows(name)
        assert rows is not None
        return rows["TimeUS"].astype(np.int64) * 1000 + self.offset_ns

    def span(self) -> tuple[int, int]:
        times = [self.ns(name) for name in self._scan.offsets if self.has(name)]
        full = [ns for ns in times if len(ns)]
        return (min(int(ns[0]) for ns in full), max(int(ns[-1]) for ns in full)) if full else (0, 0)

    def _since_1970(self) -> int:
        """Return the offset from boot time to 1970, if a GPS receiver gave the date; else 0."""
        self.offset_ns = 0
        if not self.has("GPS", "GMS", "GWk"):
            return 0
        week, ms = self.numbers("GPS", "GWk"), self.numbers("GPS", "GMS")
        dated = np.flatnonzero(week > 0)
        if not len(dated):
            return 0
        first = dated[0]
        seconds = GPS_EPOCH_S + week[first] * 604_800 + ms[first] / 1000 - LEAP_S
        return round(seconds * 1e9) - int(self.ns("GPS")[first])


def _poses(tables: _Tables) -> Iterator[Poses]:
    """Yield the vehicle's estimated poses, in metres and in degrees, and a simulator's true poses."""
    found = [
        *(_filtered(tables, name) for name in ("XKF1", "NKF1")),
        _placed(tables, "POS", truth=False),
        _placed(tables, "SIM", truth=True),
    ]
    yield from (track for track in found if track is not None)


def _filtered(tables: _Tables, name: str) -> Poses | None:
    """Return the poses of the filter's first core, in metres from its origin."""
    if not tables.has(name, "PN", "PE", "Yaw"):
        return None
    rows = tables.rows(name)
    assert rows is not None
    mine = rows["C"] == rows["C"].min() if "C" in (rows.dtype.names or ()) else np.ones(len(rows), bool)
    xy = np.stack([tables.numbers(name, "PE"), tables.numbers(name, "PN")], axis=-1)[mine]
    heading = np.radians(90.0 - tables.numbers(name, "Yaw")[mine])
    ns, origins = tables.ns(name)[mine], _origins(tables)
    origin = origins[0][1] if origins else None
    for (since_ns, later), (until_ns, _) in pairwise([*origins, (END_NS, origin)]):
        if origin is not None and later is not None and later != origin:
            part = (ns >= since_ns) & (ns < until_ns)
            xy[part] += from_geodetic(origin, Geodetic(lat=later.lat, lon=later.lon), RULE)
    rank = LOCAL if origin is not None else WITHOUT_ORIGIN
    height = -tables.numbers(name, "PD")[mine] if tables.has(name, "PD") else None
    return poses_of(
        name, "local", ns, xy, heading, rank=rank, origin=origin, rule=RULE, height=height, own_clock=True
    )


def _origins(tables: _Tables) -> list[tuple[int, SiteOrigin]]:
    """Return the origins of the filter, each with the time since when it applies.

    ORGN rows of another type contain home, which is where the vehicle was switched on.
    """
    if not tables.has("ORGN", "Lat", "Lng"):
        return []
    rows = tables.rows("ORGN")
    assert rows is not None
    typed = "Type" in (rows.dtype.names or ())
    found = []
    for ns, row in zip(tables.ns("ORGN").tolist(), rows, strict=True):
        origin = _site(float(row["Lat"]), float(row["Lng"]))
        if origin is not None and (not typed or row["Type"] == EKF_ORIGIN):
            found.append((ns, origin))
    return found


def _site(lat: float, lon: float, alt: float = 0.0) -> SiteOrigin | None:
    """Return a position given in steps of 1e-7 degrees; None for 0, 0."""
    return (
        SiteOrigin(lat=lat / 1e7, lon=lon / 1e7, alt=alt, heading_deg=0.0) if (lat, lon) != (0, 0) else None
    )


def _placed(tables: _Tables, name: str, *, truth: bool) -> Poses | None:
    if not tables.has(name, "Lat", "Lng"):
        return None
    ns = tables.ns(name)
    degrees = np.stack([tables.numbers(name, "Lat"), tables.numbers(name, "Lng")], axis=-1) / 1e7
    own = tables.has(name, "Yaw")
    bearing = tables.numbers(name, "Yaw") if own else _bearing_at(tables, ns)
    return fixes_of(name, RULE, ns, degrees, bearing, rank=GLOBAL, truth=truth, own_clock=True)


def _bearing_at(tables: _Tables, ns: IntArray) -> FloatArray:
    """Return degrees clockwise from north at given times, from the attitude."""
    if not tables.has("ATT", "Yaw"):
        return np.full(len(ns), np.nan)
    bearing = np.unwrap(tables.numbers("ATT", "Yaw"), period=360.0)
    return np.interp(ns, tables.ns("ATT"), bearing)


def _uploads(tables: _Tables) -> Iterator[LoggedMission]:
    """Yield logged missions, each from its item 0 (home) on."""
    if not tables.has("CMD", "CTot", *ITEM_COLUMNS):
        return
    rows, ns = tables.rows("CMD"), tables.ns("CMD")
    assert rows is not None
    for listing in _listings(rows["CNum"].astype(int).tolist())[0]:
        logged_items = rows[listing]
        items = tuple(_item(row) for row in logged_items if row["CNum"] > 0)
        if items:
            home = _home(logged_items[0]) if logged_items[0]["CNum"] == 0 else None
            whole = len(logged_items) == int(logged_items[0]["CTot"])
            yield LoggedMission(int(ns[listing[0]]), items, "ardupilot", complete=whole, home=home)


def _listings(numbers: list[int]) -> tuple[list[list[int]], list[int]]:
    """Return the rows of each listed mission, and the rows of items that the vehicle began.

    A list counts up from item 0. Older autopilots log an item again, alone, when they begin it.
    """
    listings: list[list[int]] = []
    begun: list[int] = []
    for row, number in enumerate(numbers):
        if number == 0 or (row == 0 and number == 1):
            listings.append([row])
        elif listings and number == numbers[listings[-1][-1]] + 1:
            listings[-1].append(row)
        else:
            begun.append(row)
    return listings, begun


def _item(row: Any) -> Item:
    params = (float(row["Prm1"]), float(row["Prm2"]), float(row["Prm3"]), float(row["Prm4"]))
    frame = int(row["Frame"]) if "Frame" in row.dtype.names else 3
    command = int(row["CId"])
    position = (int(row["Lat"]), int(row["Lng"]))
    return Item(command, frame, params, x=position[0], y=position[1], z=float(row["Alt"]))


def _home(row: Any) -> SiteOrigin | None:
    return _site(float(row["Lat"]), float(row["Lng"]), float(row["Alt"]))


TRIGGERS = (Command.DO_SEND_SCRIPT_MESSAGE, Command.IMAGE_START_CAPTURE, Command.DO_DIGICAM_CONTROL)


def _remarks(tables: _Tables) -> Iterator[Remark]:
    if tables.has("MODE", "ModeNum"):
        for ns, mode in zip(
            tables.ns("MODE").tolist(), tables.numbers("MODE", "ModeNum").tolist(), strict=True
        ):
            yield Remark(ns, "mode", ARDUPILOT.modes.name(Mode(int(mode))))
    rows = tables.rows("MSG") if tables.has("MSG") else None
    if rows is not None and "Message" in (rows.dtype.names or ()) and rows["Message"].dtype.kind == "S":
        for ns, text in zip(tables.ns("MSG").tolist(), rows["Message"].tolist(), strict=True):
            yield Remark(ns, "text", text.decode("utf-8", "replace"))
    for name in ("CAM", "TRIG"):
        for ns in tables.ns(name).tolist() if tables.has(name) else ():
            yield Remark(ns, "trigger", "camera")
    yield from _executed(tables)


def _executed(tables: _Tables) -> Iterator[Remark]:
    """Yield items when the vehicle began them: MISE rows, before ArduPilot 4.6 single CMD rows."""
    for name in ("MISE", "CMD"):
        rows = tables.rows(name) if tables.has(name, "CTot", *ITEM_COLUMNS) else None
        if rows is None:
            continue
        begun = _listings(rows["CNum"].astype(int).tolist())[1] if name == "CMD" else range(len(rows))
        ns = tables.ns(name)
        for k in begun:
            item = _item(rows[k])
            kind: RemarkKind = "trigger" if item.command in TRIGGERS else "command"
            yield Remark(int(ns[k]), kind, item.name, int(rows[k]["CNum"]))
        if len(begun):
            return


def _battery(tables: _Tables) -> Iterator[tuple[int, float]]:
    if tables.has("BAT", "RemPct"):
        for ns, percentage in zip(
            tables.ns("BAT").tolist(), tables.numbers("BAT", "RemPct").tolist(), strict=True
        ):
            if 0 <= percentage <= 100:
                yield ns, percentage / 100
