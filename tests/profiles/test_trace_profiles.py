"""Files of one profile at equal steps, taken as one closed turn: X3P, SMD, PRF, SDF of other programs."""

from __future__ import annotations

import io
import math
import tracemalloc
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from profiles.problem import Problem, ProfileError
from profiles.roundness import evaluate
from profiles.trace_files.header import header_of
from profiles.trace_files.limits import MOST_POINTS
from profiles.trace_files.x3p import MOST_MEMBERS, XML_CAP_BYTES
from profiles.traces import Trace, parse_trace, read_trace

SAMPLES = Path(__file__).parent / "samples"
HEIGHTS_UM = [0.5 * (i % 3) for i in range(16)]
RADIUS_MM = 16 * 0.25 / (2 * math.pi)
"""Of 16 steps of 0.25 mm."""


def problem(content: bytes) -> Problem:
    with pytest.raises(ProfileError) as caught:
        parse_trace(content, where="t")
    (found,) = caught.value.problems
    assert found.where.startswith("t") and found.value and found.limit and str(found).isprintable()
    return found


def same_heights(trace: Trace, kind: str, radius_mm: float | None) -> None:
    np.testing.assert_allclose(trace.angle_deg, np.arange(16) * 22.5)
    np.testing.assert_allclose(trace.deviation_um, HEIGHTS_UM, atol=1e-9)
    header, warnings = header_of(trace.meta)
    assert (trace.meta["format"], header.size, header.phase_known, warnings) == (kind, "relative", False, ())
    assert header.radius_mm == (None if radius_mm is None else pytest.approx(radius_mm))


@pytest.mark.parametrize("name", ["three_lobes_binary.x3p", "three_lobes_text.x3p"])
def test_an_x3p_file_of_another_program(name: str) -> None:
    """72 points of 27.5 sin 3t + cos 5t um on 26 mm, as integers: beside main.xml and in it, by x3pio 2.0."""
    trace = read_trace(SAMPLES / name)
    t = np.arange(72) * 2 * np.pi / 72
    np.testing.assert_allclose(trace.deviation_um, 27.5 * np.sin(3 * t) + np.cos(5 * t), atol=5e-4)
    assert float(trace.meta["radius_mm"]) == pytest.approx(26, rel=1e-12)
    assert evaluate(trace.angle_deg, trace.deviation_um, None).amplitude_um(3) == pytest.approx(27.5, abs=1e-4)


MAIN = """<?xml version="1.0" encoding="UTF-8"?>
<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1><FeatureType>PRF</FeatureType><Axes>
<CX><AxisType>I</AxisType><Increment>2.5e-4</Increment></CX>
<CY><AxisType>I</AxisType><Increment>1</Increment></CY>
<CZ><AxisType>A</AxisType><DataType>D</DataType><Increment>1</Increment></CZ></Axes></Record1>
<Record3><MatrixDimension><SizeX>16</SizeX><SizeY>1</SizeY><SizeZ>1</SizeZ></MatrixDimension>
<DataLink><PointDataLink>bindata/data.bin</PointDataLink></DataLink></Record3></p:ISO5436_2>
"""
BINARY = np.array(HEIGHTS_UM) * 1e-6


def x3p(
    main: str = MAIN, data: bytes = BINARY.astype("<f8").tobytes(), members: Mapping[str, bytes] = {}
) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("main.xml", main)
        archive.writestr("bindata/data.bin", data)
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


def test_each_type_of_number_of_an_x3p_file() -> None:
    same_heights(parse_trace(x3p()), "X3P", RADIUS_MM)
    in_float = x3p(MAIN.replace(">D<", ">F<"), BINARY.astype("<f4").tobytes())
    np.testing.assert_allclose(parse_trace(in_float).deviation_um, HEIGHTS_UM, atol=1e-6)
    as_integers = MAIN.replace(">1</Increment></CZ>", ">5e-7</Increment></CZ>")
    for letter, kind in (("I", "<i2"), ("L", "<i4")):
        integers = x3p(
            as_integers.replace(">D<", f">{letter}<"), np.array([i % 3 for i in range(16)], kind).tobytes()
        )
        same_heights(parse_trace(integers), "X3P", RADIUS_MM)


@pytest.mark.parametrize(
    ("old", "new", "key", "value"),
    [
        (">PRF<", ">SUR<", "Record1/FeatureType", "SUR"),
        ("<CX><AxisType>I", "<CX><AxisType>A", "Record1/Axes/CX/AxisType", "A"),
        (">2.5e-4<", "><", "CX/Increment", "-"),
        (">D</DataType><Increment>1<", ">D</DataType><Increment>1e-6<", "CZ/Increment", "1e-6"),
        (">D<", ">Q<", "Record1/Axes/CZ/DataType", "Q"),
        ("<SizeX>16", "<SizeX>17", "bindata/data.bin", "128 bytes"),
        ("<SizeZ>1", "<SizeZ>2", "Record3/MatrixDimension/SizeZ", "2"),
        ("bindata/data.bin", "../../etc/passwd", "X3P", "-"),
        ("<Record1>", "<Record1", "main.xml", "not well-formed"),
        ("p:ISO5436_2", "p:other", "main.xml", "other"),
    ],
)
def test_an_x3p_file_that_is_no_closed_turn_says_why(old: str, new: str, key: str, value: str) -> None:
    found = problem(x3p(MAIN.replace(old, new)))
    assert (found.code, found.key) == ("trace.format", key)
    assert value in found.value


def test_a_point_that_was_not_measured_is_refused_with_its_place() -> None:
    gone = BINARY.copy()
    gone[5] = math.nan
    in_float = problem(x3p(data=gone.astype("<f8").tobytes()))
    link = "</PointDataLink><ValidPointsLink>valid</ValidPointsLink>"
    marked = problem(x3p(MAIN.replace("</PointDataLink>", link), members={"valid": b"\xdf\xff"}))
    for found in (in_float, marked):
        assert (found.code, found.where) == ("trace.not_finite", "t: bindata/data.bin 6")


BOMB = '<!DOCTYPE p [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp037"])
def test_entities_are_refused_whatever_the_encoding(encoding: str) -> None:
    head, rest = MAIN.split("\n", 1)
    main = head.replace("UTF-8", encoding).encode() + (BOMB + rest).encode(encoding)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("main.xml", main)
    assert problem(file.getvalue()).key == "main.xml"


HUGE = 8_000_000
"""Points that are claimed, or letters that are there."""

AS_INTEGERS = MAIN.replace(">D<", ">I<").replace(">1</Increment></CZ>", ">1e-6</Increment></CZ>")
LISTED = AS_INTEGERS.partition("<DataLink>")[0] + "<DataList>{}</DataList></Record3></p:ISO5436_2>"
SDF = b"aBCR-1.0\nNumPoints = %d\nNumProfiles = 1\nXscale = 1e-6\nZscale = 1e-6\n*\n"


@pytest.mark.parametrize(
    ("content", "value", "limit"),
    [
        (x3p(AS_INTEGERS.replace("<SizeX>16", f"<SizeX>{HUGE}")), "8000000 points", "<= 500000 points"),
        (x3p(LISTED.format("<a/>" * 600_000)), "600021 elements", "<= 501000 elements"),
        (x3p(LISTED.format("<a b='1'/>" * 2000)), "2003 attributes", "<= 1000 attributes"),
        (
            x3p(LISTED.format(f"<a xmlns='{'u' * 500_000}'><b/></a>")),
            "500003 characters in an attribute",
            "<= 300 characters in an attribute",
        ),
        (x3p(data=b"\0" * 9_000_000), "> 4000000 bytes", "<= 4000000 bytes"),
        (SDF % HUGE + b"0 " * HUGE, "8000000 points", "<= 500000 points"),
        (SDF % 16 + b"\n" * HUGE, "8000007 lines", "<= 1000000 lines"),
        (b"".join(b"#%d:v\n" % i for i in range(1001)), "> 1000 # lines", "<= 1000 # lines"),
    ],
    ids=["points", "elements", "attributes", "namespace", "binary", "sdf", "lines", "header"],
)
def test_a_small_file_with_much_in_it_costs_no_memory(content: bytes, value: str, limit: str) -> None:
    """Twenty kilobytes of X3P took 6.5 GB, 16 MB of SDF 5.2 GB: what is met and allowed is told instead."""
    tracemalloc.start()
    try:
        found = problem(content)
        peak_mb = tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
    assert (found.code, found.value, found.limit) == ("trace.too_large", value, limit)
    assert peak_mb < 60.0


def test_a_table_is_read_up_to_its_last_point(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MOST_POINTS == 500_000
    monkeypatch.setattr("profiles.trace_files.table.MOST_POINTS", 100)
    head = b"# angles: equal\ndeviation_um\n"
    assert parse_trace(head + b"0\n" * 100).deviation_um.size == 100
    found = problem(head + b"0\n" * 101)
    assert (found.code, found.value, found.limit) == ("trace.too_large", "> 100 points", "<= 100 points")


def test_more_values_than_the_head_says_are_not_read_to_their_end() -> None:
    found = problem(SDF % 16 + b"0 " * HUGE)
    assert (found.code, found.value, found.limit) == ("trace.format", "> 16", "16")


def test_bombs_and_damage_are_refused() -> None:
    assert problem(x3p(MAIN + " " * XML_CAP_BYTES)).code == "trace.too_large"
    many = x3p(members={f"m{i}": b"" for i in range(MOST_MEMBERS)})
    assert "files" in problem(many).value
    whole = x3p()
    assert problem(whole[: len(whole) // 2]).key == "X3P"
    at = whole.index(b"bindata/data.bin") + len(b"bindata/data.bin") + 3
    damaged = whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :]
    assert problem(damaged).key == "bindata/data.bin"


def smd(x: str = "I\0 16 mm\0 1.0e0 D\0 2.5e-1", z: str = "A\0 16 um\0 1.0e0 D\0", rows: str = "") -> bytes:
    rows = rows or "".join(f"{height:.5f}\r\n" for height in HEIGHTS_UM)
    head = f"ISO 5436-2:2012\0part.smd\0\r\nPRF\0 1 ISO5436\0\r\nCX\0 {x}\r\nCZ\0 {z}\r\n\x03\r\n"
    return f"{head}DATE: 01-May-2020\0\r\nCOMMENT /* x */\0\r\n\x03\r\n{rows}\x03\r\n4711\r\n\x03\r\n\x1a".encode()


def prf(z: str = "M 1.600000e+001 UM 1.000000e-006 L", told: str = "", rows: str = "") -> bytes:
    rows = rows or "".join(f"{round(1e6 * height)}\r\n" for height in HEIGHTS_UM)
    told = told or "MAP 1.000000e+000 CZ CZ 1.000000e+000 1.000000e+000\r\n"
    head = f"1 2\r\nSG2004 0.000000e+000 PRF\r\nCX M 1.600000e+001 MM 1.000000e+000 D\r\nCZ {z}\r\nEOR\r\n"
    return f"{head}STYLUS_RADIUS 0 MM\r\nSPACING CX 2.5e-1\r\n{told}EOR\r\n{rows}EOR\r\nEOF\r\n".encode()


def test_records_of_text() -> None:
    same_heights(parse_trace(smd()), "SMD", RADIUS_MM)
    in_counts = "".join(f"{round(2 * height)}\r\n" for height in HEIGHTS_UM)
    same_heights(
        parse_trace(smd("I\0 16 um\0 1.0e0 D\0 250", "A\0 16 nm\0 5.0e2 I\0", in_counts)), "SMD", RADIUS_MM
    )
    same_heights(parse_trace(prf()), "PRF", None)


@pytest.mark.parametrize(
    ("content", "code", "key"),
    [
        (smd(x="A\0 16 mm\0 1.0e0 D\0"), "trace.format", "CX"),
        (smd(x="I\0 16 mm\0 1.0e0 D\0"), "trace.format", "CX"),
        (smd(z="A\0 16 in\0 1.0e0 D\0"), "trace.format", "CZ"),
        (smd(z="A\0 17 um\0 1.0e0 D\0"), "trace.format", "SMD: points"),
        (smd().replace(b"PRF\0", b"SUR\0"), "trace.format", "feature"),
        (smd().replace(b"CZ\0", b"PA\0"), "trace.format", "CZ"),
        (smd(rows="BAD\r\n" * 16), "trace.not_finite", "Z"),
        (b"ISO 5436-2:2012\0x\0\r\n", "trace.format", "records"),
        (prf(z="I 1.600000e+001 UM 1.000000e-006 L"), "trace.format", "CZ"),
        (prf(told="MAP 1.000000e+000 CZ CZ 2.000000e+000 1.000000e+000\r\n"), "trace.format", "MAP"),
        (prf(rows="1;2\r\n" * 16), "trace.not_number", "Z"),
    ],
)
def test_records_that_cannot_be_used_say_why(content: bytes, code: str, key: str) -> None:
    found = problem(content)
    assert (found.code, found.key) == (code, key)


@pytest.mark.parametrize("version", ["aNPL-V1.0", "aBCR - 1.0", "aISO-1.0", "\n aISO-1.0"])
def test_versions_of_surface_data_files(version: str) -> None:
    rows = "\n".join(f"{height}" for height in HEIGHTS_UM)
    text = f"{version}\nNumPoints = 16\nNumProfiles = 1\nXscale = 2.5E-04\nZscale = 1E-06\n*\n{rows}\n*\n*\n"
    same_heights(parse_trace(text.encode()), "SDF", RADIUS_MM)
