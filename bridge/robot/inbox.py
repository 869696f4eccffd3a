"""Arrival of missions at the robot: announced, received in chunks, then accepted whole or not at all."""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice

import msgspec

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import (
    MAX_CHUNK_BYTES,
    MAX_DOCUMENT_BYTES,
    Accepted,
    ChunkHeld,
    Commit,
    Malformed,
    Manifest,
    Ready,
    Rejected,
    Reply,
    count_of,
    decode,
)
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.mission_reading import read_mission
from stopgo.bridge.robot.pages import address_of, part_page
from stopgo.mission.document import Mission, digest_of
from stopgo.mission.document.problems import problems_of
from stopgo.mission.run.run_commands import Reason

MAX_REASONS = 20
"""Most reasons in the rejection of one mission."""


class Inbox:
    """Receives missions for one controller."""

    def __init__(self, journal: Journal, controller: Controller, profiles: tuple[str, ...] | None) -> None:
        self._journal = journal
        self._controller = controller
        self.profiles = profiles

    def receive(self, request: Request) -> Reply:
        """Answer one question on `…/mission/<id>/<step>`."""
        mission_id, step = address_of(request.key)
        try:
            return self._step(mission_id, step, request)
        except (msgspec.DecodeError, ValueError) as error:
            return Malformed(message=f"{'/'.join(step)}: {error}")
        except sqlite3.DatabaseError as error:
            return _no("storage", f"the journal cannot be written: {error}")

    def _step(self, mission_id: str, step: list[str], request: Request) -> Reply:
        match step:
            case ["begin"]:
                return self._begin(mission_id, decode(request.payload, Manifest))
            case ["chunk", number]:
                return self._chunk(mission_id, count_of(number), request)
            case ["commit"]:
                return self._commit(mission_id, decode(request.payload, Commit))
            case ["part", _]:
                return part_page(self._journal, request)
        return Malformed(message=f"no such step: {'/'.join(step)}")

    def _begin(self, mission_id: str, manifest: Manifest) -> Reply:
        refusal = self._refusal_of(mission_id, manifest)
        if refusal:
            return refusal
        if self._holds(manifest):
            return Ready(held=tuple(range(manifest.chunks)))
        self._journal.missions.drop_unused_chunks()
        shortage = self._journal.space_shortage(manifest.size)
        if shortage:
            return _no("storage", shortage)
        if self._journal.missions.transfer(mission_id) != manifest:
            self._journal.missions.begin_transfer(manifest)
        return Ready(held=self._journal.missions.received_chunks(manifest))

    def _refusal_of(self, mission_id: str, manifest: Manifest) -> Rejected | None:
        if manifest.mission_id != mission_id:
            return _no("wrong_mission", f"the manifest is for mission {manifest.mission_id}")
        if not 0 < manifest.size <= MAX_DOCUMENT_BYTES:
            return _no("too_large", f"{manifest.size} bytes; 1 to {MAX_DOCUMENT_BYTES} are taken")
        if not 1024 <= manifest.chunk_bytes <= MAX_CHUNK_BYTES:
            return _no(
                "too_large", f"chunks of {manifest.chunk_bytes} bytes; 1024 to {MAX_CHUNK_BYTES} are taken"
            )
        return self._outdated(mission_id, manifest)

    def _outdated(self, mission_id: str, manifest: Manifest) -> Rejected | None:
        held = self._journal.missions.newest_manifest(mission_id)
        if held is None or held.revision < manifest.revision:
            return None
        if (held.revision, held.digest) == (manifest.revision, manifest.digest):
            return None
        if held.revision > manifest.revision:
            return _no(
                "older_revision", f"the robot holds revision {held.revision}, newer than {manifest.revision}"
            )
        return _no(
            "revision_taken",
            f"the robot holds revision {held.revision} with digest {held.digest[:12]},"
            f" not {manifest.digest[:12]}; push the change as revision {held.revision + 1}",
        )

    def _holds(self, manifest: Manifest) -> bool:
        """True if this same mission is stored; its bytes may differ in white space."""
        held = self._journal.missions.manifest(manifest.mission_id, manifest.revision)
        return held is not None and held.digest == manifest.digest

    def _chunk(self, mission_id: str, number: int, request: Request) -> Reply:
        manifest = self._journal.missions.transfer(mission_id)
        if manifest is None or request.parameters.get("of") != manifest.sha256:
            return _no("incomplete", "no such transfer is open; begin it again")
        if number >= manifest.chunks:
            return _no("incomplete", f"chunk {number}: there are {manifest.chunks}")
        last = manifest.size - manifest.chunk_bytes * (manifest.chunks - 1)
        expected = last if number == manifest.chunks - 1 else manifest.chunk_bytes
        if len(request.payload) != expected:
            return _no("incomplete", f"chunk {number} has {len(request.payload)} bytes, not {expected}")
        shortage = self._journal.space_shortage(len(request.payload))
        if shortage:
            return _no("storage", shortage)
        self._journal.missions.store_chunk(manifest, number, request.payload)
        return ChunkHeld(index=number, sha256=hashlib.sha256(request.payload).hexdigest())

    def _commit(self, mission_id: str, commit: Commit) -> Reply:
        manifest = commit.manifest
        refusal = self._refusal_of(mission_id, manifest)
        if refusal:
            return refusal
        already = self._holds(manifest)
        mission = self._stored(manifest) if already else self._received(manifest)
        if isinstance(mission, Rejected):
            return mission
        refusal = self._controller.take(commit, mission)
        with suppress(sqlite3.DatabaseError):  # a full disk cannot delete: the next commit will
            self._journal.missions.drop_unused_chunks()
        return refusal or Accepted(
            mission_id=mission.id, revision=mission.revision, digest=mission.digest,
            already=already, waits=self._controller.waits(mission),
        )  # fmt: skip

    def _stored(self, manifest: Manifest) -> Mission | Rejected:
        stored = self._journal.missions.read(manifest.mission_id, manifest.revision)
        assert stored is not None
        return self._read(stored[1], manifest)

    def _received(self, manifest: Manifest) -> Mission | Rejected:
        """Return the mission that has arrived, if its chunks are complete and have the right hash."""
        document = b"".join(self._journal.missions.chunks(manifest))
        if len(document) != manifest.size:
            return _no("incomplete", f"{len(document)} of {manifest.size} bytes have arrived")
        if hashlib.sha256(document).hexdigest() != manifest.sha256:
            self._journal.missions.end_transfer(manifest)
            return _no("digest", "what arrived has another sha256 than the manifest; push it again")
        return self._read(document, manifest)

    def _read(self, document: bytes, manifest: Manifest) -> Mission | Rejected:
        # Not mission_json.parse: a tenth of its time, and what it refuses besides (keys given twice) the
        # digest shows, which is of what was read.
        try:
            mission = read_mission(document)
        except msgspec.DecodeError as error:
            return _no("malformed", f"the document: {error}")
        if digest_of(mission) != mission.digest:
            return _no("digest", "the document does not have the digest it claims")
        if (mission.id, mission.revision, mission.digest) != (
            manifest.mission_id, manifest.revision, manifest.digest,
        ):  # fmt: skip
            return _no("digest", "the document's id, revision or digest is not the manifest's")
        wrong = tuple(islice(what_is_wrong(mission, self.profiles), MAX_REASONS))
        return Rejected(reason="infeasible", messages=wrong) if wrong else mission


def what_is_wrong(mission: Mission, profiles: tuple[str, ...] | None) -> Iterator[str]:
    """Yield the reasons why this robot cannot run the mission; none if it can."""
    yield from map(str, problems_of(mission))
    for stop in mission.stops:
        if profiles is not None and stop.scan.profile not in profiles:
            known = ", ".join(profiles)
            yield f"stop {stop.id}: scan profile {stop.scan.profile!r} is unknown; known: {known}"


def _no(reason: Reason, message: str) -> Rejected:
    return Rejected(reason=reason, messages=(message,))
