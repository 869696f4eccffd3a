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
from typing import Any

import rerun_cli
from rerun.experimental import View, ViewerClient

BINARY = Path(rerun_cli.__file__).with_name("rerun")
PATIENCE_S = 120.0
"""Of real time: the last net."""
REDRAW_S = 0.3


def has_vulkan() -> bool:
    """Whether any Vulkan driver is installed, in the places its loader looks."""
    roots = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
    named = os.environ.get("VK_ICD_FILENAMES") or os.environ.get("VK_DRIVER_FILES")
    return bool(named) or any(list(Path(root).glob("*.json")) for root in roots)


@contextmanager
def viewer(files: Sequence[Path | str], *, size: str = "1600x1000") -> Iterator[ViewerClient]:
    """A viewer that opened the files, or follows `--connect ADDRESS`; its processes end with the block.

    The files are given on the command line, as a person would: opened later they would not be merged.
    """
    port = _free_port()
    command = [str(BINARY), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", size, *map(str, files)]
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


def show_tab(client: ViewerClient, name: str) -> set[str]:
    """Bring this part of the outermost tabs to the front; returns the ids of the views to be seen."""
    parts = client.get_blueprint().blueprint
    inner = {part for path in parts for part in _container(parts, path).get("contents", ())}
    tabs = next(path for path in parts if _container(parts, path) and path.strip("/") not in inner)
    for part in _container(parts, tabs)["contents"]:
        if name in (_container(parts, f"/{part}").get("display_name"), _view_name(parts, f"/{part}")):
            _container(parts, tabs)["active_tab"] = part
            client.set_blueprint(parts, of="recording")
            return _views(parts, part)
    raise AssertionError(f"no tab {name}")


def look(client: ViewerClient, tab: str, into: Path) -> dict[str, tuple[View, Path]]:
    """Each view of a tab by its name, with what it reported, and its picture."""
    shown = show_tab(client, tab)
    time.sleep(REDRAW_S)
    pictures = {}
    for view in client.get_state().views:
        if view.view_id in shown:
            pictures[view.view_id] = into / f"{view.view_id}.png"
            client.save_screenshot(str(pictures[view.view_id]), view.view_id)
    views = [view for view in client.get_state().views if view.view_id in shown]
    return {view.name: (view, pictures[view.view_id]) for view in views}


def _container(parts: dict[str, Any], path: str) -> dict[str, Any]:
    return parts.get(path, {}).get("ContainerBlueprint", {})


def _view_name(parts: dict[str, Any], path: str) -> str | None:
    return parts.get(path, {}).get("ViewBlueprint", {}).get("display_name")


def _views(parts: dict[str, Any], part: str) -> set[str]:
    """Ids of the views to be seen in a container: of tabs, only those of the tab in front."""
    kind, _, name = part.partition("/")
    if kind == "view":
        return {name}
    container = _container(parts, f"/{part}")
    inside = [container["active_tab"]] if container["container_kind"] == "Tabs" else container["contents"]
    return set().union(*(_views(parts, item) for item in inside))


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
