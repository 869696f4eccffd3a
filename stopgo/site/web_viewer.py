"""Rerun's web viewer, served to this machine from its own port, which starts when it is first wanted."""

from __future__ import annotations

import subprocess
import threading
from urllib.parse import quote

from stopgo.mission.console.ports import free_port
from stopgo.mission.errors import InputError

HERE = "127.0.0.1"
END_S = 5.0


class WebViewer:
    """The viewer's process; its pages are the same for all recordings."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self.origin = ""
        """Address of its pages; empty while it does not run."""

    def showing(self, recording: str) -> str:
        """Return the address that shows the recording at an address.

        Raises
        ------
        InputError
            If Rerun is not installed.
        """
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                self._start()
        return f"{self.origin}/?url={quote(recording, safe='')}"

    def _start(self) -> None:
        try:
            from stopgo.recordings.rrd.compact import VIEWER
        except ModuleNotFoundError:
            raise InputError('Rerun is not installed; pip install "stopgo[record]"') from None
        if not VIEWER.exists():
            raise InputError(f"there is no Rerun viewer at {VIEWER}; install rerun-sdk again")
        port = free_port()
        self.origin = f"http://{HERE}:{port}"
        # With an address to open it starts no recording server.
        command = [
            str(VIEWER), "--bind", HERE, "--serve-web", "--web-viewer-port", str(port),
            f"{self.origin}/none.rrd",
        ]  # fmt: skip
        self._process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is None:
            return
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
