"""Files that are not models, or damaged: one line names the file and the remedy; the rest is read."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import ifcopenshell
import pytest

from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.floors.ifc import extract, loading
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import House, two_rooms

EMPTY = (
    "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
    "FILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"
)


@pytest.fixture
def whole(read: Read, tmp_path: Path) -> str:
    """The text of a sound model; models are read in this process."""
    return two_rooms().write(tmp_path / "whole.ifc").read_text()


def zipped(**files: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name.replace("_", "."), text)
    return out.getvalue()


def lacking(text: str, ifc_class: str, number: int) -> str:
    """The model with `$` for an attribute of the last entity of a class."""
    model = ifcopenshell.file.from_string(text)
    model.by_type(ifc_class)[-1][number] = None
    return model.to_string()


Spoil = Callable[[str], bytes | str]
BAD: dict[str, tuple[str, Spoil, str]] = {
    "text": ("m.ifc", lambda _: "hello", "is not an IFC file (it starts with b'hello'); export it as IFC"),
    "cut off": ("m.ifc", lambda text: text[:-900], "is cut off after"),
    "another schema": (
        "m.ifc",
        lambda text: text.replace("'IFC4'", "'IFC2X_FINAL'"),
        "schema IFC2X_FINAL is not read; export as one of IFC2X3, IFC4, IFC4X3",
    ),
    "no syntax": (
        "m.ifc",
        lambda text: text.replace("DATA;", "DATA;\n#99x=IFCWALL(;;"),
        "cannot be read as IFC (",
    ),
    "no container": (
        "m.ifc",
        lambda text: lacking(text, "IFCRELVOIDSELEMENT", 4),
        "IfcRelVoidsElement has no RelatingBuildingElement); export it again",
    ),
    "no placement": (
        "m.ifc",
        lambda text: lacking(text, "IFCLOCALPLACEMENT", 1),
        "IfcLocalPlacement has no RelativePlacement); export it again",
    ),
    "no items": (
        "m.ifc",
        lambda text: lacking(text, "IFCSHAPEREPRESENTATION", 3),
        "is damaged (#",
    ),
    "no units": ("m.ifc", lambda text: lacking(text, "IFCUNITASSIGNMENT", 0), "has no Units); export it"),
    "nothing in it": ("m.ifc", lambda _: EMPTY, "holds no wall, slab, space or other element with a shape"),
    "a cut zip": ("m.ifczip", lambda text: zipped(m_ifc=text)[:3000], "cannot be unzipped"),
    "a zip of two": ("m.ifczip", lambda text: zipped(a_ifc=text, b_ifc=text), "holds 2 .ifc files"),
    "a zip of none": ("m.ifczip", lambda _: zipped(readme_txt=""), "holds 0 .ifc files"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_read_is_refused_in_one_line(
    name: str, whole: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, spoil, said = BAD[name]
    made = spoil(whole)
    path = tmp_path / file
    path.write_bytes(made if isinstance(made, bytes) else made.encode())
    assert main(["plan", str(path), "-o", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err.strip()
    assert told.startswith(f"stopgo: {path}: ")
    assert said in told
    assert "\n" not in told


def test_a_zipped_model_is_read_as_the_model(whole: str, tmp_path: Path) -> None:
    path = tmp_path / "m.ifczip"
    path.write_bytes(zipped(m_ifc=whole))
    assert read_floor(path, FloorOptions(storey="EG")).area == pytest.approx(8.2 * 4.4)


def test_what_the_schema_does_not_know_is_reported_as_a_warning(whole: str, tmp_path: Path) -> None:
    path = tmp_path / "m.ifc"
    path.write_text(whole.replace("DATA;", "DATA;\n#999999=IFCNOSUCHTHING($);"))
    found = read_floor(path, FloorOptions(storey="EG")).findings
    assert [item.message for item in found if item.code == "damaged_model" and "NOSUCHTHING" in item.message]


def test_a_product_without_a_shape_is_named_and_the_rest_goes_on(read: Read) -> None:
    house = two_rooms()
    column = house.things["column"]
    column.Representation.Representations[0].Items[0].Coordinates.CoordList = [(0.0, 0.0, 0.0)] * 8
    floor = read(house)
    assert not [item for item in floor.elements if item.kind == "columns"]
    (told,) = [item for item in floor.findings if item.code == "no_geometry"]
    assert column.GlobalId in told.message


def test_a_product_without_a_body_is_named(read: Read) -> None:
    """A column was not there, and a room had no name, without a word."""
    house = two_rooms()
    for name in ("column", "right", "door"):
        house.things[name].Representation = None
    floor = read(house)
    told = {item.code: item.message for item in floor.findings}
    assert len(floor.openings) == 1, "its opening shows where the door is"
    assert re.search(
        "1 element has no body in the model and is left out: IfcColumn .* 'column'$", told["no_body"]
    )
    assert re.search("no body in the model: .*: IfcSpace .* 'right'$", told["space_without_body"])


def test_a_product_that_crashes_the_kernel_is_left_out_and_named(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    house = two_rooms()
    guid = house.things["column"].GlobalId
    in_process = loading._run

    def crashing(source: Path, out: Path, rest: list[str]) -> int:
        if guid in rest:
            return in_process(source, out, rest)
        if rest:
            Path(f"{out}.at").write_text(guid)
        return -11

    monkeypatch.setattr(loading, "_run", crashing)
    floor = read(house)
    assert [item.kind for item in floor.elements if item.global_id == guid] == []
    assert [item.message for item in floor.findings if item.code == "kernel_crashed"] == [
        f"IfcColumn {guid} 'column' crashed the geometry kernel"
    ]
    assert not [item for item in floor.findings if item.code == "no_geometry"]


def test_a_model_that_refers_to_itself_is_damaged(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extract, "_shaped_entities", lambda model: [])  # the kernel would crash
    house = two_rooms()
    placement = house.model.by_type("IfcBuildingStorey")[0].ObjectPlacement
    placement.PlacementRelTo = placement
    with pytest.raises(InputError, match=r"is damaged \(what it has refers to itself"):
        read(house)


def test_a_model_that_needs_too_much_memory_is_refused(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "_run", lambda *_: -9)
    with pytest.raises(InputError, match="was killed, probably for lack of memory"):
        read(two_rooms())


def test_a_kept_model_that_is_damaged_is_read_again(read: Read, models: Path) -> None:
    house = two_rooms()
    read(house)
    newest = max(models.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    newest.write_bytes(newest.read_bytes()[:1000])
    assert read(house).area == pytest.approx(8.2 * 4.4)


def test_models_longest_unused_are_forgotten_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    for age, name in enumerate(("new", "used", "old")):
        (tmp_path / f"{name}.npz").write_bytes(b"0" * 100)
        os.utime(tmp_path / f"{name}.npz", (1e9 - age, 1e9 - age))
    monkeypatch.setattr(loading, "MOST_KEPT", 250)
    loading._forget_oldest(tmp_path)
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["new", "used"]


def test_a_storey_without_anything_is_refused(read: Read) -> None:
    house = House()
    house.box("IfcWall", "wall", (0, 0, 0, 6, 0.2, 3), house.storey("EG", 0.0))
    with pytest.raises(InputError, match=r"no floor at 'EG' \(\+0.00 m\): no slab, no rooms, no walls"):
        read(house)
