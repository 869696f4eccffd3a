"""Web pages of a folder's runs: a list, each mission's report, and Rerun's web viewer.

The server listens on this machine only, and answers only requests addressed to this machine's own name.
So a foreign page in the same browser gets nothing.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote

from stopgo.mission.console.ports import free_port
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.recordings.catalog.merging import layout_of, merge
from stopgo.recordings.catalog.run_index import IndexedRun, RunIndex, index_of, run_cells, stamp_of
from stopgo.recordings.page import report_html, whole_page
from stopgo.recordings.page.from_recordings import subject_of
from stopgo.recordings.page.reviewed import Review, review
from stopgo.recordings.page.words import grid, row, shown, tag
from stopgo.recordings.rrd.compact import VIEWER

HERE = "127.0.0.1"
END_S = 5.0
NAME = "stopgo runs"


MergedFiles = tuple[tuple[str, int, int], ...]
"""Files, with the size and the last change of each."""


@dataclass(frozen=True)
class SentPage:
    """Response to a request."""

    body: bytes
    kind: str = "text/html; charset=utf-8"
    status: HTTPStatus = HTTPStatus.OK


@dataclass
class RunSite:
    """Pages of a folder; each is made on request, from the folder's present content."""

    folder: Path
    viewer: str
    """Address of Rerun's web viewer, such as http://127.0.0.1:9090."""
    merged_folder: Path
    """Folder for merged recordings."""
    address: str = ""
    """Address of these pages."""
    _one_at_a_time: threading.Lock = field(default_factory=threading.Lock)
    _merged: dict[str, MergedFiles] = field(default_factory=dict)
    """Source files of each merged recording."""

    def answer(self, path: str) -> SentPage:
        """Return the page, report or recording at a path."""
        try:
            with self._one_at_a_time:
                return self._answer(path)
        except InputError as error:
            message = str(error)
        except OSError as error:  # for example, a file was just deleted, or the disk is full
            message = f"{error.filename or self.folder}: {error.strerror}"
        return SentPage(whole_page(NAME, tag("p", shown(message))), status=HTTPStatus.CONFLICT)

    def _answer(self, path: str) -> SentPage:
        index = index_of(self.folder)
        if path == "/":
            return SentPage(self._list(index))
        name, _, form = path.removeprefix("/").partition(".")
        files = next((files for mission, files in files_of(index).items() if name_of(mission) == name), None)
        if files is None or form not in ("rrd", "html"):
            return SentPage(b"not found\n", "text/plain", HTTPStatus.NOT_FOUND)
        return self._recording(name, files) if form == "rrd" else self._report(files)

    def _list(self, index: RunIndex) -> bytes:
        missions = files_of(index)
        names = {plan.mission_id: plan.name for _, plan in index.plans()}
        names |= {run.mission_id: run.name for _, run in index.runs()}
        parts = [tag("h1", f"Recordings in {shown(self.folder)}")]
        for mission in missions:
            runs = [run for _, run in index.runs() if run.mission_id == mission]
            parts.append(tag("h2", shown(names[mission])))
            parts.append(tag("p", self._links(mission), f" mission {shown(mission[:12])}"))
            if runs:
                parts.append(grid(COLUMNS, (row(map(shown, _cells(run))) for run in runs)))
        if not missions:
            parts.append(tag("p", "No plan and no run in it."))
        parts += [tag("p", shown(fault)) for fault in index.faults()]
        return whole_page(NAME, "".join(parts))

    def _links(self, mission: str) -> str:
        name = name_of(mission)
        recording = quote(f"{self.address}/{name}.rrd", safe="")
        opened = tag("a", "open in the viewer", href=f"{self.viewer}/?url={recording}", target="_blank")
        return f"{opened} · {tag('a', 'report', href=f'/{name}.html')} ·"

    def _recording(self, name: str, files: Sequence[str]) -> SentPage:
        """Return the mission's plan and runs as one recording; merge again if a file has changed."""
        paths = [self.folder / file for file in files]
        out = self.merged_folder / f"{name}.rrd"
        stamps = tuple((str(path), *stamp_of(path)) for path in paths)
        if self._merged.get(name) != stamps:
            read = [item.recording for item in _read(paths).recordings]
            merge(read, out)
            write_atomic(out, layout_of(read) + out.read_bytes())
            self._merged[name] = stamps
        return SentPage(out.read_bytes(), "application/octet-stream")

    def _report(self, files: Sequence[str]) -> SentPage:
        return SentPage(report_html(subject_of(_read([self.folder / name for name in files]))))


def name_of(mission_id: str) -> str:
    """Return the name of a mission's pages: its id may be any text."""
    return hashlib.sha256(mission_id.encode()).hexdigest()[:32]


def files_of(index: RunIndex) -> dict[str, list[str]]:
    """Return the recordings of each mission, the newest run's mission first; plans before runs."""
    found: dict[str, list[str]] = {run.mission_id: [] for _, run in index.runs()}
    for name, plan in index.plans():
        found.setdefault(plan.mission_id, []).append(name)
    for name, run in index.runs():
        if name not in found[run.mission_id]:
            found[run.mission_id].append(name)
    return found


def _read(paths: Sequence[Path]) -> Review:
    found = review(paths)
    if not found.recordings:
        raise InputError("; ".join(found.faults))
    return found


COLUMNS = ("began (UTC)", "run", "robot", "ended", "stops", "worst mm", "coverage", "acquired")


def _cells(run: IndexedRun) -> tuple[str, ...]:
    cells = run_cells(run)
    return tuple(cells[column] for column in COLUMNS)


class _Server(ThreadingHTTPServer):
    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore a browser that disconnects during an answer."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)  # type: ignore[arg-type]


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD; the base class refuses all other methods."""

    def __init__(self, site: RunSite, *given: object) -> None:
        self._site = site
        super().__init__(*given)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        self._send(with_body=True)

    def do_HEAD(self) -> None:
        self._send(with_body=False)

    def _send(self, *, with_body: bool) -> None:
        address = self._site.address.removeprefix("http://")
        port = address.rpartition(":")[2]
        if self.headers.get("Host") not in (address, f"localhost:{port}"):
            answer = SentPage(b"not here\n", "text/plain", HTTPStatus.FORBIDDEN)
        else:
            answer = self._site.answer(self.path.partition("?")[0])
        self.send_response(answer.status)
        self.send_header("Content-Type", answer.kind)
        self.send_header("Content-Length", str(len(answer.body)))
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Access-Control-Allow-Origin", self._site.viewer)
        self.end_headers()
        if with_body:
            self.wfile.write(answer.body)

    def log_message(self, *arguments: object) -> None:
        """Log nothing: requests of a browser are private."""


@contextmanager
def serving(folder: Path, *, port: int | None = None) -> Iterator[str]:
    """Yield the pages' address; they and the viewer run until the block ends.

    Raises
    ------
    InputError
        When there is no such folder, no viewer, or the port is taken.
    """
    index_of(folder)
    if not VIEWER.exists():
        raise InputError(f"--web: there is no Rerun viewer at {VIEWER}; install rerun-sdk again")
    with TemporaryDirectory(prefix="stopgo-runs-") as merged_folder:
        viewer_port = free_port()
        site = RunSite(folder, f"http://{HERE}:{viewer_port}", Path(merged_folder))
        server = listening(site, free_port() if port is None else port)
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        viewer = _web_viewer(viewer_port, site.address)
        try:
            yield site.address
        finally:
            server.shutdown()
            server.server_close()
            thread.join()
            _end(viewer)


def listening(site: RunSite, port: int) -> ThreadingHTTPServer:
    """Return a server of the pages, not yet started; the site gets its address.

    Raises
    ------
    InputError
        When the port is taken or invalid.
    """
    try:
        server = _Server((HERE, port), partial(_Handler, site))
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or error
        message = f"--port {port}: cannot listen there ({why}); leave it out, or give a free one"
        raise InputError(message) from None
    site.address = f"http://{HERE}:{port}"
    return server


def _web_viewer(port: int, address: str) -> subprocess.Popen[bytes]:
    """Start Rerun's web viewer; with an address to open it starts no recording server."""
    command = [
        str(VIEWER),
        "--bind",
        HERE,
        "--serve-web",
        "--web-viewer-port",
        str(port),
        f"{address}/none.rrd",
    ]
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
