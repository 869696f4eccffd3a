"""Pipes and devices as files that a user names."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from stopgo.mission.console.whole_file import whole_file
from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from tests.called import stopgo

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
LARGE = bytes(range(256)) * 1000
"""More than a pipe holds."""


@pytest.fixture
def pipe(tmp_path: Path) -> Path:
    os.mkfifo(tmp_path / "pipe")
    return tmp_path / "pipe"


READ_TWICE = ("batch", "status")
"""Commands whose file of floors, or roster, is read more than once."""


@pytest.mark.parametrize(
    "command",
    [
        ("show", "PIPE"),
        ("check", "PIPE"),
        ("push", "PIPE", "--robot", "r1"),
        ("export", "PIPE", "-o", "site.csv"),
        ("import", "PIPE", "--from", "csv", "-o", "mission.json"),
        ("align", "PIPE"),
        ("batch", "PIPE", "-o", "plans"),
        ("floors", "office.dxf", "--layers", "PIPE"),
        ("status", "--roster", "PIPE"),
        ("status", "--mavlink", "udpin:127.0.0.1:5599", "--signing-key", "PIPE"),
        ("robot", "--name", "r1", "--state", "state", "--controller", "ros2-zenoh:PIPE"),
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_a_pipe_that_nobody_writes_to_is_refused(command: tuple[str, ...], pipe: Path) -> None:
    """It was waited for without end."""
    done = stopgo(*(word.replace("PIPE", str(pipe)) for word in command))
    assert done.returncode == 2
    why = "is a pipe that nobody writes to, and reading it would never end; name a file"
    if command[0] in READ_TWICE and "--mavlink" not in command:
        why = "is a pipe, which can be read only once; save it as a file"
    assert done.stderr.strip().endswith(f"pipe: {why}")


@pytest.mark.parametrize("name", ["ca.pem", "cert.pem", "revoked.json"])
def test_a_folder_of_keys_holds_no_pipe(name: str, tmp_path: Path) -> None:
    keys = tmp_path / "site-keys"
    assert stopgo("keys", "init", str(keys)).returncode == 0
    assert stopgo("keys", "issue", "station", "alice", "--in", str(keys)).returncode == 0
    own = keys / "alice"
    (own / name).unlink()
    os.mkfifo(own / name)
    done = stopgo("status", "--robot", "r1", "--keys", str(own))
    assert (done.returncode, "is a pipe that nobody writes to" in done.stderr) == (2, True)


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="needs /dev/fd")
def test_a_pipe_is_read_to_its_end() -> None:
    end, begin = os.pipe()
    with open(begin, "wb") as file:
        writing = threading.Thread(target=lambda: (file.write(LARGE), file.close()))
        os.write(begin, b"first ")
        writing.start()
        assert whole_file(Path(f"/dev/fd/{end}")) == b"first " + LARGE
        writing.join()
    os.close(end)


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="needs /dev/fd")
def test_a_writer_that_has_not_written_yet_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a slow program's in `<(command)`."""
    end, begin = os.pipe()
    set_blocking = os.set_blocking

    def written_late(pipe: int, blocking: bool) -> None:
        set_blocking(pipe, blocking)
        os.write(begin, b"late")
        os.close(begin)

    monkeypatch.setattr(os, "set_blocking", written_late)
    assert whole_file(Path(f"/dev/fd/{end}")) == b"late"
    os.close(end)


def test_a_pipe_has_no_digest(pipe: Path) -> None:
    with pytest.raises(InputError, match="is a pipe, which can be read only once; save it as a file"):
        file_digest(pipe)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs /dev/zero")
def test_a_device_is_not_read_without_end() -> None:
    done = stopgo("show", "/dev/zero")
    assert (done.returncode, done.stderr.strip()) == (
        2, "stopgo: /dev/zero: is a device, which may never end; name a file",
    )  # fmt: skip
