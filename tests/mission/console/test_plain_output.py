"""Output that is not UTF-8: readable, without a traceback, and valid JSON."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tomllib

import pytest

from stopgo.mission.console.plain_output import PlainOutput, plain


@pytest.mark.parametrize(
    ("text", "encoding", "shown"),
    [
        ("331 m², 5° ± 2 …", "ascii", "331 m2, 5 deg +- 2 ..."),
        ("331 m², 5° ± 2 …", "latin-1", "331 m², 5° ± 2 ..."),
        ("Größe ≤ 5 µm → Ärger", "ascii", "Grosse <= 5 um -> Arger"),
        ("屋 Л", "cp1252", "? ?"),
        ("m²", "utf-8", "m²"),
    ],
)
def test_a_character_that_is_lacking_has_a_plain_one(text: str, encoding: str, shown: str) -> None:
    assert plain(text, encoding, escaped=False) == shown


def test_json_stays_the_same_document() -> None:
    document = {"name": "Größe 屋 😀", "path": "a\\b"}
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    PlainOutput(stream, escaped=True).write(json.dumps(document, ensure_ascii=False))
    stream.flush()
    assert json.loads(raw.getvalue()) == document


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-8"])
@pytest.mark.parametrize("arguments", [("conform", "station", "--help"), ()])
def test_a_command_prints_in_any_encoding(encoding: str, arguments: tuple[str, ...]) -> None:
    """Its bytes are of the encoding, and its lines are those of UTF-8."""

    def printed(encoding: str) -> str:
        environment = os.environ | {"PYTHONIOENCODING": encoding, "COLUMNS": "0"}
        command = [sys.executable, "-m", "stopgo", *arguments]
        done = subprocess.run(command, capture_output=True, env=environment, check=True, timeout=120)
        assert done.stderr == b""
        return done.stdout.decode(encoding)

    assert printed(encoding) == plain(printed("utf-8"), encoding, escaped=False)


def test_a_printed_configuration_can_be_read_again() -> None:
    """A shell redirects it to plan.toml, which is read as UTF-8."""
    environment = os.environ | {"PYTHONIOENCODING": "cp1252"}
    command = [sys.executable, "-m", "stopgo", "plan", "--print-config", "--storey", "Größe"]
    done = subprocess.run(command, capture_output=True, env=environment, check=True, timeout=120)
    assert tomllib.loads(done.stdout.decode("utf-8"))["floor"]["storey"] == "Größe"


def test_an_error_prints_in_any_encoding() -> None:
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "stopgo", "show", "Größe.json", "--json"]
    done = subprocess.run(command, capture_output=True, env=environment, check=False, timeout=120)
    assert done.returncode == 2
    assert done.stderr.startswith(b"stopgo: Grosse.json: cannot be read")
    assert json.loads(done.stdout)["error"]["message"].startswith("Größe.json")
