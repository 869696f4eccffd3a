"""Pictures of every view of recordings, made by a Rerun viewer without a window, on loopback."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rerun.experimental import ViewerClient

from stopgo.mission.console.ports import free_port
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.file_name import file_name
from stopgo.recordings.drawing import entities
from stopgo.recordings.rrd.compact import VIEWER

PATIENCE_S = 120.0
"""Limit of waiting, in real time."""
REDRAW_S = 0.3
"""Pause before a picture: the viewer does not report when it has drawn."""
SIZE = "1600x1000"
DRIVERS = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d")
"""Folders in which Vulkan's loader searches for drivers."""

Blueprint = Mapping[str, Any]
"""Layout of a viewer: components at each of its paths."""


def write_pictures(recordings: Sequence[Path], folder: Path) -> list[Path]:
    """Write a PNG of each view of the recording in the files, at its newest moment.

    Raises
    ------
    InputError
        When there is no viewer, no graphics driver, or no room in `folder`.
    """
    must_be_drawable()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot create this folder ({error.strerror}); name another") from None
    with viewer(recordings) as client, TemporaryDirectory() as temporary:
        wait_until(lambda: bool(_outermost(client)))
        return [
            _write(folder / f"{number:02}-{file_name(_file_words(name))}.png", picture)
            for number, (name, picture) in enumerate(_pictures(client, Path(temporary)), start=1)
        ]


def must_be_drawable() -> None:
    """Refuse where no pictures can be drawn.

    Raises
    ------
    InputError
        If there is no viewer, or no driver that draws without a screen.
    """
    if not VIEWER.exists():
        raise InputError(f"--png: there is no Rerun viewer at {VIEWER}; install rerun-sdk again")
    if not has_vulkan():
        raise InputError(
            "--png: no Vulkan driver, neither for a graphics card nor in software; install one, such as "
            "Debian's mesa-vulkan-drivers"
        )


def has_vulkan() -> bool:
    """True if a Vulkan driver is installed; outside Linux, the system has what the viewer needs."""
    named = os.environ.get("VK_ICD_FILENAMES") or os.environ.get("VK_DRIVER_FILES")
    elsewhere = not sys.platform.startswith("linux")
    return elsewhere or bool(named) or any(list(Path(root).glob("*.json")) for root in DRIVERS)


@contextmanager
def viewer(files: Sequence[Path | str], *, size: str = SIZE) -> Iterator[ViewerClient]:
    """Open a viewer on the files, or on `--connect ADDRESS`; it ends with the block.

    It shows one recording at a time: files with several recording ids are not joined.
    """
    port = free_port()
    command = [str(VIEWER), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", size, *map(str, files)]
    process = subprocess.Popen(
        command,
        start_new_session=True,
        env={**os.environ, "RERUN_APP_ONLY": "true"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        client = _connected(process, port)
        wait_until(lambda: _is_ready(client))
        yield client
    finally:
        process.kill()
        process.wait()


def wait_until(condition: Callable[[], bool]) -> None:
    """Wait until the viewer fulfils a condition.

    Raises
    ------
    InputError
        When it does not become true.
    """
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise InputError(f"the Rerun viewer did not show the recordings within {PATIENCE_S:.0f} s")
        time.sleep(0.05)


def take_picture(client: ViewerClient, view: str, path: Path) -> None:
    """Write a PNG of one view; a viewer that is too busy to draw at once is asked again.

    Raises
    ------
    InputError
        When the viewer does not draw it.
    """

    def is_taken() -> bool:
        try:
            client.save_screenshot(str(path), view)
        except TimeoutError:  # the limit of the viewer, too short on a loaded machine
            return False
        return True

    wait_until(is_taken)


def container(parts: Blueprint, path: str) -> dict[str, Any]:
    """Return the part of a layout about tabs, a row, a column or a grid; empty for other parts."""
    found: dict[str, Any] = parts.get(path, {}).get("ContainerBlueprint", {})
    return found


def view_name(parts: Blueprint, path: str) -> str | None:
    """Return the name of a view in a layout; None for other parts."""
    found: str | None = parts.get(path, {}).get("ViewBlueprint", {}).get("display_name")
    return found


def outermost(parts: Blueprint) -> str | None:
    """Return the container that is in no other."""
    inner = {part for path in parts for part in container(parts, path).get("contents", ())}
    return next((path for path in parts if container(parts, path) and path.strip("/") not in inner), None)


def _outermost(client: ViewerClient) -> str | None:
    return outermost(client.get_blueprint().blueprint)


Front = tuple[tuple[str, str], ...]
"""Tabs, and the part of each that is in front."""


def _pictures(client: ViewerClient, folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield each view's name, and its picture."""
    parts = client.get_blueprint().blueprint
    shown: Front = ()
    for part, front in _leaves(parts, str(outermost(parts)).strip("/")):
        if front != shown:
            for tabs, active in front:
                container(parts, tabs)["active_tab"] = active
            client.set_blueprint(parts, of="recording")
            time.sleep(REDRAW_S)
            shown = front
        name = view_name(parts, f"/{part}") or "view"
        _go_to_the_end(client, name)
        path = folder / "view.png"
        take_picture(client, part.partition("/")[2], path)
        yield name, path.read_bytes()


def _go_to_the_end(client: ViewerClient, name: str) -> None:
    """Show the newest moment of the timeline in the view's name, else of the mission's timeline."""
    timeline_in_name = re.search(r"\(timeline: (\w+)\)", name)
    wanted = timeline_in_name[1] if timeline_in_name else entities.MISSION_TIME
    state = client.get_state()
    active = next(item for item in state.recordings if item.store_id == state.active_recording)
    if active.current_timeline != wanted and wanted in {line.name for line in active.timelines}:
        client.set_time(wanted, play_state="following")
        time.sleep(REDRAW_S)


def _leaves(parts: Blueprint, part: str, front: Front = ()) -> Iterator[tuple[str, Front]]:
    """Yield every view in a part of a layout, with the tabs that must be in front to show it."""
    held = container(parts, f"/{part}")
    if not held:
        yield part, front
        return
    for item in held["contents"]:
        tabs = held["container_kind"] == "Tabs"
        yield from _leaves(parts, item, (*front, (f"/{part}", item)) if tabs else front)


def _file_words(name: str) -> str:
    """Return the name of a view without its explanation, as words for a file name."""
    return "-".join(re.findall(r"\w+", name.partition(" (")[0]))


def _write(path: Path, picture: bytes) -> Path:
    write_atomic(path, picture)
    return path


def _connected(process: subprocess.Popen[bytes], port: int) -> ViewerClient:
    deadline = time.monotonic() + PATIENCE_S
    while process.poll() is None and time.monotonic() < deadline:
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.get_state()
        except (ConnectionError, RuntimeError):
            time.sleep(0.05)
        else:
            return client
    ended = "does not answer" if process.poll() is None else f"ended with code {process.returncode}"
    raise InputError(f"the Rerun viewer {ended}; run `rerun --headless` for the reason")


def _is_ready(client: ViewerClient) -> bool:
    state = client.get_state()
    return not state.loading and state.active_recording is not None
