"""HTML reports: one self-contained file about a mission, its plan and its runs, to read and to print.

Data flow. `from_recordings.subject_of` (recordings) and `replay_page.page_of` (robots' own logs) collect
everything into one `ReportSubject`. `sections.body` turns the subject into HTML and reads nothing else.
`proof_page` is a second page of the same style, about a simulation of the scans.

- `reviewed`: recordings read together, and each run compared with its plan. No HTML.
- `subject`: `ReportSubject`, the input of the page. What is not known is empty or None.
- `sections`: the page from top to bottom: verdict, numbers, picture, tables, files.
- `floor_picture`: the plan as SVG. `PictureFrame` converts drawing metres to picture units; there, y points
  down.
- `plots`: small curves of a run. `stop_table`: the reasons for each stop.
- `words`: the only functions that make HTML. `style`: colours and CSS.

Invariants:

- The same subject gives the same bytes: no clock, no random number, no order of a set in the page.
- The page loads nothing and runs nothing. Its Content-Security-Policy forbids scripts, images and fonts.
- Every text from outside (names, reasons, file names) goes through `words.shown`, which escapes it. `tag`
  escapes attribute values, but takes its content as HTML.
- Numbers keep a true minus sign (−); a cell with only a number is right-aligned by `words.row`.
- Colour is never the only sign: a missed stop has a cross, lost coverage is thick, unplanned is dashed.
- The length of a line in the picture is in metres of the drawing, but its width is in points.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stopgo.recordings.page.style import STYLE
from stopgo.recordings.page.words import shown

if TYPE_CHECKING:
    from stopgo.recordings.page.subject import ReportSubject

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
    """Return the page; the same subject gives the same bytes."""
    from stopgo.recordings.page.sections import body

    return whole_page(subject.title, body(subject))


def whole_page(title: str, content: str) -> bytes:
    """Return a page around HTML in the report's style; it may load nothing from outside."""
    return HEAD.format(title=shown(title), style=STYLE, body=content).encode()


__all__ = ["report_html", "whole_page"]
