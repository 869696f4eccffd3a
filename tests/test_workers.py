"""Tests of the workers that run the tests (`tests/workers.py`)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.workers import CAN_COPY

ENVIRONMENT = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
FILES = {
    "test_dies.py": """
        import os, pytest
        @pytest.mark.parametrize("n", range(3))
        def test_dies(n):
            if n == 1:
                os.kill(os.getpid(), 9)
        """,
    "test_tells.py": """
        import warnings, pytest
        def test_prints(capfd, tmp_path):
            print("hello")
            assert capfd.readouterr().out == "hello\\n"
            assert tmp_path.parent.name in ("w0", "w1")
        def test_fails():
            print("said before")
            warnings.warn("careful")
            assert 1 == 2
        @pytest.mark.skip(reason="not here")
        def test_skipped(): ...
        """,
}


@pytest.mark.skipif(not CAN_COPY, reason="one process runs all tests here")
def test_every_test_is_reported_once_also_where_a_worker_dies(tmp_path: Path) -> None:
    for name, text in FILES.items():
        (tmp_path / name).write_text("\n".join(line[8:] for line in text.splitlines()))
    options = ["-p", "tests.workers", "--workers", "2", "-p", "no:cacheprovider", "-ra", "--rootdir"]
    command = [sys.executable, "-m", "pytest", *options, str(tmp_path), str(tmp_path)]
    root = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, env=ENVIRONMENT, check=False)
    assert done.returncode == 1
    assert "2 failed, 3 passed, 1 skipped, 1 warning in" in done.stdout
    for told in ("the worker ended here with -9", "said before", "careful", "assert 1 == 2", "not here"):
        assert told in done.stdout
