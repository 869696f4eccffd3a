"""Rerun's viewer reaches nothing but its own files and the site's recordings."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest

from stopgo.site.web_viewer import page_handler

SITE = "http://127.0.0.1:26000"


class Files(BaseHTTPRequestHandler):
    """Rerun's server, of two files."""

    def do_GET(self) -> None:
        kind = {"/": "text/html", "/viewer.wasm": "application/wasm"}.get(self.path)
        if kind is None:
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.end_headers()
        self.wfile.write(b"content")


@contextmanager
def served(handler: type[BaseHTTPRequestHandler]) -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


def test_the_browser_may_fetch_nothing_from_elsewhere_for_the_viewer() -> None:
    with served(Files) as behind, served(page_handler(behind, SITE)) as front:
        for path, kind in (("/?url=x", "text/html"), ("/viewer.wasm", "application/wasm")):
            with urlopen(front + path) as answer:
                assert (answer.read(), answer.headers["Content-Type"]) == (b"content", kind)
                policy = answer.headers["Content-Security-Policy"]
        rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
        assert rules["default-src"] == "'self' 'unsafe-inline' blob: data:"
        assert rules["connect-src"] == f"'self' blob: data: {SITE}"
        assert rules["frame-ancestors"] == "'none'"
        with pytest.raises(HTTPError):
            urlopen(f"{front}/nothing")
