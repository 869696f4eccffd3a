"""The page's catalogue of messages, its size, and what it does not do."""

from __future__ import annotations

import re
from pathlib import Path

import stopgo.site
from stopgo.mission.run.events import KINDS
from stopgo.mission.run.run_commands import Verb

PAGES = Path(stopgo.site.__file__).parent / "pages"
SOURCES = {path.name: path.read_text(encoding="utf-8") for path in sorted(PAGES.iterdir())}
CODE = "\n".join(text for name, text in SOURCES.items() if name.endswith(".js") and name != "messages.js")
KEY = re.compile(r"(?<=[{,\s])(\w+): \"((?:[^\"\\]|\\.)*)\"")


def catalogue() -> dict[str, dict[str, str]]:
    """The messages of each language."""
    english, german = SOURCES["messages.js"].split("\n  de: {")
    return {"en": dict(KEY.findall(english)), "de": dict(KEY.findall(german))}


def test_every_message_is_in_every_language_with_the_same_values() -> None:
    words = catalogue()
    assert len(words["en"]) > 100
    assert words["en"].keys() == words["de"].keys()
    for key, text in words["en"].items():
        values = set(re.findall(r"\{(\w+)\}", text))
        assert set(re.findall(r"\{(\w+)\}", words["de"][key])) == values, key


def test_every_message_that_the_page_names_exists() -> None:
    known = catalogue()["en"].keys()
    named = set(re.findall(r"\bt\(\"(\w+)\"", CODE))
    assert named - known == set()
    assert {f"event_{kind}" for kind in KINDS if kind != "UnknownKind"} <= known
    assert {f"verb_{verb}" for verb in Verb.__args__} <= known  # type: ignore[attr-defined]


def test_the_page_is_small() -> None:
    assert sum(len(text.encode()) for text in SOURCES.values()) <= 150_000


def test_text_reaches_the_page_as_text_alone() -> None:
    """One function makes elements; none of these makes HTML or code of a text."""
    html = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|DOMParser"
    code = r"\beval\b|new Function|setTimeout\(\""
    assert not re.findall(f"{html}|{code}", CODE)
    assert not re.findall(r"\son\w+=|<style|style=|javascript:", SOURCES["index.html"])


def test_no_request_leaves_the_machine() -> None:
    addresses = {one for text in SOURCES.values() for one in re.findall(r"https?://[\w.-]+", text)}
    assert addresses <= {"http://www.w3.org"}


def test_every_target_is_large_enough() -> None:
    assert "--touch: 2.75rem" in SOURCES["site.css"], "44 px at the browser's own text size"
