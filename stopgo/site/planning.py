"""Planning from the page: variants of plans, made one after another in processes, kept until they are saved.

A variant is a folder of files outside the site's folder. Saving copies them into `plans/<name>` there, the
mission last, as the next revision of the mission that lies there.
"""

from __future__ import annotations

import itertools
import json
import queue
import shutil
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import msgspec

from stopgo.mission.console.process import without_ctrl_c
from stopgo.mission.document.decoding import converted
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.atomic import replacing
from stopgo.mission.files.file_name import file_name
from stopgo.mission.files.mission_json import next_revision, read
from stopgo.site.event_feed import EventFeed
from stopgo.site.kept_variants import KeptVariant, KeptVariants
from stopgo.site.planning_work import (
    DRAWING,
    CommandTask,
    EditTask,
    ReadTask,
    VariantTask,
    WorkAnswer,
    work_on,
)
from stopgo.site.site_folder import SiteFiles

MOST_VARIANTS = 24
POLL_S = 0.2
FILES = ("plan.rrd", "plan.pdf", "coverage.json", "plan.svg", "mission.json")
"""Files of a plan, in the order in which they appear in the folder."""

WorkTask = ReadTask | VariantTask | CommandTask | EditTask


class VariantRequest(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A plan to make: a floor of the folder, options as people write them, and stops by hand."""

    floor: str
    options: dict[str, str] = {}
    required: tuple[tuple[float, float], ...] = ()
    forbidden: tuple[tuple[float, float, float], ...] = ()
    replaces: str | None = None
    """Mission file of the folder that it will replace."""


class EditRequest(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Stops of a variant that stay, and positions of more."""

    kept: tuple[str, ...]
    added: tuple[tuple[float, float], ...] = ()


@dataclass
class WorkOrder:
    """A task in the queue of a lane, and where its messages go."""

    task: WorkTask
    told: Callable[[WorkAnswer], None]
    done: Callable[[WorkAnswer], None]
    cancelled: threading.Event = field(default_factory=threading.Event)


class WorkLane:
    """One process that works on tasks in turn; a new one is started when a task has ended it."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[WorkOrder | None] = queue.SimpleQueue()
        self._process: Any = None
        self._connection: Any = None
        threading.Thread(target=self._serve, daemon=True).start()

    def begin(self, order: WorkOrder) -> WorkOrder:
        """Put an order into the queue."""
        self._queue.put(order)
        return order

    def answer(self, task: WorkTask) -> WorkAnswer:
        """Return the answer of a task; waits for it."""
        answers: queue.SimpleQueue[WorkAnswer] = queue.SimpleQueue()
        self.begin(WorkOrder(task, lambda message: None, answers.put))
        found = answers.get()
        if "error" in found:
            raise InputError(found["error"])
        return found

    def close(self) -> None:
        """End the lane and its process, whatever it works on."""
        self._queue.put(None)
        self._end_process()

    def _serve(self) -> None:
        while (order := self._queue.get()) is not None:
            order.done({"error": "cancelled"} if order.cancelled.is_set() else self._work(order))

    def _work(self, order: WorkOrder) -> WorkAnswer:
        try:
            connection = self._begin_process()
        except OSError as error:
            why = error.strerror or error
            return {"error": f"no process can be started for it ({why}); close other programs, and try again"}
        try:
            connection.send(order.task)
            while True:
                while not connection.poll(POLL_S):
                    if order.cancelled.is_set():
                        self._end_process()
                        return {"error": "cancelled"}
                message = connection.recv()
                if "done" in message:
                    found: WorkAnswer = message["done"]
                    return found
                order.told(message)
        except (EOFError, OSError):
            self._end_process()
            return {"error": "its process ended (killed, or out of memory); the site goes on"}

    def _begin_process(self) -> Any:
        if self._process is None or not self._process.is_alive():
            context = get_context("spawn")
            self._connection, theirs = context.Pipe()
            with theirs:
                process = context.Process(target=work_on, args=(theirs,), daemon=True)
                with without_ctrl_c():
                    process.start()
            self._process = process
        return self._connection

    def _end_process(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.join()


@dataclass
class PlanVariant:
    """A plan that is made or was made, as pages show it."""

    number: int
    request: VariantRequest
    folder: Path
    order: WorkOrder | None = None
    shown: dict[str, Any] = field(default_factory=dict)


class PlanningRoom:
    """Variants of a site, and the processes that make them."""

    def __init__(
        self, folder: SiteFiles, feed: EventFeed, kept: KeptVariants, saved: Callable[[], None]
    ) -> None:
        self._folder = folder
        self._feed = feed
        self._kept = kept
        self._saved = saved
        self._plans, self.files = WorkLane(), WorkLane()
        self._lock = threading.Lock()
        self._saving = threading.Lock()
        """Held while a variant is saved: of two that two pages save in one place, the second is refused."""
        self._variants: dict[int, PlanVariant] = {}
        for one in kept.finished():
            self._show_again(one)
        self._numbers = itertools.count(1 + max(self._variants, default=0))

    def close(self) -> None:
        self._plans.close()
        self.files.close()

    def _show_again(self, kept: KeptVariant) -> None:
        """Show a variant that an earlier server made."""
        try:
            request = converted(kept.shown.get("request"), VariantRequest)
        except msgspec.ValidationError:  # of another version
            self._kept.remove(kept.number)
            return
        variant = PlanVariant(kept.number, request, self._kept.folder(kept.number), shown=kept.shown)
        self._variants[kept.number] = variant
        self._tell(variant)

    def read(self, floor: str, options: dict[str, str]) -> WorkAnswer:
        """Read a floor of the folder in a process."""
        found = self.files.answer(ReadTask(self._folder.file(floor), options))
        return {**found, "trouble": self._folder.plain(found["trouble"])} if "trouble" in found else found

    def plan(self, request: VariantRequest) -> int:
        """Begin a plan, and return its number.

        Raises
        ------
        InputError
            If the floor or the mission to replace is no file of the folder.
        """
        floor = self._folder.file(request.floor)
        replaces = None if request.replaces is None else self._folder.file(request.replaces)
        with self._lock:
            number = next(self._numbers)
            folder = self._kept.folder(number)
            folder.mkdir()
            variant = self._variants[number] = PlanVariant(number, request, folder)
            self._forget_oldest()
        variant.shown = {
            "number": number, "state": "waiting", "stage": "", "request": msgspec.to_builtins(request)
        }  # fmt: skip
        task = VariantTask(floor, request.options, folder, request.required, request.forbidden, replaces)
        self._tell(variant)
        variant.order = self._plans.begin(
            WorkOrder(
                task, lambda message: self._progress(variant, message), lambda a: self._done(variant, a)
            )
        )
        return number

    def variant(self, number: int) -> PlanVariant:
        """Return a variant; raises `InputError` if it is unknown."""
        found = self._variants.get(number)
        if found is None:
            raise InputError(f"variant {number}: is not kept any more; plan it again")
        return found

    def drawing(self, number: int) -> dict[str, Any]:
        """Return the drawing of a finished variant."""
        try:
            found: dict[str, Any] = json.loads((self.variant(number).folder / DRAWING).read_bytes())
        except OSError:
            raise InputError(f"variant {number}: has no plan") from None
        return found

    def edit(self, number: int, request: EditRequest) -> WorkAnswer:
        """Return what changed stops of a variant cost; nothing is planned.

        Raises
        ------
        InputError
            If the robot does not fit at a position, or the plan is not kept any more.
        """
        return self._plans.answer(EditTask(self.variant(number).folder, request.kept, request.added))

    def cancel(self, number: int) -> None:
        """End the work on a variant."""
        order = self.variant(number).order
        if order is not None:
            order.cancelled.set()

    def save(self, number: int, name: str) -> str:
        """Copy a variant's files to `plans/<name>`, and return the name of its mission file.

        Raises
        ------
        NegativeResult
            If another mission than the one that it replaces lies there.
        """
        variant = self.variant(number)
        if variant.shown["state"] != "done":
            raise InputError(f"variant {number}: has no plan to save")
        with self._saving:
            saved = self._copied(variant, name)
        variant.shown = {**variant.shown, "saved": saved}
        self._kept.keep(number, variant.shown)
        self._tell(variant)
        self._saved()
        return saved

    def _copied(self, variant: PlanVariant, name: str) -> str:
        """Copy a variant's files; return the name of its mission file in the folder."""
        place = self._folder.path(f"plans/{file_name(name)}")
        mission, there = read(variant.folder / "mission.json"), place / "mission.json"
        if next_revision(there, mission) != mission.revision:
            raise NegativeResult(f"plans/{name}: holds another revision of this mission; plan again from it")
        if there.is_file() and read(there).id != mission.id:
            raise NegativeResult(f"plans/{name}: holds another mission; save this one under another name")
        place.mkdir(parents=True, exist_ok=True)
        made = [one for one in FILES if (variant.folder / one).exists()]
        with replacing(*(place / one for one in made)) as paths:
            for one, path in zip(made, paths, strict=True):
                shutil.copyfile(variant.folder / one, path)
        return self._folder.name_of(there)

    def _progress(self, variant: PlanVariant, message: WorkAnswer) -> None:
        variant.shown = {**variant.shown, "state": "running", **message}
        self._tell(variant)

    def _done(self, variant: PlanVariant, answer: WorkAnswer) -> None:
        kept = {key: variant.shown[key] for key in ("number", "request")}
        if "error" in answer:
            state = "cancelled" if answer["error"] == "cancelled" else "failed"
            drawing = variant.shown.get("drawing")
            variant.shown = {
                **kept,
                "state": state,
                "error": self._folder.plain(answer["error"]),
                "drawing": drawing,
            }
        else:
            variant.shown = {**kept, "state": "done", **answer}
            self._kept.keep(variant.number, variant.shown)
        self._tell(variant)

    def _tell(self, variant: PlanVariant) -> None:
        self._feed.tell(("plan", str(variant.number)), variant.shown)

    def _forget_oldest(self) -> None:
        while len(self._variants) > MOST_VARIANTS:
            oldest = self._variants.pop(next(iter(self._variants)))
            if oldest.order is not None:
                oldest.order.cancelled.set()
            self._feed.forget("plan", str(oldest.number))
            self._kept.remove(oldest.number)
