"""Links of README and docs lead somewhere, every page is in the contents, and all is in plain words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.sources import MODULES, ROOT, source_of

pytestmark = pytest.mark.together("sources")

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("benchmarks/*.md")])
GUIDES = [ROOT / "README.md", ROOT / "SECURITY.md", *sorted(ROOT.glob("docs/**/*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(page: Path) -> set[str]:
    """Link targets of a page's headings."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.strip().lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        path, _, anchor = link.partition("#")
        if ":" in path:
            continue
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_every_page_is_in_the_contents_once() -> None:
    _, contents = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")
    pages = (page.relative_to(ROOT / "docs").as_posix() for page in ROOT.glob("docs/**/*.md"))
    assert sorted(re.findall(r"[\w/-]+\.md", contents)) == sorted(pages)


RETIRED = {
    r"tells?|told": "reports, states or prints; given by the user",
    r"beside": "position error at a stop, cross-track error on a path, next to",
    r"anew": "again",
    r"halt(s|ed)?": "standstill, stationary",
    r"tachymeter": "total station",
    r"hangs? together": "is connected",
    r"way out": "remedy",
    r"another make": "third-party",
    r"unasked": "without a request",
    r"further (mission|stops?)": "follow-up mission, more stops",
    r"(is|are|was|were) asked for": "is required, is requested",
    r"but for": "except",
    r"in order to": "to",
    r"under way": "in progress, in flight",
    r"what became of": "outcome",
    r"share of": "fraction of",
    r"no word": "no data",
}
"""Words that the guides and messages do without, and the words for them (glossary of the README)."""
ANY_RETIRED = re.compile(rf"(?<![-\w/.])({'|'.join(RETIRED)})(?![-\w/@])", re.IGNORECASE)

LONGEST = 25
"""Words of a sentence that most people understand at first reading."""
SENTENCE = re.compile(r"(?<=[.!?:;])\s+|\s·\s|\s*\|\s*")


def paragraphs(page: Path) -> Iterator[str]:
    """Text of a page without code: paragraphs, list items and rows of tables."""
    text = re.sub(r"^ *```.*?^ *```", "\n", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"`[^`\n]*`", "CODE", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*|#]|\d+\. ))", text):
        yield " ".join(block.split())


def messages(name: str) -> Iterator[str]:
    """Texts in a module's code that a user may read: constants of several words that are no docstrings."""
    return (text for text in source_of(name).texts if " " in text.strip())


def test_retired_words_are_found_where_they_are_words() -> None:
    assert ANY_RETIRED.findall("It told nobody; plan anew, but for b") != []
    assert ANY_RETIRED.search("--top-up beside@3 retold `tell/x` a.told") is None


def test_guides_use_no_retired_word() -> None:
    found = [
        f"{page.relative_to(ROOT)}: {one[0]!r} in: {text[max(0, one.start() - 50) : one.end() + 50]}"
        for page in GUIDES
        for text in paragraphs(page)
        for one in ANY_RETIRED.finditer(text)
    ]
    assert not found, "\n".join(found)


def test_messages_and_help_use_no_retired_word() -> None:
    found = [
        f"{name}: {one[0]!r} in: {text}"
        for name in MODULES
        for text in messages(name)
        for one in ANY_RETIRED.finditer(text)
    ]
    assert not found, "\n".join(found)


def test_docstrings_use_no_retired_word() -> None:
    found = [
        f"{name}: {one[0]!r} in: {text}"
        for name in MODULES
        for docstring in source_of(name).docstrings
        for text in [re.sub(r"`[^`]*`|^\w+$", "", docstring, flags=re.MULTILINE)]
        for one in ANY_RETIRED.finditer(text)
    ]
    assert not found, "\n".join(found)


def test_sentences_of_the_guides_are_short() -> None:
    found = [
        f"{page.relative_to(ROOT)}: {count} words: {sentence}"
        for page in GUIDES
        for text in paragraphs(page)
        for sentence in SENTENCE.split(text)
        if (count := len(re.findall(r"\S*\w\S*", sentence.replace("CODE", "")))) > LONGEST
    ]
    assert not found, "\n".join(found)
