"""Addresses, ports and certificates of the site, and what is refused with one line."""

from __future__ import annotations

import socket
import ssl
from pathlib import Path

import pytest

from stopgo.command_line import main
from stopgo.site.server_certificate import own_certificate


@pytest.mark.parametrize(
    ("given", "line"),
    [
        (("--listen", "0.0.0.0"), "--listen 0.0.0.0: names no address; give the one that the others open"),
        (("--listen", "::"), "--listen ::: names no address"),
        (("--listen", "tablet"), "--listen tablet: not an address; give one such as 192.168.1.5"),
        (("--port", "99999"), "--port 99999: cannot listen there"),
        (("--certificate", "c.pem"), "--certificate and --certificate-key belong together; give both"),
        (("--certificate", "c.pem", "--certificate-key", "k.pem"), "c.pem: no such file"),
        (("--connect", "tcp/192.0.2.1:7447"), "leaves this machine without keys"),
        (("--roster", "no.toml"), "no.toml"),
    ],
)
def test_what_cannot_be_served_is_refused_with_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], given: tuple[str, ...], line: str
) -> None:
    assert main(["site", str(tmp_path), *given]) == 2
    told = capsys.readouterr()
    assert line in told.err
    assert told.err.count("\n") == 1
    assert told.out == ""


def test_a_missing_folder_and_a_taken_port_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["site", str(tmp_path / "nowhere")]) == 2
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["site", str(tmp_path), "--port", str(port)]) == 2
    assert f"--port {port}: cannot listen there" in capsys.readouterr().err


def test_an_own_certificate_is_for_its_address_and_is_kept(tmp_path: Path) -> None:
    made = own_certificate(tmp_path / "state", "192.0.2.5")
    assert own_certificate(tmp_path / "state", "192.0.2.5").fingerprint == made.fingerprint
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made.certificate, made.key)
    assert made.key.stat().st_mode & 0o077 == 0
    assert len(made.fingerprint.split(":")) == 32
    (tmp_path / "state" / "certificate.pem").write_bytes(b"damaged")
    assert own_certificate(tmp_path / "state", "192.0.2.5").fingerprint != made.fingerprint


def test_runs_web_names_its_successor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", str(tmp_path), "--web"]) == 2
    assert "the pages are part of stopgo site DIR" in capsys.readouterr().err
