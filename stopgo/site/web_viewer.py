"""Rerun's web viewer, served to this machine from its own port, which starts when it is first wanted.

Its pages come from Rerun's own server and pass through here, for a header: the browser may fetch nothing
from elsewhere. By itself the viewer asks for a font, for newer versions, and reports that it is used.
"""

from __future__ import annotations

import subprocess
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.error import URLError
from urllib.parse import quote
from urllib.request import urlopen

from stopgo.mission.console.ports import free_port
from stopgo.mission.errors import InputError

HERE = "127.0.0.1"
START_S, END_S = 20.0, 5.0
POLICY = (
    "default-src 'self' 'unsafe-inline' blob: data:; "
    "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; "
    "connect-src 'self' blob: data: {site}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content-Security-Policy of the viewer: its own files, and recordings of the site."""


class WebViewer:
    """The viewer's processes; its pages are the same for all recordings."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._server: ThreadingHTTPServer | None = None
        self._lock = threading.Lock()
        self.origin = ""
        """Address of its pages; empty while it does not run."""

    def showing(self, recording: str) -> str:
        """Return the address that shows the recording at an address of the site.

        Raises
        ------
        InputError
            If Rerun is not installed, or does not start.
        """
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                self._end()
                self._start(recording.partition("/recordings/")[0])
        return f"{self.origin}/?url={quote(recording, safe='')}"

    def _start(self, site: str) -> None:
        try:
            from stopgo.recordings.rrd.compact import VIEWER
        except ModuleNotFoundError:
            raise InputError('Rerun is not installed; pip install "stopgo[record]"') from None
        if not VIEWER.exists():
            raise InputError(f"there is no Rerun viewer at {VIEWER}; install rerun-sdk again")
        port = free_port()
        behind = f"http://{HERE}:{port}"
        # With an address to open it starts no recording server.
        command = [
            str(VIEWER), "--bind", HERE, "--serve-web", "--web-viewer-port", str(port), f"{behind}/none.rrd",
        ]  # fmt: skip
        self._process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        _await(behind)
        self._server = ThreadingHTTPServer((HERE, 0), page_handler(behind, site))
        self.origin = f"http://{HERE}:{self._server.server_address[1]}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """End the processes."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        server, self._server = self._server, None
        self.origin = ""
        if server is not None:
            server.shutdown()
            server.server_close()
        if process is None:
            return
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _await(address: str) -> None:
    """Wait until a server answers; raises `InputError` if it does not."""
    deadline = time.monotonic() + START_S
    while time.monotonic() < deadline:
        try:
            urlopen(address).close()
        except URLError:
            time.sleep(0.05)
        else:
            return
    raise InputError("Rerun's viewer does not start; open the recording with stopgo review --view")


def page_handler(behind: str, site: str) -> type[BaseHTTPRequestHandler]:
    """Return a handler that serves the files of a server at `behind`; they may read recordings of `site`."""

    class ViewerPages(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            try:
                with urlopen(behind + self.path.partition("?")[0]) as answer:
                    body, kind = answer.read(), answer.headers.get("Content-Type", "text/html")
            except (URLError, ValueError):
                self.send_error(404)
                return
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Content-Security-Policy", POLICY.format(site=site))
            self.send_header("X-Content-Type-Options", "nosniff")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            """Print nothing."""

    return ViewerPages
