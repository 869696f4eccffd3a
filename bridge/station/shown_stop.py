"""The stop that this station showed last of a robot, which outlasts the command that showed it.

A skip without a stop is meant for that one. The robot may have gone on since, or have been sent on by another
operator, and a command typed twice would skip two stops.
"""

from __future__ import annotations

import msgspec

from stopgo.mission.console.state_folder import state_folder
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.file_name import file_name


class ShownStop(msgspec.Struct, frozen=True, kw_only=True):
    """A stop of a run."""

    run_id: str
    stop: str


class ShownStopFile:
    """Memory of the stop that was shown last of one robot or vehicle."""

    def __init__(self, endpoint: str, *names: str | None) -> None:
        """`names` distinguish the robots at one endpoint."""
        name = file_name(" ".join([endpoint, *filter(None, names)]))
        self._path = state_folder() / "shown" / f"{name}.json"
        self._last: ShownStop | None = None

    def read(self) -> ShownStop | None:
        """Return the stop; none if there was none, or nothing could be stored."""
        try:
            return decoded(self._path.read_bytes(), ShownStop)
        except (OSError, msgspec.DecodeError):
            return None

    def remember(self, run_id: str | None, stop: str | None) -> None:
        """Store the stop that is shown; where the folder takes no file, the next skip has no stop of it."""
        if run_id is None or stop is None:
            return
        shown = ShownStop(run_id=run_id, stop=stop)
        before, self._last = self._last or self.read(), shown
        if shown == before:
            return
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(self._path, msgspec.json.encode(shown))
        except (OSError, InputError):
            return
