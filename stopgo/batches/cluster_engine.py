"""The engine whose entries are planned by the workers of a dask cluster.

An entry is given to workers that have room for it and the same stopgo. Workers may come and go: new ones
report their version before they get an entry. A scheduler that is started again is waited for.
"""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Iterable
from concurrent.futures import Future
from typing import Any

from stopgo.batches.content import computed_by
from stopgo.batches.work import PlanOutcome, PlanTask, work
from stopgo.mission.console.notice import notice
from stopgo.mission.errors import InputError, OutcomeUnknown

PATIENCE_S = 180.0
"""Time that a scheduler or all its workers may be away."""
ASKED_EACH_S = 5.0
"""Time between two looks at the cluster's workers."""
EACH_WORKER = 2
"""Entries of a worker: one in progress, and one that waits, which tells an adaptive cluster to grow."""


class ClusterEngine:
    """The workers of a dask cluster; all see the store and the floors under the same paths."""

    memory = float("inf")

    def __init__(self, address: str) -> None:
        self._address = address
        _must_answer(address)
        try:
            self._client: Any = _client(address)
        except (OSError, ValueError) as error:
            raise _not_reached(address, error) from None
        self._limits: dict[str, float] = {}
        """Memory of each worker that may plan, bytes."""
        self._refused: set[str] = set()
        self._given: dict[Future[PlanOutcome], list[str]] = {}
        """Workers that may plan an entry in progress."""
        self._asked = 0.0
        problems = self._refresh()
        if not self._limits:
            self._client.close()
            none = f"--scheduler {address}: has no workers; start some with: dask worker {address}"
            raise InputError(problems[0] if problems else none)
        _tell(problems)

    @property
    def slots(self) -> int:
        return max(1, EACH_WORKER * len(self._limits))

    def submit(self, slot: int, task: PlanTask, *, roomiest: bool = False) -> Future[PlanOutcome]:
        self._be_connected()
        needed, most = task.memory, max(self._limits.values())
        able = [address for address, limit in self._limits.items() if limit >= (most if roomiest else needed)]
        able = able or [address for address, limit in self._limits.items() if limit == most]
        future: Future[PlanOutcome] = self._client.get_executor(pure=False, workers=able).submit(work, task)
        self._given[future] = able
        return future

    def renew(self, slot: int) -> bool:
        """Dask itself starts its workers again; False if the scheduler was away."""
        return not self._be_connected()

    def look(self) -> None:
        """Take new workers, and cancel entries whose workers are all gone."""
        if time.monotonic() - self._asked < ASKED_EACH_S or self._client.status != "running":
            return
        _tell(self._refresh())
        for future, able in list(self._given.items()):
            if future.done():
                del self._given[future]
            elif not any(address in self._limits for address in able):
                future.cancel()

    def close(self, *, at_once: bool) -> None:
        for future in self._given if at_once else ():
            future.cancel()
        self._client.close()

    def _be_connected(self) -> bool:
        """Connect again to a scheduler that was away; True if it was.

        Raises
        ------
        OutcomeUnknown
            When the scheduler or its workers stay away.
        """
        if self._client.status == "running" and self._limits:
            return False
        notice(f"--scheduler {self._address}: is offline; waiting for it up to {PATIENCE_S:.0f} s")
        deadline = time.monotonic() + PATIENCE_S
        self._given.clear()
        while not self._reconnected():
            if time.monotonic() > deadline:
                raise OutcomeUnknown(
                    f"--scheduler {self._address}: is offline; call the batch again to continue it"
                )
            time.sleep(1.0)
        notice(f"--scheduler {self._address}: is back with {len(self._limits)} workers")
        return True

    def _reconnected(self) -> bool:
        try:
            if self._client.status != "running":
                _must_answer(self._address)
                self._client.close()
                self._client = _client(self._address)
            _tell(self._refresh())
        except (OSError, ValueError, InputError):
            return False
        return bool(self._limits)

    def _refresh(self) -> list[str]:
        """Note the cluster's workers with their memory; return why new ones are refused."""
        self._asked = time.monotonic()
        found = self._client.scheduler_info(n_workers=-1)["workers"]
        for gone in [address for address in self._limits if address not in found]:
            del self._limits[gone]
        problems: list[str] = []
        known = self._limits.keys() | self._refused
        new = {address: about for address, about in found.items() if address not in known}
        for address, version in self._versions(new).items():
            problem = _problem_of(address, version, new[address].get("nthreads", 1))
            if problem is None:
                self._limits[address] = new[address].get("memory_limit") or float("inf")
            else:
                self._refused.add(address)
                problems.append(problem)
        return problems

    def _versions(self, workers: Iterable[str]) -> dict[str, str]:
        """The workers' versions; without those that have gone, which are asked at the next look."""
        if not workers:
            return {}
        found = self._client.run(computed_by, workers=list(workers), on_error="return")
        without = {address: "none" for address, value in found.items() if isinstance(value, ImportError)}
        return without | {address: value for address, value in found.items() if isinstance(value, str)}


def _tell(problems: Iterable[str]) -> None:
    for problem in problems:
        notice(f"{problem}; it gets no entries")


def _client(address: str) -> Any:
    from distributed import Client

    for name in list(logging.root.manager.loggerDict):
        if name.startswith("distributed"):  # it logs tracebacks of a lost connection
            logging.getLogger(name).setLevel(logging.CRITICAL)
    return Client(address, timeout="10s")


def _problem_of(address: str, version: str, threads: int) -> str | None:
    own = computed_by()
    if version != own:
        return (
            f"{address}: has another stopgo ({version}) than this machine ({own}); install the same on both"
        )
    if threads != 1:
        return f"{address}: has {threads} threads; start it with --nthreads 1"
    return None


def _must_answer(address: str) -> None:
    """Refuse an address at which nothing listens: the library would try for many seconds."""
    host, _, port = address.rpartition("//")[2].rpartition(":")
    if not port.isdecimal():
        raise InputError(f"--scheduler {address}: give an address such as tcp://127.0.0.1:8786")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=10.0).close()
    except (OSError, OverflowError) as error:
        raise _not_reached(address, error) from None


def _not_reached(address: str, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(f"--scheduler {address}: not reached ({reason}); start one with: dask scheduler")
