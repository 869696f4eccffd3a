"""DXF through ezdxf: its audit, the blocks and layers, and that the drawing underneath stays as it was."""

from __future__ import annotations

import io
import math
import tempfile
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.document import Drawing
from ezdxf.lldxf.encoding import decode_dxf_unicode
from ezdxf.lldxf.tagwriter import TagCollector

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.exports import FORMATS, exported
from stopgo.mission.files.exports.format import FloorDrawing, Supplements
from stopgo.mission.files.exports.stops_dxf import LAYERS
from stopgo.mission.files.exports.stretches import Stretches
from tests.faults.sizes import some
from tests.mission.files.exports.worlds import laboratory, surveyed
from tests.mission.worlds import square_tour

UNITS = {4: 0.001, 5: 0.01, 6: 1.0, 1: 0.0254}
"""$INSUNITS and metres."""
VERSIONS = ("R12", "R2000", "R2004", "R2018")
COVERAGE = Stretches(np.array([[[0.0, 5], [1, 5]]]), np.array([[[1.0, 5], [2, 5]], [[2, 5], [2, 6.0]]]))


def opened(data: bytes) -> Drawing:
    """As ezdxf opens a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "site.dxf"
        path.write_bytes(data)
        return ezdxf.readfile(path)


def floor(unit: float = 1.0, code: int = 6, version: str = "R2010") -> FloorDrawing:
    """A room of 8 × 4 m with a block, in units of so many metres."""
    drawing = ezdxf.new(version)
    drawing.header["$INSUNITS"] = code
    drawing.header["$LTSCALE"] = 25.0
    drawing.layers.add("WALLS", color=7)
    corners = [(x / unit, y / unit) for x, y in [(0, 0), (8, 0), (8, 4), (0, 4), (0, 0)]]
    drawing.modelspace().add_polyline2d(corners, dxfattribs={"layer": "WALLS"})
    chair = drawing.blocks.new("SCAN_STOP")
    chair.add_circle((0, 0), 0.2 / unit)
    drawing.modelspace().add_blockref("SCAN_STOP", (1 / unit, 1 / unit))
    text = io.StringIO()
    drawing.write(text)
    return FloorDrawing(lambda: opened(drawing.encode(text.getvalue())), unit)


def stops_in(drawing: Drawing) -> list[ezdxf.entities.Insert]:
    return [item for item in drawing.modelspace().query("INSERT") if item.dxf.layer == "SCAN_STOPS"]


def told(insert: ezdxf.entities.Insert) -> dict[str, str]:
    return {attribute.dxf.tag: attribute.dxf.text for attribute in insert.attribs}


def test_the_audit_is_clean(mission: Mission) -> None:
    for supplements in (Supplements(), Supplements(floor=floor(), coverage=COVERAGE)):
        auditor = opened(exported(mission, "dxf", supplements)).audit()
        assert not auditor.errors
        assert not auditor.fixes


def test_a_block_per_stop_with_number_id_and_heading(mission: Mission) -> None:
    drawing = opened(exported(mission, "dxf", Supplements()))
    blocks = stops_in(drawing)
    for number, (block, stop) in enumerate(zip(blocks, mission.stops, strict=True), 1):
        assert (block.dxf.insert.x, block.dxf.insert.y) == pytest.approx((stop.x, stop.y))
        turn = math.radians(block.dxf.rotation) - stop.heading
        assert math.remainder(turn, math.tau) == pytest.approx(0.0, abs=1e-9)
        values = told(block)
        assert (values["NUMBER"], values["ID"]) == (str(number), stop.id)
        assert float(values["X_M"]) == pytest.approx(stop.x, abs=5e-4)
        shown = {attribute.dxf.tag for attribute in block.attribs if not attribute.is_invisible}
        assert shown == {"NUMBER", "ID"}


def test_a_polyline_per_leg_and_the_return_dashed() -> None:
    drawing = opened(exported(square_tour(), "dxf", Supplements()))
    lines = drawing.modelspace().query("LWPOLYLINE").filter(lambda line: line.dxf.layer == "SCAN_ROUTE")
    points = [[point[:2] for point in line.get_points()] for line in lines]
    assert points == [[(0, 0), (4, 0)], [(4, 0), (4, 3)], [(4, 3), (0, 0)]]
    assert [line.dxf.linetype for line in lines] == ["BYLAYER", "BYLAYER", "SCAN_BACK"]


@pytest.mark.parametrize(
    ("code", "version"), some([(code, version) for code in UNITS for version in VERSIONS], every=5)
)
def test_layers_lie_on_a_drawing_in_any_unit_and_version(code: int, version: str) -> None:
    unit = UNITS[code]
    supplements = Supplements(floor=floor(unit, code, version), coverage=COVERAGE)
    drawing = opened(exported(laboratory(), "dxf", supplements))
    assert drawing.header["$INSUNITS" if version != "R12" else "$LTSCALE"] == (
        code if version != "R12" else 25.0
    )
    assert drawing.acad_release == version
    first = stops_in(drawing)[0]
    assert first.dxf.insert.x * unit == pytest.approx(3.25)
    circle = next(item for item in first.virtual_entities() if item.dxftype() == "CIRCLE")
    assert circle.dxf.radius * unit == pytest.approx(0.3)
    heights = {attribute.dxf.tag: attribute.dxf.height * unit for attribute in first.attribs}
    assert heights["NUMBER"] == pytest.approx(0.22)
    # Before R2007 a letter that the code page lacks is escaped, which CAD programs undo and ezdxf does not.
    assert decode_dxf_unicode(told(stops_in(drawing)[2])["ID"]) == "Büro 東/3"


def test_coverage_has_two_layers() -> None:
    drawing = opened(exported(square_tour(), "dxf", Supplements(coverage=COVERAGE)))
    lines = [(line.dxf.layer, line.dxf.start.vec2, line.dxf.end.vec2) for line in drawing.query("LINE")]
    on = [line for line in lines if line[0] != "0"]
    assert [(layer, tuple(a), tuple(b)) for layer, a, b in on] == [
        ("SCAN_COVERAGE", (0, 5), (1, 5)),
        ("SCAN_NOT_SEEN", (1, 5), (2, 5)),
        ("SCAN_NOT_SEEN", (2, 5), (2, 6)),
    ]


def test_lines_of_a_models_elements_carry_their_global_ids() -> None:
    named = Stretches(COVERAGE.seen, COVERAGE.unseen, ("A",), ("A", ""))
    drawing = opened(exported(square_tour(), "dxf", Supplements(floor=floor(), coverage=named)))
    lines = [line for line in drawing.query("LINE") if line.dxf.layer in ("SCAN_COVERAGE", "SCAN_NOT_SEEN")]
    told = [line.get_xdata("IFC")[0].value if line.has_xdata("IFC") else "" for line in lines]
    assert told == ["A", "A", ""]
    assert not drawing.audit().errors


def tags_of(drawing: Drawing) -> dict[str, list[tuple[int, object]]]:
    """All tags of every entity of the model space, by handle."""
    return {
        entity.dxf.handle: [(tag.code, tag.value) for tag in TagCollector.dxftags(entity, drawing.dxfversion)]
        for entity in drawing.modelspace()
    }


def unchanged(before: Drawing, after: Drawing) -> None:
    """Every entity of a drawing is in another with the same tags; whatever is new is on our layers."""
    old, new = tags_of(before), tags_of(after)
    for handle, tags in old.items():
        assert new[handle] == tags
    for handle in set(new) - set(old):
        assert after.entitydb[handle].dxf.layer in LAYERS
    assert {layer.dxf.name for layer in after.layers} == {layer.dxf.name for layer in before.layers} | set(
        LAYERS
    )
    for block in before.blocks:
        if not block.is_any_layout:
            assert len(block) == len(after.blocks.get(block.name))


def test_the_drawing_underneath_stays_as_it_was() -> None:
    under = floor()
    made = opened(exported(laboratory(), "dxf", Supplements(floor=under, coverage=COVERAGE)))
    unchanged(under.open(), made)
    assert {block.dxf.name for block in stops_in(made)} == {"SCAN_STOP_2"}


def test_a_drawing_with_our_layers_is_refused() -> None:
    def draw() -> Drawing:
        drawing = floor().open()
        drawing.layers.add("scan_route")
        return drawing

    with pytest.raises(InputError, match="has a layer SCAN_ROUTE already; rename or delete it"):
        exported(laboratory(), "dxf", Supplements(floor=FloorDrawing(draw, 1.0)))


def test_national_coordinates_keep_their_micrometres() -> None:
    drawing = opened(exported(surveyed(), "dxf", Supplements(floor=floor(0.001, 4))))
    assert stops_in(drawing)[0].dxf.insert.x / 1000 == pytest.approx(412_349.678901, abs=1e-6)


def test_the_notes_say_what_the_layers_do_without(tmp_path: Path) -> None:
    notes = FORMATS["dxf"].notes
    assert [note.partition(":")[0] for note in notes(square_tour(), Supplements())] == [
        "no --floor",
        "no --coverage-file",
    ]
    assert notes(square_tour(), Supplements(floor=floor(), coverage=COVERAGE)) == ()
