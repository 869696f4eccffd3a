"""Pushes of trial missions to a robot under test, in single steps and as a whole."""

from __future__ import annotations

import hashlib
import uuid
from typing import Any, Final

import msgspec

from stopgo.bridge.conform.requirements import Nonconforming, must
from stopgo.bridge.conform.robot_queries import MOST_PAGES, RobotQueries, describe, read
from stopgo.bridge.conform.trial_mission import REACH_M, trial_mission
from stopgo.bridge.link.protocol import Accepted, ChunkHeld, Commit, Manifest, MissionPart, Ready, encode
from stopgo.mission.document import Mission

CHUNK_BYTES: Final = 1024
"""Smallest chunks that a robot accepts: a small mission has several of them."""


class TrialPushes:
    """Trial missions of increasing revisions, and the steps of their push."""

    def __init__(self, robot: RobotQueries, *, take_over: bool) -> None:
        self._robot = robot
        self._take_over = take_over
        self._revision = 0
        self.mission_id = f"conform-{uuid.uuid4().hex[:12]}"

    def mission(self, *, stops: int = 2, reach_m: float = REACH_M) -> Mission:
        """Make the next revision of the trial mission, from the robot's present pose."""
        self._revision += 1
        profiles = self._robot.info().profiles
        return trial_mission(
            self.mission_id, self._revision, self._robot.pose(), stops=stops, reach_m=reach_m,
            profile=(profiles or ("default",))[0],
        )  # fmt: skip

    def begin(self, manifest: Manifest) -> Any:
        """Begin a push, and return the answer."""
        return self._robot.ask(self._robot.keys.mission(manifest.mission_id, "begin"), encode(manifest))

    def send(self, manifest: Manifest, document: bytes, number: int) -> Any:
        """Send one chunk of a document, and return the answer."""
        size = manifest.chunk_bytes
        return self.chunk(manifest, number, document[number * size : (number + 1) * size])

    def chunk(self, manifest: Manifest, number: int, data: bytes) -> Any:
        """Send any bytes as a chunk, and return the answer."""
        key = self._robot.keys.mission(manifest.mission_id, f"chunk/{number}")
        return self._robot.ask(key, data, of=manifest.sha256)

    def commit(self, manifest: Manifest, **details: Any) -> Any:
        """Commit the chunks, and return the answer; `details` replace fields of the commit."""
        return self._robot.ask(
            self._robot.keys.mission(manifest.mission_id, "commit"),
            encode(self.commitment(manifest, **details)),
        )

    def commitment(self, manifest: Manifest, **details: Any) -> Commit:
        """Make a commit for the robot's present boot and clock."""
        info = self._robot.info()
        meant: dict[str, Any] = {
            "commander": self._robot.commander, "nonce": uuid.uuid4().hex, "take_over": self._take_over,
            "not_after_ns": info.clock_ns + round(self._robot.timeout_s * 2e9), "boot_id": info.boot_id,
            "fence": info.lease.fence if info.lease else None,
        }  # fmt: skip
        return Commit(manifest=manifest, **(meant | details))

    def push(self, mission: Mission, *, document: bytes = b"", **details: Any) -> Any:
        """Push a mission, and return the last answer: that to the commit, if the chunks were accepted."""
        document = document or msgspec.json.encode(mission)
        manifest = manifest_of(mission, document)
        ready = self.begin(manifest)
        if not isinstance(ready, Ready):
            return ready
        for number in sorted(set(range(manifest.chunks)) - set(ready.held)):
            held = self.send(manifest, document, number)
            must(isinstance(held, ChunkHeld), f"chunk {number} was answered with {describe(held)}")
        return self.commit(manifest, **details)

    def store(self, mission: Mission) -> Mission:
        """Push a mission, which must be accepted, and return it."""
        reply = self.push(mission)
        must(isinstance(reply, Accepted), f"a push was answered with {describe(reply)}")
        return mission

    def read_stored(self, mission_id: str, revision: int) -> bytes:
        """Read the document of a mission that is stored on the robot."""
        document, number = b"", 0
        while number < MOST_PAGES:
            key = self._robot.keys.mission(mission_id, f"part/{number}")
            part = self._robot.ask_for(MissionPart, key, revision=str(revision))
            if not part.data:
                must(
                    len(document) == part.manifest.size, f"{len(document)} of {part.manifest.size} bytes come"
                )
                return document
            document, number = document + part.data, number + 1
        raise Nonconforming("the parts of a mission have no end")

    def stored_mission(self) -> bytes | None:
        """Read the robot's own mission, to restore it later."""
        state = self._robot.info().state
        if state.mission_id is None or state.revision is None:
            return None
        return self.read_stored(state.mission_id, state.revision)

    def restore(self, document: bytes | None) -> None:
        """Push the robot's own mission again."""
        if document is not None:
            mission = read(document, Mission, "the mission that the robot held before")
            reply = self.push(mission, document=document)
            must(isinstance(reply, Accepted), f"the mission that was there before: {describe(reply)}")


def manifest_of(mission: Mission, document: bytes, **details: Any) -> Manifest:
    """Make the manifest of a mission that is sent as `document`; `details` replace its fields."""
    meant: dict[str, Any] = {
        "mission_id": mission.id, "revision": mission.revision, "digest": mission.digest,
        "size": len(document), "sha256": hashlib.sha256(document).hexdigest(), "chunk_bytes": CHUNK_BYTES,
    }  # fmt: skip
    return Manifest(**(meant | details))
