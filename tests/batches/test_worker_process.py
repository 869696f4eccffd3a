"""Tests of a batch's worker processes: how they begin, and how they end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stopgo.batches.engine import LocalEngine, worker_process
from stopgo.mission.console.process import ended_at_once, without_ctrl_c
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


LOADING = """
import os, signal, sys, threading, time
from pathlib import Path
from stopgo.batches import engine

engine.PRELOADED = "slow_to_load"
if __name__ == "__main__":
    with engine.worker_process() as pool:
        beginning = threading.Thread(target=lambda: pool.submit(os.getpid).result())
        beginning.start()
        while not Path(sys.argv[1], "loading").exists():
            time.sleep(0.01)
        forking = int(Path(sys.argv[1], "loading").read_text())
        os.kill(forking, signal.SIGINT)
        Path(sys.argv[1], "go on").touch()
        beginning.join()
"""
SLOW = """
import os, sys, time
from pathlib import Path

here = Path(__file__).parent
Path(here, "new").write_text(str(os.getpid()))
Path(here, "new").rename(here / "loading")
while not Path(here, "go on").exists():
    time.sleep(0.01)
"""


def test_a_ctrl_c_while_the_workers_load_prints_nothing_there(tmp_path: Path) -> None:
    """It reaches all processes of the terminal; a traceback came from the one that forks the workers."""
    (tmp_path / "slow_to_load.py").write_text(SLOW)
    (tmp_path / "batch.py").write_text(LOADING)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "batch.py"), str(tmp_path)],
        env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_batch_that_is_stopped_ends_the_process_that_forks_its_workers() -> None:
    """While it loads it cannot fork; it did later, and the worker printed a traceback after the last line."""
    engine = LocalEngine(1)
    with worker_process() as pool:
        forking = pool.submit(os.getppid).result()
    engine.close(at_once=True)
    wait_until(lambda: has_ended(forking))


def test_an_error_ends_the_processes_of_a_pool_in_their_work() -> None:
    pool = worker_process()
    worker = pool.submit(os.getpid).result()
    with pytest.raises(KeyboardInterrupt), ended_at_once(pool):
        pool.submit(time.sleep, 600)
        raise KeyboardInterrupt
    wait_until(lambda: has_ended(worker))


def test_ctrl_c_is_kept_from_processes_that_begin() -> None:
    with without_ctrl_c():
        begun = subprocess.run([sys.executable, "-c", "import os; os.kill(os.getpid(), 2)"], check=False)
    assert begun.returncode == 0
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def has_ended(process: int) -> bool:
    """True once a process is gone, or waits for its parent to read its exit code."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True
