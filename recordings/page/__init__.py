"""The report of a plan and its runs as one HTML file that needs nothing beside it, to read and to print."""

from __future__ import annotations

from stopgo.recordings.page.sections import body
from stopgo.recordings.page.style import STYLE
from stopgo.recordings.page.subject import ReportSubject
from stopgo.recordings.page.words import shown

HEAD = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{body}
</body>
</html>
"""


def report_html(subject: ReportSubject) -> bytes:
    """The page; the same subject gives the same bytes."""
    return whole_page(subject.title, body(subject))


def whole_page(title: str, content: str) -> bytes:
    """A page around HTML, in the report's style, that may load nothing from anywhere."""
    return HEAD.format(title=shown(title), style=STYLE, body=content).encode()


__all__ = ["ReportSubject", "report_html", "whole_page"]
