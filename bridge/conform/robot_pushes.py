"""How a robot must take a mission: piece by piece in any order, and then whole or not at all."""

from __future__ import annotations

import uuid
from typing import Any

import msgspec

from stopgo.bridge.conform.requirements import NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench, manifest_of, read, rejects, told_of
from stopgo.bridge.link.protocol import (
    MAX_CHUNK_BYTES,
    MAX_DOCUMENT_BYTES,
    Accepted,
    ChunkHeld,
    Manifest,
    Ready,
    encode,
)
from stopgo.mission.document import Mission, sealed

STOPS_IN_PIECES = 10
"""Whose mission has several of the smallest pieces."""


def _begun(bench: RobotBench) -> tuple[Mission, bytes, Manifest]:
    """A mission that is announced, and of which nothing has been sent."""
    mission = bench.mission(stops=STOPS_IN_PIECES)
    document = msgspec.json.encode(mission)
    manifest = manifest_of(mission, document)
    ready = bench.begin(manifest)
    must(isinstance(ready, Ready), f"begin was answered with {told_of(ready)}")
    must(not ready.held, "begin of what was never sent tells of chunks that are held")
    must(manifest.chunks > 2, "the trial mission is too small to come in pieces")
    return mission, document, manifest


def _send_all(bench: RobotBench, manifest: Manifest, document: bytes, numbers: Any) -> None:
    for number in numbers:
        held = bench.send(manifest, document, number)
        must(isinstance(held, ChunkHeld), f"chunk {number} was answered with {told_of(held)}")
        must(held.index == number, f"chunk {number} was answered as chunk {held.index}")


def pieces_come_in_any_order(bench: RobotBench) -> None:
    mission, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, reversed(range(manifest.chunks)))
    reply = bench.commit(manifest)
    must(isinstance(reply, Accepted), f"commit was answered with {told_of(reply)}")
    must((reply.revision, reply.digest) == (mission.revision, mission.digest), "another mission is told of")
    state = bench.wait_for_state("READY").mission_id
    must(state == mission.id, f"after a push the state tells of mission {state}")


def pieces_may_come_twice(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    first, again = (bench.send(manifest, document, 0) for _ in range(2))
    must(first == again, "a chunk that came twice got another answer")
    _send_all(bench, manifest, document, range(1, manifest.chunks))
    reply = bench.commit(manifest)
    must(isinstance(reply, Accepted), f"commit was answered with {told_of(reply)}")


def begin_tells_what_is_held(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, (0, 2))
    ready = bench.begin(manifest)
    held = ready.held if isinstance(ready, Ready) else told_of(ready)
    must(held == (0, 2), f"after chunks 0 and 2 begin tells {held}")


def a_missing_piece_is_told(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, range(1, manifest.chunks))
    rejects(bench.commit(manifest), "incomplete")


def pieces_that_do_not_fit_are_rejected(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    size = manifest.chunk_bytes
    rejects(bench.chunk(manifest, manifest.chunks, document[:size]), "incomplete")
    rejects(bench.chunk(manifest, 0, document[: size - 1]), "incomplete")
    rejects(bench.chunk(manifest, 0, document[: size + 1]), "incomplete")
    rejects(bench.chunk(manifest, 0, bytes(MAX_CHUNK_BYTES + 1)), "incomplete", "too_large")
    stranger = msgspec.structs.replace(manifest, sha256="0" * 64)
    rejects(bench.chunk(stranger, 0, document[:size]), "incomplete")


def damage_is_found(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    damaged = bytes([document[0] ^ 1]) + document[1:]
    _send_all(bench, manifest, damaged, range(manifest.chunks))
    rejects(bench.commit(manifest), "digest")


def the_digest_is_verified(bench: RobotBench) -> None:
    mission = bench.mission()
    other = msgspec.structs.replace(mission, name="another name")  # whose digest is the first's
    rejects(bench.push(mission, document=msgspec.json.encode(other)), "digest")


def a_document_is_read_strictly(bench: RobotBench) -> None:
    mission = bench.mission()
    fields = msgspec.to_builtins(mission)
    for what in ({**fields, "later": 1}, {key: fields[key] for key in fields if key != "stops"}):
        rejects(bench.push(mission, document=msgspec.json.encode(what)), "malformed")
    rejects(bench.push(mission, document=b"[" * 2000), "malformed")


def limits_hold(bench: RobotBench) -> None:
    mission = bench.mission()
    document = msgspec.json.encode(mission)
    for details in (
        {"size": 0}, {"size": MAX_DOCUMENT_BYTES + 1}, {"chunk_bytes": 0},
        {"chunk_bytes": MAX_CHUNK_BYTES + 1},
    ):  # fmt: skip
        rejects(bench.begin(manifest_of(mission, document, **details)), "too_large")


def the_key_names_the_mission(bench: RobotBench) -> None:
    mission = bench.mission()
    manifest = manifest_of(mission, msgspec.json.encode(mission))
    reply = bench.ask(bench.keys.mission(f"{mission.id}-other", "begin"), encode(manifest))
    rejects(reply, "wrong_mission")


def what_cannot_be_driven_is_infeasible(bench: RobotBench) -> None:
    mission = bench.mission()
    last = mission.stops[-1]
    torn = msgspec.structs.replace(last, approach=((last.x + 3.0, last.y), (last.x, last.y)))
    rejects(
        bench.push(sealed(msgspec.structs.replace(mission, stops=(*mission.stops[:-1], torn)))), "infeasible"
    )


def unknown_profiles_are_infeasible(bench: RobotBench) -> None:
    if bench.info().profiles is None:
        raise NotTried("the robot takes any scan profile (Info.profiles is null)")
    mission = bench.mission()
    first = mission.stops[0]
    scan = msgspec.structs.replace(first.scan, profile=uuid.uuid4().hex)
    stops = (msgspec.structs.replace(first, scan=scan), *mission.stops[1:])
    rejects(bench.push(sealed(msgspec.structs.replace(mission, stops=stops))), "infeasible")


def a_rejection_changes_nothing(bench: RobotBench) -> None:
    held = bench.has(bench.mission())
    wrong = msgspec.structs.replace(bench.mission(), name="another name")
    bench.push(wrong)
    state = bench.info().state
    told = (state.state, state.mission_id, state.revision)
    must(told == ("READY", held.id, held.revision), f"after a rejected push the state is {told}")


def the_same_again_changes_nothing(bench: RobotBench) -> None:
    mission = bench.has(bench.mission())
    reply = bench.push(mission)
    must(isinstance(reply, Accepted) and reply.already, f"the same push again: {told_of(reply)}, not already")


def a_revision_is_taken_once(bench: RobotBench) -> None:
    mission = bench.has(bench.mission())
    other = sealed(msgspec.structs.replace(mission, name="another name"))
    rejects(bench.begin(manifest_of(other, msgspec.json.encode(other))), "revision_taken")


def an_older_revision_is_refused(bench: RobotBench) -> None:
    older, newer = bench.mission(), bench.mission()
    bench.has(newer)
    rejects(bench.begin(manifest_of(older, msgspec.json.encode(older))), "older_revision")


def what_is_stored_is_read_back(bench: RobotBench) -> None:
    mission = bench.has(bench.mission())
    document = bench.stored(mission.id, mission.revision)
    must(read(document, Mission, "what is stored") == mission, "another mission comes back than was sent")


def a_late_commit_is_expired(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, range(manifest.chunks))
    rejects(bench.commit(manifest, not_after_ns=bench.info().clock_ns - 1), "expired")
    rejects(bench.commit(manifest, boot_id="another-boot"), "expired")


def a_commit_undoes_no_later_one(bench: RobotBench) -> None:
    first = bench.mission()
    document = msgspec.json.encode(first)
    manifest = manifest_of(first, document)
    nonce = uuid.uuid4().hex
    reply = bench.push(first, nonce=nonce)
    must(isinstance(reply, Accepted), f"a push was answered with {told_of(reply)}")
    bench.has(bench.mission())
    rejects(bench.commit(manifest, nonce=nonce), "older_revision", "replayed")
    must(bench.info().state.revision != first.revision, "an older commit sent again took the mission's place")


PUSHES: tuple[Requirement[RobotBench], ...] = tuple(
    Requirement("Pushing a mission", text, test)
    for text, test in (
        ("chunks may come in any order", pieces_come_in_any_order),
        ("a chunk may come twice", pieces_may_come_twice),
        ("`begin` tells which chunks are held", begin_tells_what_is_held),
        ("a chunk that is missing: `incomplete`", a_missing_piece_is_told),
        ("chunks of another size, number or transfer are rejected", pieces_that_do_not_fit_are_rejected),
        ("a damaged chunk is found at the commit: `digest`", damage_is_found),
        ("the document's own digest is verified: `digest`", the_digest_is_verified),
        ("a document that is no mission: `malformed`", a_document_is_read_strictly),
        ("sizes beyond the limits: `too_large`", limits_hold),
        ("a manifest on another mission's key: `wrong_mission`", the_key_names_the_mission),
        ("an approach that joins nothing: `infeasible`", what_cannot_be_driven_is_infeasible),
        ("a scan profile that is not known: `infeasible`", unknown_profiles_are_infeasible),
        ("what was held before a rejection is unchanged", a_rejection_changes_nothing),
        ("the same mission again: `already`", the_same_again_changes_nothing),
        ("the same revision with another digest: `revision_taken`", a_revision_is_taken_once),
        ("a revision before the stored one: `older_revision`", an_older_revision_is_refused),
        ("what is stored comes back in parts", what_is_stored_is_read_back),
        ("a commit that comes late, or of another boot: `expired`", a_late_commit_is_expired),
        ("a commit that comes again undoes no later one", a_commit_undoes_no_later_one),
    )
)
