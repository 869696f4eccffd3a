"""A headless Rerun viewer on loopback: opens recordings, goes to a time, and looks at every view of a tab."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import rerun_cli
from rerun.experimental import View, ViewerClient

from recordings import entities
from recordings.layout import blueprint

BINARY = Path(rerun_cli.__file__).with_name("rerun")
PATIENCE_S = 15.0


def has_vulkan() -> bool:
    """Whether any Vulkan driver is installed, in the places its loader looks."""
    roots = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
    named = os.environ.get("VK_ICD_FILENAMES") or os.environ.get("VK_DRIVER_FILES")
    return bool(named) or any(list(Path(root).glob("*.json")) for root in roots)


@contextmanager
def viewer(files: Sequence[Path], *, tab: int, size: str = "1600x1000") -> Iterator[ViewerClient]:
    """A viewer that opened the files with this tab in front; its process group ends with the block.

    The files are given on the command line, as a person would: opened later they would not be merged.
    """
    layout = files[0].with_suffix(f".tab{tab}.rbl")
    blueprint(tab=tab).save(entities.APPLICATION, layout)
    port = _free_port()
    command = [str(BINARY), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", size, *(str(path) for path in (*files, layout))]
    process = subprocess.Popen(
        command,
        start_new_session=True,
        env={**os.environ, "RERUN_APP_ONLY": "true"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        client = _connected(port)
        _wait(lambda: _settled(client))
        yield client
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def look(client: ViewerClient, into: Path) -> dict[str, tuple[View, Path]]:
    """A picture of every view that is in front, by the view's name."""
    pictures = {}
    for view in client.get_state().views:
        picture = into / f"{view.view_id}.png"
        try:
            client.save_screenshot(str(picture), view.view_id)
        except ConnectionError:  # a view of another tab
            continue
        pictures[view.name] = (view, picture)
    reports = {view.name: view for view in client.get_state().views}
    return {name: (reports[name], picture) for name, (_, picture) in pictures.items()}


def _connected(port: int) -> ViewerClient:
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.get_state()
        except (ConnectionError, RuntimeError):
            assert time.monotonic() < deadline, "the viewer did not start in time"
            time.sleep(0.05)
        else:
            return client


def _settled(client: ViewerClient) -> bool:
    state = client.get_state()
    return not state.loading and state.active_recording is not None


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "the viewer did not answer in time"
        time.sleep(0.05)
