"""A file that cannot be used ends in one line naming it; one that can be mended is read with a finding."""

from __future__ import annotations

import gzip
import hashlib
import io
import os
from pathlib import Path

import pytest
from floor_drawings import codes, new_drawing, rectangle
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stopgo.mission.errors import InputError
from stopgo.planner.floors import read_floor
from tests.faults.sizes import size


def small_floor() -> bytes:
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "FLOOR", 0, 0, 10, 8)
    rectangle(model, "ROOMS", 0, 0, 10, 8)
    model.add_text("hall", dxfattribs={"layer": "ROOMS", "insert": (5, 4)})
    rectangle(model, "WALLS", 4, 0, 4.2, 5)
    model.add_circle((7, 4), 0.2, dxfattribs={"layer": "COLUMNS"})
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue().encode()


WHOLE = small_floor()


def refusal(path: Path, data: bytes | None = None) -> str:
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_floor(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


def test_the_digest_is_that_of_the_bytes(tmp_path: Path) -> None:
    path = tmp_path / "hall.dxf"
    path.write_bytes(WHOLE)
    plan = read_floor(path)
    assert plan.digest == hashlib.sha256(WHOLE).hexdigest()
    assert plan.name == "hall"
    assert plan.findings == ()


def test_the_suffix_may_be_upper_case(tmp_path: Path) -> None:
    path = tmp_path / "HALL.DXF"
    path.write_bytes(WHOLE)
    assert read_floor(path).area == pytest.approx(80)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    assert "no such file" in refusal(tmp_path / "missing.dxf")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs /dev/zero")
def test_a_device_is_not_read_without_end() -> None:
    assert "is a device" in refusal(Path("/dev/zero"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    """It was read for ever, or was "empty" when it was read again."""
    os.mkfifo(tmp_path / "pipe.dxf")
    assert "is a pipe, and a floor is read more than once" in refusal(tmp_path / "pipe.dxf")


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("hall.ifc", gzip.compress(b"ISO-10303-21;"), "is compressed with gzip; unpack it first"),
        ("hall.dxf.gz", gzip.compress(b"  0\nSECTION"), "is compressed with gzip; unpack it first"),
        ("hall.zip", b"PK\x03\x04 a drawing", "is compressed; unpack it first"),
    ],
)
def test_a_compressed_file_says_what_to_do(tmp_path: Path, name: str, data: bytes, says: str) -> None:
    assert says in refusal(tmp_path / name, data)


def test_a_directory_is_named(tmp_path: Path) -> None:
    (tmp_path / "folder.dxf").mkdir()
    assert "is a directory" in refusal(tmp_path / "folder.dxf")


def test_an_unknown_suffix_names_the_known_ones(tmp_path: Path) -> None:
    message = refusal(tmp_path / "floor.docx", b"PK\x03\x04 some other document")
    assert "'.docx'" in message
    assert ".dxf" in message.rpartition("read from")[2]


@pytest.mark.parametrize("data", [b"", b" \r\n\n"])
def test_an_empty_file_is_refused(tmp_path: Path, data: bytes) -> None:
    assert "is empty" in refusal(tmp_path / "empty.dxf", data)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n", "is not a DXF"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "is not a DXF"),
        (b"AC1032\0\0\0\0\0\0", "DWG"),
        (b"AutoCAD Binary DXF\r\n\x1a\x00", "cut off"),
        (b"  0\nSECTION\n  2\nENTITIES\n  0\nENDSEC\n  0\nEOF\n", "no closed outline"),
    ],
)
def test_what_is_no_dxf_is_refused(tmp_path: Path, data: bytes, says: str) -> None:
    assert says in refusal(tmp_path / "other.dxf", data)


def test_a_file_cut_off_in_its_entities_is_refused(tmp_path: Path) -> None:
    """Half a floor must not be planned: the walls that are missing are not seen to be missing."""
    middle = WHOLE.index(b"COLUMNS", WHOLE.rindex(b"ENTITIES"))
    message = refusal(tmp_path / "half.dxf", WHOLE[:middle])
    assert f"cut off after {middle} bytes" in message


def test_a_file_cut_off_after_its_entities_is_read_with_a_finding(tmp_path: Path) -> None:
    end = WHOLE.index(b"ENDSEC", WHOLE.rindex(b"ENTITIES")) + len("ENDSEC\n")
    path = tmp_path / "tail.dxf"
    path.write_bytes(WHOLE[:end])
    plan = read_floor(path)
    assert codes(plan) == ["recovered"]
    assert len(plan.elements) == 2


def test_a_file_cut_off_anywhere_is_refused_or_read_with_a_finding(tmp_path: Path) -> None:
    path = tmp_path / "cut.dxf"
    for length in range(1, len(WHOLE) - 5, 97):
        path.write_bytes(WHOLE[:length])
        try:
            plan = read_floor(path)
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert "recovered" in codes(plan), length


@settings(
    max_examples=size(short=25, full=150),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    at=st.integers(0, len(WHOLE) - 1),
    span=st.integers(0, 40),
    filling=st.binary(max_size=40) | st.sampled_from([b"nan", b"-1e308", b"\n", b"0\nEOF\n", b"\xff\xfe"]),
)
def test_damaged_bytes_never_end_in_a_traceback(tmp_path: Path, at: int, span: int, filling: bytes) -> None:
    path = tmp_path / "damaged.dxf"
    path.write_bytes(WHOLE[:at] + filling + WHOLE[at + span :])
    try:
        plan = read_floor(path)
    except InputError as error:
        str(error).encode()
        assert "\n" not in str(error)
    else:
        assert plan.outline


def test_the_layers_that_are_present_are_named(tmp_path: Path) -> None:
    drawing = new_drawing()
    rectangle(drawing.modelspace(), "PLAN-2", 0, 0, 5, 5)
    drawing.modelspace().add_line((0, 0), (5, 0), dxfattribs={"layer": "PLAN-1"})
    path = tmp_path / "office.dxf"
    drawing.saveas(path)
    message = refusal(path)
    assert "no closed outline on layer FLOOR, and no layer that shows walls" in message
    assert "layers present: PLAN-1, PLAN-2; the lines on PLAN-2 enclose 24.96 m²" in message
    assert message.endswith("--layer PLAN-2=walls accepts them")


def test_a_floor_of_open_lines_says_so(tmp_path: Path) -> None:
    drawing = new_drawing()
    drawing.modelspace().add_lwpolyline([(0, 0), (9, 0), (9, 9)], dxfattribs={"layer": "FLOOR"})
    path = tmp_path / "open.dxf"
    drawing.saveas(path)
    assert "only 1 open line" in refusal(path)


def test_a_floor_lost_to_a_bad_coordinate_says_so(tmp_path: Path) -> None:
    text = WHOLE.decode()
    start = text.index("FLOOR", text.rindex("ENTITIES"))
    broken = text[:start] + text[start:].replace("\n10.0\n", "\nnan\n", 1)
    assert "on FLOOR is skipped" in refusal(tmp_path / "nan.dxf", broken.encode())


def test_a_binary_file_reads_as_the_text_does(tmp_path: Path) -> None:
    drawing = new_drawing()
    rectangle(drawing.modelspace(), "FLOOR", 0, 0, 10, 8)
    path = tmp_path / "binary.dxf"
    drawing.saveas(path, fmt="bin")
    assert path.read_bytes().startswith(b"AutoCAD Binary DXF")
    assert read_floor(path).area == pytest.approx(80)
