"""Result of one check of `stopgo doctor`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Check:
    """Result of a check, and the action to take if something is wrong or missing."""

    name: str
    ok: bool
    result: str
    action: str = ""

    def for_json(self) -> dict[str, Any]:
        """Return the check under the keys of `doctor --json`."""
        return {"name": self.name, "ok": self.ok, "told": self.result, "do": self.action}
