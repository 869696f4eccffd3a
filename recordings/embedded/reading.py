"""Read a recording and all data embedded in it: contents, missions, what stops see, runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.run.run_log import RunLog
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.drawing import entities
from stopgo.recordings.embedded.missions import missions_in
from stopgo.recordings.embedded.run_logs import logs_in
from stopgo.recordings.embedded.sight import sights_in
from stopgo.recordings.embedded.values import Values
from stopgo.recordings.rrd.read import Contents, check
from stopgo.recordings.rrd.subprocess_read import fatal_faults


@dataclass(frozen=True, eq=False)
class Recording:
    """Recording that was read to its end."""

    path: Path
    contents: Contents
    values: Values
    missions: tuple[Mission, ...]
    """Revisions of its mission, in ascending order; none in files of older versions."""
    sights: tuple[Sight, ...]
    logs: tuple[RunLog, ...]

    @property
    def mission_id(self) -> str:
        """Id of the mission; it is also the id of its plan's recording, and of a run's until version 0.2."""
        for name in (entities.PROPERTY_RUN, entities.PROPERTY_PLAN):
            found = self.contents.properties.get(name, {}).get("mission_id")
            if found:
                return str(found)
        return self.missions[-1].id if self.missions else self.contents.recording_id


def read_recording(path: Path) -> Recording:
    """Read a plan's or a run's recording.

    Raises
    ------
    InputError
        When the file cannot be read, was not written by stopgo, or contradicts itself.
    """
    ((_, found),) = read_each([path])
    if isinstance(found, InputError):
        raise found
    return found


def read_each(paths: Sequence[Path]) -> Iterator[tuple[Path, Recording | InputError]]:
    """Yield each recording, or the error that prevents reading it; one error does not stop the others."""
    fatal = fatal_faults(paths)
    for path in paths:
        try:
            yield path, InputError(fatal[path]) if path in fatal else _read(path)
        except InputError as error:
            yield path, error


def _read(path: Path) -> Recording:
    values = Values()
    contents = check(path, take=values.take)
    if contents.application != entities.APPLICATION:
        raise InputError(f"{path}: is a recording of {contents.application}, not of {entities.APPLICATION}")
    logs = logs_in(values, contents, path)
    _refuse_former_runs(path, contents, logs)
    return Recording(
        path=path,
        contents=contents,
        values=values,
        missions=missions_in(values, str(path)),
        sights=sights_in(values, str(path)),
        logs=logs,
    )


def _refuse_former_runs(path: Path, contents: Contents, logs: Sequence[RunLog]) -> None:
    """Refuse a recording that has the report of a run, but not its events as values."""
    run = contents.properties.get(entities.PROPERTY_RUN, {}).get("run_id")
    if run is None or logs:
        return
    if entities.RunEntities(str(run)).flat(entities.RUN_REPORT) in contents.rows:
        raise InputError(
            f"{path}: holds run {str(run)[:12]} as pictures only, as stopgo before 0.2 recorded it; "
            "review it with the version that recorded it, or fetch the run with watch --run"
        )
