"""Reports of a vehicle's camera that confirm a scan."""

from __future__ import annotations

import hashlib

import pytest

from stopgo.mission.mavlink.captures import read_file_url
from stopgo.mission.run.scans import ScanFailed, ScanResult

SHA = hashlib.sha256(b"scan").hexdigest()
URL = f"scan-1.e57?size=1600&points=100&sha256={SHA}"


@pytest.mark.parametrize("url", [URL, URL.replace(SHA, SHA.upper())])
def test_a_scan_is_the_file_that_is_reported_in_full(url: str) -> None:
    assert read_file_url(url) == ScanResult(file="scan-1.e57", size=1600, points=100, sha256=SHA)


@pytest.mark.parametrize(
    ("url", "missing"),
    [
        ("", "a file name, size, points, sha256"),
        ("scan-1.e57", "size, points, sha256"),
        ("?size=9&points=9&sha256=zz", "a file name, sha256"),
        ("x?size=-1&points=1e9", "a file name, size, points, sha256"),
        ("\ufffd%%", "a file name, size, points, sha256"),
        (URL.replace("size=1600&", ""), "size"),
        (URL.replace("size=1600", "size=0100"), "size"),
        (URL.replace("points=100", "points=0"), "points"),
        (URL.replace("points=100", "points=-3"), "points"),
        (URL[:-1], "sha256"),
        (URL.replace(SHA, "z" * 64), "sha256"),
        (URL.replace("scan-1.e57", ""), "a file name"),
        (URL.replace("scan-1.e57", ".e57"), "a file name"),
        (URL.replace("scan-1.e57", "scan-1.jpg"), "a file name"),
    ],
)
def test_what_lacks_a_piece_is_no_confirmation(url: str, missing: str) -> None:
    read = read_file_url(url)
    assert isinstance(read, ScanFailed)
    assert read.reason.endswith(f"without {missing}")
