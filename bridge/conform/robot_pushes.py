"""Requirements on a push: chunks in any order, then the complete mission or nothing."""

from __future__ import annotations

import uuid
from typing import Any

import msgspec

from stopgo.bridge.conform.requirements import NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench
from stopgo.bridge.conform.robot_queries import describe, must_reject, read
from stopgo.bridge.conform.trial_pushes import manifest_of
from stopgo.bridge.link.protocol import (
    MAX_CHUNK_BYTES,
    MAX_DOCUMENT_BYTES,
    Accepted,
    ChunkHeld,
    Manifest,
    Ready,
    encode,
)
from stopgo.mission.document import Mission, with_digest

MANY_STOPS = 10
"""Stops of a mission that needs several of the smallest chunks."""


def _begun(bench: RobotBench) -> tuple[Mission, bytes, Manifest]:
    """Begin the push of a mission, without a chunk; return mission, document and manifest."""
    mission = bench.missions.mission(stops=MANY_STOPS)
    document = msgspec.json.encode(mission)
    manifest = manifest_of(mission, document)
    ready = bench.missions.begin(manifest)
    must(isinstance(ready, Ready), f"begin was answered with {describe(ready)}")
    must(not ready.held, "begin of a new transfer reports chunks that are held")
    must(manifest.chunks > 2, "the trial mission is too small for several chunks")
    return mission, document, manifest


def _send_all(bench: RobotBench, manifest: Manifest, document: bytes, numbers: Any) -> None:
    for number in numbers:
        held = bench.missions.send(manifest, document, number)
        must(isinstance(held, ChunkHeld), f"chunk {number} was answered with {describe(held)}")
        must(held.index == number, f"chunk {number} was answered as chunk {held.index}")


def chunks_come_in_any_order(bench: RobotBench) -> None:
    mission, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, reversed(range(manifest.chunks)))
    reply = bench.missions.commit(manifest)
    must(isinstance(reply, Accepted), f"commit was answered with {describe(reply)}")
    must(
        (reply.revision, reply.digest) == (mission.revision, mission.digest),
        "it names another mission",
    )
    state = bench.wait_for_state("READY").mission_id
    must(state == mission.id, f"after a push the state reports mission {state}")


def chunks_may_come_twice(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    first, again = (bench.missions.send(manifest, document, 0) for _ in range(2))
    must(first == again, "a chunk that came twice got another answer")
    _send_all(bench, manifest, document, range(1, manifest.chunks))
    reply = bench.missions.commit(manifest)
    must(isinstance(reply, Accepted), f"commit was answered with {describe(reply)}")


def begin_reports_held_chunks(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, (0, 2))
    ready = bench.missions.begin(manifest)
    held = ready.held if isinstance(ready, Ready) else describe(ready)
    must(held == (0, 2), f"after chunks 0 and 2 begin reports {held}")


def a_missing_chunk_is_incomplete(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, range(1, manifest.chunks))
    must_reject(bench.missions.commit(manifest), "incomplete")


def chunks_that_do_not_fit_are_rejected(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    size = manifest.chunk_bytes
    must_reject(bench.missions.chunk(manifest, manifest.chunks, document[:size]), "incomplete")
    must_reject(bench.missions.chunk(manifest, 0, document[: size - 1]), "incomplete")
    must_reject(bench.missions.chunk(manifest, 0, document[: size + 1]), "incomplete")
    must_reject(bench.missions.chunk(manifest, 0, bytes(MAX_CHUNK_BYTES + 1)), "incomplete", "too_large")
    stranger = msgspec.structs.replace(manifest, sha256="0" * 64)
    must_reject(bench.missions.chunk(stranger, 0, document[:size]), "incomplete")


def damage_is_found(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    damaged = bytes([document[0] ^ 1]) + document[1:]
    _send_all(bench, manifest, damaged, range(manifest.chunks))
    must_reject(bench.missions.commit(manifest), "digest")


def the_digest_is_verified(bench: RobotBench) -> None:
    mission = bench.missions.mission()
    other = msgspec.structs.replace(mission, name="another name")  # whose digest is the first's
    must_reject(bench.missions.push(mission, document=msgspec.json.encode(other)), "digest")


def a_document_is_read_strictly(bench: RobotBench) -> None:
    mission = bench.missions.mission()
    fields = msgspec.to_builtins(mission)
    for what in ({**fields, "later": 1}, {key: fields[key] for key in fields if key != "stops"}):
        must_reject(bench.missions.push(mission, document=msgspec.json.encode(what)), "malformed")
    must_reject(bench.missions.push(mission, document=b"[" * 2000), "malformed")


def limits_hold(bench: RobotBench) -> None:
    mission = bench.missions.mission()
    document = msgspec.json.encode(mission)
    for details in (
        {"size": 0}, {"size": MAX_DOCUMENT_BYTES + 1}, {"chunk_bytes": 0},
        {"chunk_bytes": MAX_CHUNK_BYTES + 1},
    ):  # fmt: skip
        must_reject(bench.missions.begin(manifest_of(mission, document, **details)), "too_large")


def the_key_names_the_mission(bench: RobotBench) -> None:
    mission = bench.missions.mission()
    manifest = manifest_of(mission, msgspec.json.encode(mission))
    reply = bench.ask(bench.keys.mission(f"{mission.id}-other", "begin"), encode(manifest))
    must_reject(reply, "wrong_mission")


def what_cannot_be_driven_is_infeasible(bench: RobotBench) -> None:
    mission = bench.missions.mission()
    last = mission.stops[-1]
    torn = msgspec.structs.replace(last, approach=((last.x + 3.0, last.y), (last.x, last.y)))
    must_reject(
        bench.missions.push(with_digest(msgspec.structs.replace(mission, stops=(*mission.stops[:-1], torn)))),
        "infeasible",
    )


def unknown_profiles_are_infeasible(bench: RobotBench) -> None:
    if bench.info().profiles is None:
        raise NotTried("the robot takes any scan profile (Info.profiles is null)")
    mission = bench.missions.mission()
    first = mission.stops[0]
    scan = msgspec.structs.replace(first.scan, profile=uuid.uuid4().hex)
    stops = (msgspec.structs.replace(first, scan=scan), *mission.stops[1:])
    must_reject(bench.missions.push(with_digest(msgspec.structs.replace(mission, stops=stops))), "infeasible")


def a_rejection_changes_nothing(bench: RobotBench) -> None:
    held = bench.missions.store(bench.missions.mission())
    wrong = msgspec.structs.replace(bench.missions.mission(), name="another name")
    bench.missions.push(wrong)
    state = bench.info().state
    told = (state.state, state.mission_id, state.revision)
    must(told == ("READY", held.id, held.revision), f"after a rejected push the state is {told}")


def the_same_again_changes_nothing(bench: RobotBench) -> None:
    mission = bench.missions.store(bench.missions.mission())
    reply = bench.missions.push(mission)
    must(isinstance(reply, Accepted) and reply.already, f"the same push again: {describe(reply)}")


def a_revision_is_taken_once(bench: RobotBench) -> None:
    mission = bench.missions.store(bench.missions.mission())
    other = with_digest(msgspec.structs.replace(mission, name="another name"))
    must_reject(bench.missions.begin(manifest_of(other, msgspec.json.encode(other))), "revision_taken")


def an_older_revision_is_refused(bench: RobotBench) -> None:
    older, newer = bench.missions.mission(), bench.missions.mission()
    bench.missions.store(newer)
    must_reject(bench.missions.begin(manifest_of(older, msgspec.json.encode(older))), "older_revision")


def what_is_stored_is_read_back(bench: RobotBench) -> None:
    mission = bench.missions.store(bench.missions.mission())
    document = bench.missions.read_stored(mission.id, mission.revision)
    must(
        read(document, Mission, "what is stored") == mission,
        "the stored mission is not the one sent",
    )


def a_late_commit_is_expired(bench: RobotBench) -> None:
    _, document, manifest = _begun(bench)
    _send_all(bench, manifest, document, range(manifest.chunks))
    must_reject(bench.missions.commit(manifest, not_after_ns=bench.info().clock_ns - 1), "expired")
    must_reject(bench.missions.commit(manifest, boot_id="another-boot"), "expired")


def a_commit_undoes_no_later_one(bench: RobotBench) -> None:
    first = bench.missions.mission()
    document = msgspec.json.encode(first)
    manifest = manifest_of(first, document)
    nonce = uuid.uuid4().hex
    reply = bench.missions.push(first, nonce=nonce)
    must(isinstance(reply, Accepted), f"a push was answered with {describe(reply)}")
    bench.missions.store(bench.missions.mission())
    must_reject(bench.missions.commit(manifest, nonce=nonce), "older_revision", "replayed")
    must(
        bench.info().state.revision != first.revision,
        "an older commit sent again had an effect",
    )


PUSHES: tuple[Requirement[RobotBench], ...] = tuple(
    Requirement("Pushing a mission", text, test)
    for text, test in (
        ("chunks may come in any order", chunks_come_in_any_order),
        ("a chunk may come twice", chunks_may_come_twice),
        ("`begin` reports the chunks that are stored", begin_reports_held_chunks),
        ("a chunk that is missing: `incomplete`", a_missing_chunk_is_incomplete),
        ("chunks of another size, number or transfer are rejected", chunks_that_do_not_fit_are_rejected),
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
