"""Lists of a site's folder: what they hold among many files, and what is said of a folder that is gone."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec
import pytest

from stopgo.mission.document import with_digest
from stopgo.mission.errors import InputError
from stopgo.mission.files.mission_json import write
from stopgo.site.site_folder import MOST_FILES, SiteFiles
from tests.bridge.world import corridor


def test_recordings_do_not_push_floors_and_missions_out_of_the_lists(tmp_path: Path) -> None:
    """The first 500 files of any kind were listed, by name."""
    for number in range(MOST_FILES + 1):
        (tmp_path / f"run-{number:04d}.rrd").touch()
    (tmp_path / "storey.dxf").touch()
    (tmp_path / "tower").mkdir()
    write(corridor(), tmp_path / "tower" / "mission.json")
    files = SiteFiles.at(tmp_path)
    assert files.floors() == ["storey.dxf"]
    assert [mission["file"] for mission in files.missions()[0]] == ["tower/mission.json"]


def test_of_too_many_missions_the_newest_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stopgo.site.site_folder.MOST_FILES", 2)
    for age, name in enumerate(("mission-c", "mission-b", "mission-a")):
        made = with_digest(msgspec.structs.replace(corridor(), name=name))
        write(made, tmp_path / f"{name}.json")
        os.utime(tmp_path / f"{name}.json", (1e9 - age, 1e9 - age))
    listed, left = SiteFiles.at(tmp_path).missions()
    assert [mission["name"] for mission in listed] == ["mission-c", "mission-b"]
    assert left == 1, "the page says how many are not in its list"


def test_every_floor_is_listed(tmp_path: Path) -> None:
    """A run's floor is looked for in this list by its digest: one left out would count as missing."""
    for number in range(MOST_FILES + 1):
        (tmp_path / f"floor-{number:04d}.dxf").touch()
    assert len(SiteFiles.at(tmp_path).floors()) == MOST_FILES + 1


def test_a_folder_that_is_gone_is_not_an_empty_one(tmp_path: Path) -> None:
    folder = tmp_path / "site"
    folder.mkdir()
    files = SiteFiles.at(folder)
    folder.rmdir()
    for listed in (files.floors, files.missions):
        with pytest.raises(InputError, match="the site's folder is not there"):
            listed()


def test_a_message_does_not_say_where_the_folder_is(tmp_path: Path) -> None:
    files = SiteFiles.at(tmp_path)
    assert files.plain(f"{tmp_path}: not a folder") == "the site's folder: not a folder"
    assert files.plain(f"{tmp_path}{os.sep}a.rrd: damaged") == "a.rrd: damaged"
    assert files.plain(f"{tmp_path}-old: kept") == f"{tmp_path}-old: kept"


def test_a_floor_whose_name_is_no_text_is_listed_and_refused_with_the_reason(tmp_path: Path) -> None:
    """No answer could hold its name: the page showed no list at all."""
    (tmp_path / os.fsdecode(b"B\xfcro.dxf")).touch()
    (tmp_path / os.fsdecode(b"mission-\xfc.json")).write_text("{}")
    (tmp_path / "hall.dxf").touch()
    files = SiteFiles.at(tmp_path)
    assert files.floors() == ["B\ufffdro.dxf", "hall.dxf"]
    assert files.missions() == ([], 0)
    with pytest.raises(InputError, match="is not UTF-8 text; rename the file or folder"):
        files.file("B\ufffdro.dxf")
