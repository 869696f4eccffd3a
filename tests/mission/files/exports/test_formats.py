"""Properties of every export format."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from stopgo.commands.document_commands import FORMAT_NAMES, export
from stopgo.mission.document import Frame, Mission, digest_of
from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.files import exports
from stopgo.mission.files.exports import FORMATS, exported, format_named
from stopgo.mission.files.exports.format import Format, Supplements
from stopgo.mission.files.exports.waypoints import mapped
from stopgo.mission.frames.transform import Transform
from tests.faults.sizes import some
from tests.mission.files.exports.worlds import MISSIONS, surveyed
from tests.mission.worlds import square_tour

every = pytest.mark.parametrize("name", FORMATS)
FEW = some(list(MISSIONS), every=2)
"""Among them the laboratory, which has every kind of leg and stop, and a frame on a map."""
VARYING = {"dxf"}
"""Hold the time of writing beyond `Supplements.written`."""


@every
def test_a_mission_reads_back_where_it_is_and_stays_as_it_is(name: str, mission: Mission) -> None:
    assert exported(mission, name, Supplements())
    assert digest_of(mission) == mission.digest


@pytest.mark.parametrize("mission", FEW, indirect=True)
@pytest.mark.parametrize("name", sorted(set(FORMATS) - VARYING))
def test_equal_missions_give_equal_bytes(name: str, mission: Mission) -> None:
    assert exported(mission, name, Supplements()) == exported(mission, name, Supplements())


@pytest.mark.parametrize("name", [name for name, form in FORMATS.items() if not form.georeferenced])
def test_a_drawing_in_national_coordinates_keeps_its_millimetres(name: str) -> None:
    made = msgspec.structs.replace(surveyed(), georeference=None)
    assert exported(made, name, Supplements())


@every
def test_without_georeference_it_is_written_or_refused_with_the_remedy(name: str) -> None:
    made = msgspec.structs.replace(square_tour(), georeference=None)
    if not FORMATS[name].georeferenced:
        assert exported(made, name, Supplements())
        return
    with pytest.raises(InputError, match="--origin LAT,LON,ALT,HEADING"):
        exported(made, name, Supplements())


@every
def test_what_reads_back_elsewhere_is_not_kept(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    form = FORMATS[name]

    def shifted(mission: Mission, supplements: Supplements) -> bytes:
        return form.write(moved(mission), supplements)

    def shortened(mission: Mission, supplements: Supplements) -> bytes:
        fewer = msgspec.structs.replace(mission, stops=mission.stops[:1], return_=None)
        return form.write(fewer, supplements)

    for writer in (shifted, shortened):
        broken = Format(form.suffix, form.title, writer, form.read_back, form.tolerance)
        monkeypatch.setitem(exports.FORMATS, name, broken)
        with pytest.raises(StopgoError, match="read"):
            exported(square_tour(), name, Supplements())


def moved(mission: Mission) -> Mission:
    """The mission 2 cm farther to the right."""
    aside = Frame(name=mission.frame.name, to_map=Transform(x=0.02, y=0.0, heading=0.0))
    return msgspec.structs.replace(mapped(msgspec.structs.replace(mission, frame=aside)), frame=mission.frame)


def test_the_suffix_names_the_format() -> None:
    for name, form in FORMATS.items():
        assert format_named(None, Path(f"out/My.Site{form.suffix.upper()}")) == name
        assert format_named(name, Path("anything.txt")) == name


@pytest.mark.parametrize("path", ["site.yaml", "site.json", "site", "site.dwg"])
def test_an_unknown_suffix_lists_the_formats(path: str) -> None:
    with pytest.raises(InputError, match=r"known: \.plan, .*\.vda5050-2\.1\.json \(or name one with --to\)"):
        format_named(None, Path(path))


def test_an_unknown_format_lists_the_formats() -> None:
    with pytest.raises(InputError, match="--to dwg: no such format; known: plan, waypoints, dxf"):
        format_named("dwg", Path("x.dxf"))


def test_the_help_names_every_format() -> None:
    for name, form in FORMATS.items():
        assert form.suffix in (export.__doc__ or "")
        assert name in FORMAT_NAMES.replace(",", "").split()
