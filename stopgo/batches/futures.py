"""Batches from Python: a future for each entry, and a table that grows in a notebook."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

from stopgo.batches.batch_run import Batch, expanded
from stopgo.batches.engine import Engine, Running, engine_for
from stopgo.batches.index_page import entries_table
from stopgo.batches.record import BatchRecord, EntryRecord
from stopgo.batches.store import ResultStore
from stopgo.mission.errors import InputError
from stopgo.result_files import result_folder


@dataclass(frozen=True, eq=False)
class PlannedBatch:
    """A batch that runs in the background."""

    futures: Mapping[str, Future[EntryRecord]]
    """By the entry's name; a future is done when the entry's folder is written."""
    out: Path
    _thread: threading.Thread
    _stopped: threading.Event

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all entries are done; False if `timeout` (s) passes before."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def stop(self) -> None:
        """End the batch after the entries in progress; the others stay for the next call."""
        self._stopped.set()
        self._thread.join()

    def records(self) -> list[EntryRecord]:
        """Return the figures of the entries that are done."""
        return [item.result() for item in self.futures.values() if item.done() and not item.cancelled()]

    def _repr_html_(self) -> str:
        return entries_table(self.records())

    def _ipython_display_(self) -> None:
        """Show the table in a notebook; it grows there with every entry that is done."""
        display = importlib.import_module("IPython.display")
        place = display.display(display.HTML(self._repr_html_()), display_id=True)

        def grow(done: object) -> None:
            place.update(display.HTML(self._repr_html_()))

        for future in self.futures.values():
            future.add_done_callback(grow)


def start_batch(
    file: str | Path,
    out: str | Path,
    *,
    store: str | Path | None = None,
    workers: int = 2,
    scheduler: str | None = None,
) -> PlannedBatch:
    """Begin to plan the entries of a batch's file.

    Raises
    ------
    InputError
        With one line per fault of the file; nothing is planned then.
    """
    folder = result_folder(Path(out))
    kept = ResultStore.at(folder / ".store" if store is None else Path(store)).folder
    found = expanded(Path(file), kept, workers=workers)
    if found.problems:
        raise InputError("\n".join(map(str, found.problems)))
    batch = Batch(Path(file), folder, found.entries, kept, found.left_out)
    engine = engine_for(workers=workers, scheduler=scheduler)
    futures: dict[str, Future[EntryRecord]] = {entry.name: Future() for entry in found.entries}
    stopped = threading.Event()
    thread = threading.Thread(target=_run, args=(batch, engine, futures, stopped), daemon=True)
    thread.start()
    return PlannedBatch(futures, folder, thread, stopped)


def _run(
    batch: Batch, engine: Engine, futures: Mapping[str, Future[EntryRecord]], stopped: threading.Event
) -> None:
    try:
        left = batch.take_kept()
        for record in batch.records():
            futures[record.name].set_result(record)
        running = Running(engine, left)
        for outcome in running.outcomes(stopped.is_set):
            futures[outcome.name].set_result(batch.take(outcome))
        batch.write()
    except Exception as error:  # noqa: BLE001  where the batch's thread ends
        for future in futures.values():
            if not future.done():
                future.set_exception(error)
    finally:
        for future in futures.values():
            future.cancel()
        engine.close(at_once=stopped.is_set())


__all__ = ["BatchRecord", "PlannedBatch", "start_batch"]
