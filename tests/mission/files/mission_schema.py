"""The JSON Schema of mission.json, made from the document's types and shipped as mission.schema.json.

Regenerate the shipped file with
`python -m tests.mission.files.mission_schema > mission/mission.schema.json`.
"""

from __future__ import annotations

import sys
from typing import Any

import msgspec

from stopgo.mission.document import VERSION, Mission

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def mission_schema() -> bytes:
    """Return the schema of every mission that `mission_json.parse` accepts, as indented JSON."""
    schema: dict[str, Any] = msgspec.json.schema(Mission)
    # They have defaults in Python; in a file they say what the rest means, so the reader insists.
    schema["$defs"]["Mission"]["required"] = ["schema", "version", *schema["$defs"]["Mission"]["required"]]
    head = {"$schema": _DIALECT, "title": f"stopgo mission, version {VERSION}"}
    text = msgspec.json.encode({**head, **schema}, order="deterministic")
    return msgspec.json.format(text, indent=2) + b"\n"


if __name__ == "__main__":
    sys.stdout.buffer.write(mission_schema())
