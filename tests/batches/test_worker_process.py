"""Tests of a batch's worker processes: how they begin, and how they end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from stopgo.batches.engine import worker_process
from tests.waiting import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux")

BATCH = """
import os, time
from stopgo.batches.engine import worker_process
if __name__ == "__main__":
    pool = worker_process()
    print(pool.submit(os.getpid).result(), flush=True)
    pool.submit(time.sleep, 600).result()
"""


def test_a_worker_ends_when_its_batch_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "batch.py"
    script.write_text(BATCH)
    batch = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert batch.stdout is not None
    with batch.stdout:
        worker = Path("/proc", batch.stdout.readline().strip())
        assert worker.exists()
        batch.kill()
        batch.wait()
    wait_until(lambda: has_ended(int(worker.name)))


def test_workers_begin_after_the_process_that_forks_them_was_killed() -> None:
    with worker_process() as pool:
        forking = pool.submit(os.getppid).result()
        os.kill(forking, signal.SIGKILL)
        wait_until(lambda: has_ended(forking))
    with worker_process() as pool:
        assert pool.submit(os.getppid).result() not in (forking, os.getpid())


def has_ended(process: int) -> bool:
    """True once a process is gone, or waits for its parent to read its exit code."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True
