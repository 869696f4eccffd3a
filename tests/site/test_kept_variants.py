"""Variants outlive their server: the next one shows the finished ones, and removes what else lies there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stopgo.site.event_feed import EventFeed
from stopgo.site.kept_variants import KeptVariants, kept_variants
from stopgo.site.planning import PlanningRoom
from stopgo.site.planning_work import DRAWING
from stopgo.site.site_folder import SiteFiles

SHOWN = {"number": 3, "state": "done", "request": {"floor": "house.dxf", "options": {"range": "8"}}}


@contextmanager
def server(folder: Path, feed: EventFeed) -> Iterator[tuple[PlanningRoom, KeptVariants]]:
    """The planning room of a server."""
    with kept_variants(folder / "state" / "site.variants") as kept:
        room = PlanningRoom(SiteFiles.at(folder), feed, kept, lambda: None)
        yield room, kept
        room.close()


def test_a_finished_variant_is_shown_by_the_next_server(tmp_path: Path) -> None:
    with server(tmp_path, EventFeed()) as (_, kept):
        for number in (3, 4, 5, 6, 7):
            kept.folder(number).mkdir()
        (kept.folder(3) / DRAWING).write_text('{"stops": []}')
        kept.keep(3, SHOWN)
        kept.keep(4, {**SHOWN, "number": 4, "request": {"floor": 7}})
        (kept.folder(5) / "variant.json").write_bytes(b'{"number": 5')
        unfinished, misnamed = kept.folder(6), kept.folder(7)
        (misnamed / "variant.json").write_text('{"number": 8, "shown": {}}')
    feed = EventFeed()
    with server(tmp_path, feed) as (room, kept):
        assert feed.value("plan", "3") == SHOWN
        assert room.drawing(3) == {"stops": []}
        assert room.variant(3).request.options == {"range": "8"}
        assert [key for key, _ in feed.since(-1)] == [("plan", "3")]
        assert not unfinished.exists()
        assert not misnamed.exists()
        assert next(room._numbers) == 4


def test_two_servers_of_one_folder_have_variants_of_their_own(tmp_path: Path) -> None:
    with server(tmp_path, EventFeed()) as (_, kept):
        kept.folder(1).mkdir()
        with server(tmp_path, EventFeed()) as (_, others):
            assert others.folder(1) != kept.folder(1)
        assert kept.folder(1).exists()


def test_variants_are_temporary_where_no_state_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "state").write_bytes(b"")
    feed = EventFeed()
    with server(tmp_path, feed) as (_, kept):
        place = kept.folder(1).parent
        assert place.exists()
    assert not place.exists()
