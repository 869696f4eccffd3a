"""JSON Schema of all messages on the link, generated from the code and shipped as protocol.schema.json.

Regenerate the shipped file with
`python -m tests.bridge.link.protocol_schema > bridge/link/protocol.schema.json`.
"""

from __future__ import annotations

import sys
from typing import Any

import msgspec

from stopgo.bridge.link.protocol import VERSION, Tagged
from stopgo.bridge.link.signatures import SignatureAttachment
from stopgo.mission.run.events import KINDS, AnyEvent, Health, PoseReport, StateReport, UnknownKind
from stopgo.mission.run.run_commands import Answer, RunCommand

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def protocol_schema() -> bytes:
    """Return a definition of each kind of message and event, by its name on the link, as indented JSON.

    Any further field is valid in each of them, and so is an event of a kind that is not known.
    """
    spoken = (
        *Tagged.__subclasses__(),
        RunCommand,
        Answer,
        AnyEvent,
        StateReport,
        PoseReport,
        Health,
        SignatureAttachment,
    )
    _, defs = msgspec.json.schema_components(spoken)
    for spoken_as, of in ((str(RunCommand.__struct_config__.tag), RunCommand), ("Seal", SignatureAttachment)):
        defs[spoken_as] = defs.pop(of.__name__) | {"title": spoken_as}
    defs[UnknownKind.__name__] = _of_any_other_kind(defs[UnknownKind.__name__])
    defs["Event"] = _event()
    defs["LogPage"]["properties"]["events"]["items"] = {"$ref": "#/$defs/Event"}
    head = {"$schema": _DIALECT, "title": f"stopgo messages between station and robot, version {VERSION}"}
    text = msgspec.json.encode({**head, "$defs": defs}, order="deterministic")
    return msgspec.json.format(text, indent=2) + b"\n"


def _event() -> dict[str, Any]:
    kinds = [{"$ref": f"#/$defs/{kind}"} for kind in KINDS]
    return {"title": "Event", "description": "One line of the robot's journal.", "anyOf": kinds}


def _of_any_other_kind(unknown: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of an event of an unknown kind, which has its own name on the link."""
    known = [kind for kind in KINDS if kind != UnknownKind.__name__]
    fields = {name: schema for name, schema in unknown["properties"].items() if name != "kind"}
    fields["event"] = {"type": "string", "not": {"enum": known}}
    required = [name for name in unknown["required"] if name != "kind"]
    return unknown | {"properties": fields, "required": required}


if __name__ == "__main__":
    sys.stdout.buffer.write(protocol_schema())
