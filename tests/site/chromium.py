"""A real browser for tests: Debian's Chromium without a screen, driven by its own protocol."""

from __future__ import annotations

import base64
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import pytest
from websocket import WebSocket, create_connection

WAIT_S = 60.0
"""Last resort of a wait; what is waited for comes much sooner."""
PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_chromium = pytest.mark.skipif(
    PROGRAM is None and not os.environ.get("CI"), reason="no Chromium here; on Debian: apt install chromium"
)


UNTIL = """new Promise((resolve) => {
  const found = () => { try { return CONDITION; } catch { return null; } };
  const done = (value) => { observer.disconnect(); clearInterval(now_and_then); resolve(value); };
  const look = () => { const value = found(); if (value) done(value); };
  const observer = new MutationObserver(look);
  observer.observe(document, { subtree: true, childList: true, attributes: true, characterData: true });
  const now_and_then = setInterval(look, 250);
  setTimeout(() => done(null), 5000);
  look();
})"""
"""Waits in the page: it looks again when the page changes, and now and then for what changes elsewhere."""


class Tab:
    """One tab of a browser."""

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._number = 0
        self.requested: list[str] = []
        """Addresses of all requests of the page."""
        self.problems: list[str] = []
        """What the page's console reports as an error."""
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call the browser, and return its answer."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv())
            if message.get("id") == self._number:
                assert "error" not in message, message
                answer: dict[str, Any] = message["result"]
                return answer
            self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        if message.get("method") == "Network.requestWillBeSent":
            self.requested.append(parameters["request"]["url"])
        elif message.get("method") == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.problems.append(details.get("exception", {}).get("description") or details["text"])
        elif message.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.problems.append(f"{parameters['entry']['text']} {parameters['entry'].get('url', '')}")

    def open(self, address: str) -> None:
        """Open an address in this tab."""
        self.call("Page.navigate", url=address)

    def run(self, script: str) -> Any:
        """Return the value of an expression in the page, also of a promise."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, script: str, *, within_s: float = WAIT_S) -> Any:
        """Wait until an expression is true in the page, and return it."""
        deadline = time.monotonic() + within_s
        while time.monotonic() < deadline:
            try:
                value = self.run(UNTIL.replace("CONDITION", script))
            except AssertionError:  # while another page is loaded
                value = None
                time.sleep(0.02)
            if value or value == {}:  # an element has no value of its own
                return value
        text = self.run("document.body.innerText")
        raise AssertionError(f"never true: {script}\n{self.problems}\n{text}")

    def shows(self, text: str, selector: str = "body") -> Any:
        """Wait until a text is on the page."""
        within = f"[...document.querySelectorAll({json.dumps(selector)})]"
        return self.until(f"{within}.some((one) => one.innerText.includes({json.dumps(text)}))")

    def press(self, text: str, selector: str = "button") -> None:
        """Press the button with a text."""
        among, words = json.dumps(selector), json.dumps(text)
        found = f"[...document.querySelectorAll({among})].find((one) => one.innerText.trim() === {words})"
        self.until(f"Boolean({found})")
        self.run(f"{found}.click()")

    def size(self, width: int, height: int, *, dark: bool = False, scale: float = 1.0) -> None:
        """Give the page the size of a device, and its light or dark setting."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale,
            mobile=width < 1000,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def picture(self, path: Path) -> None:
        """Write what the tab shows as a PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self) -> None:
        self.call("Page.close")
        self._socket.close()


class Browser:
    """A browser that is running."""

    def __init__(self, port: int, profile: str) -> None:
        self.profile = profile
        """Folder of its profile, which the command lines of its processes name."""
        self._base = f"http://127.0.0.1:{port}"

    def tab(self, address: str = "about:blank") -> Tab:
        """Open a new tab."""
        made = json.loads(urlopen(Request(f"{self._base}/json/new?about:blank", method="PUT")).read())
        socket = create_connection(made["webSocketDebuggerUrl"], suppress_origin=True, timeout=WAIT_S)
        tab = Tab(socket)
        tab.open(address)
        return tab


@contextmanager
def browser(language: str = "en") -> Iterator[Browser]:
    """Start a browser with a profile of its own, until the block ends."""
    assert PROGRAM is not None, "Chromium is missing: .ci/run installs it"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [PROGRAM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
             "--remote-debugging-port=0", f"--user-data-dir={profile}", "--no-first-run",
             "--disable-background-networking", "--disable-component-update", f"--lang={language}",
             f"--accept-lang={language}", "--font-render-hinting=none", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        try:
            port = _port(Path(profile) / "DevToolsActivePort", lambda: process.poll() is None)
            yield Browser(port, profile)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _port(file: Path, alive: Callable[[], bool]) -> int:
    deadline = time.monotonic() + WAIT_S
    while time.monotonic() < deadline and alive():
        if file.exists() and (lines := file.read_text().splitlines()):
            return int(lines[0])
        time.sleep(0.02)
    raise AssertionError("Chromium did not start")
