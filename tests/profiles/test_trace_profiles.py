"""Traces of other programs, and marks of numbers."""

from __future__ import annotations

import io
import math
import tracemalloc
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from profiles.calibration.table import MeasuredTable, parse_table
from profiles.problem import Problem, ProfileError
from profiles.roundness import evaluate
from profiles.trace_files.header import header_of
from profiles.trace_files.limits import MOST_POINTS
from profiles.trace_files.number_marks import number_readings
from profiles.trace_files.x3p import MOST_MEMBERS, XML_CAP_BYTES
from profiles.traces import Trace, parse_trace, read_trace, write_trace

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


def test_records_of_text_and_damage() -> None:
    found = problem(SDF % 16 + b"0 " * HUGE)
    assert (found.code, found.value, found.limit) == ("trace.format", "> 16", "16")
    assert problem(x3p(MAIN + " " * XML_CAP_BYTES)).code == "trace.too_large"
    many = x3p(members={f"m{i}": b"" for i in range(MOST_MEMBERS)})
    assert "files" in problem(many).value
    whole = x3p()
    assert problem(whole[: len(whole) // 2]).key == "X3P"
    at = whole.index(b"bindata/data.bin") + len(b"bindata/data.bin") + 3
    damaged = whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :]
    assert problem(damaged).key == "bindata/data.bin"
    same_heights(parse_trace(smd()), "SMD", RADIUS_MM)
    in_counts = "".join(f"{round(2 * height)}\r\n" for height in HEIGHTS_UM)
    same_heights(
        parse_trace(smd("I\0 16 um\0 1.0e0 D\0 250", "A\0 16 nm\0 5.0e2 I\0", in_counts)), "SMD", RADIUS_MM
    )
    same_heights(parse_trace(prf()), "PRF", None)


def smd(x: str = "I\0 16 mm\0 1.0e0 D\0 2.5e-1", z: str = "A\0 16 um\0 1.0e0 D\0", rows: str = "") -> bytes:
    rows = rows or "".join(f"{height:.5f}\r\n" for height in HEIGHTS_UM)
    head = f"ISO 5436-2:2012\0part.smd\0\r\nPRF\0 1 ISO5436\0\r\nCX\0 {x}\r\nCZ\0 {z}\r\n\x03\r\n"
    return f"{head}DATE: 01-May-2020\0\r\nCOMMENT /* x */\0\r\n\x03\r\n{rows}\x03\r\n4711\r\n\x03\r\n\x1a".encode()


def prf(z: str = "M 1.600000e+001 UM 1.000000e-006 L", told: str = "", rows: str = "") -> bytes:
    rows = rows or "".join(f"{round(1e6 * height)}\r\n" for height in HEIGHTS_UM)
    told = told or "MAP 1.000000e+000 CZ CZ 1.000000e+000 1.000000e+000\r\n"
    head = f"1 2\r\nSG2004 0.000000e+000 PRF\r\nCX M 1.600000e+001 MM 1.000000e+000 D\r\nCZ {z}\r\nEOR\r\n"
    return f"{head}STYLUS_RADIUS 0 MM\r\nSPACING CX 2.5e-1\r\n{told}EOR\r\n{rows}EOR\r\nEOF\r\n".encode()


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


# Numbers as six countries write them, in every file that is imported: read as meant and shown, or refused.

MEANT = (1234.5, 6150.0, 12.25, 1234567.5, 950.0)
WRITTEN = {
    "English, Korean": ("1,234.5", "6,150", "12.25", "1,234,567.5", "950"),
    "Indian": ("1,234.5", "6,150", "12.25", "12,34,567.5", "950"),
    "German": ("1.234,5", "6.150", "12,25", "1.234.567,5", "950"),
    "French, blank": ("1 234,5", "6 150", "12,25", "1 234 567,5", "950"),
    "French, no-break": ("1\u00a0234,5", "6\u00a0150", "12,25", "1\u00a0234\u00a0567,5", "950"),
    "French, narrow": ("1\u202f234,5", "6\u202f150", "12,25", "1\u202f234\u202f567,5", "950"),
    "Swiss": ("1'234.5", "6'150", "12.25", "1'234'567.5", "950"),
    "Swiss, typographic": ("1\u2019234.5", "6\u2019150", "12.25", "1\u2019234\u2019567.5", "950"),
    "plain": ("1234.5", "6150", "12.25", "1234567.5", "950"),
    "plain, comma": ("1234,5", "6150", "12,25", "1234567,5", "950"),
}
ANGLES = range(0, 320, 20)


def trace(cells: list[str], separator: str, *head: str, unit: str = "nm") -> Trace:
    rows = [f"{angle}{separator}{cells[n % len(cells)]}" for n, angle in enumerate(ANGLES)]
    return parse_trace("\n".join([*head, f"angle_deg{separator}deviation_{unit}", *rows]).encode(), where="t.csv")


def wrench(cells: list[str], separator: str, *head: str) -> MeasuredTable:
    rows = [f"{n + 1}{separator}{cell}" for n, cell in enumerate(cells)]
    return parse_table("\n".join([*head, f"torque_n_m{separator}force_n", *rows]).encode(), where="t.csv")


def refusal(read: object, *arguments: object) -> Problem:
    assert callable(read)
    with pytest.raises(ProfileError) as caught:
        read(*arguments)
    (problem,) = caught.value.problems
    return problem


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("country", WRITTEN)
def test_what_another_number_settles_is_read_and_shown(tmp_path: Path, country: str, separator: str) -> None:
    cells = [f"{sign}{cell}" for cell in WRITTEN[country] for sign in ("", "-", "\u2212")]
    meant = [sign * number for number in MEANT for sign in (1.0, -1.0, -1.0)]
    found = trace(cells, separator)
    # nm are read in um
    assert found.deviation_um == pytest.approx([meant[n % 15] / 1000.0 for n in range(16)], rel=1e-12)
    shown = [problem.value for problem in header_of(found.meta)[1] if problem.code == "value.numbers_read"]
    first = WRITTEN[country][0].replace("\u00a0", " ").replace("\u202f", " ")  # as a terminal can show it
    assert shown == ["\u22121234.5 = -1234.5" if country == "plain" else f"{first} = 1234.5"]
    write_trace(tmp_path / "kept.csv", found)
    assert header_of(read_trace(tmp_path / "kept.csv").meta)[1] == header_of(found.meta)[1]
    table = wrench([cell for n, cell in enumerate(WRITTEN[country]) if n != 3], separator)
    assert table.columns["force_n"].tolist() == [1234.5, 6150.0, 12.25, 950.0]
    assert table.numbers_read == ("" if country == "plain" else f"{first} = 1234.5")


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("cells", [["6,150", "7,200"], ["6.150", "950", "12.340"], ["-6,150", "+7,200"]])
def test_what_nothing_settles_is_refused_with_both_readings(cells: list[str], separator: str) -> None:
    size = cells[0].lstrip("-")[1]
    problem = refusal(trace, cells, separator)
    assert (problem.code, problem.where, problem.key) == ("value.two_readings", "t.csv:2", "deviation_nm")
    comma, point = (6.15, 6150) if size == "," else (6150, 6.15)
    sign = "-" if cells[0][0] == "-" else ""
    assert problem.limit == f"{sign}{comma:g} (# decimal: comma) | {sign}{point:g} (# decimal: point)"
    problem = refusal(wrench, [cell.lstrip("-+") for cell in cells], separator)
    assert (problem.code, problem.where, problem.key) == ("value.two_readings", "t.csv:2", "force_n")
    assert "6.15 " in problem.limit and "6150 " in problem.limit
    assert "6.15 (# decimal" in str(problem) and "6150 (# decimal" in str(problem)


def test_the_remedy_of_a_refusal_is_what_it_says() -> None:
    for word, force_n in (("comma", 1.234), ("point", 1234.0)):
        table = wrench(["1,234", "2,000"], ";", f"# decimal: {word}")
        assert (table.columns["force_n"][0], table.numbers_read) == (force_n, "")
        found = trace(["1,234", "2,000"], ";", f"# decimal: {word}")
        assert found.deviation_um[0] == force_n / 1000.0
        assert "decimal" not in found.meta and not header_of(found.meta)[1]
    assert wrench(["1.234"], ";", "# decimal: point").columns["force_n"].tolist() == [1.234]
    assert refusal(trace, ["1.2"], ";", "# decimal: dot").code == "trace.key"
    assert refusal(wrench, ["1.2"], ";", "# decimal: dot").code == "calibration.meta"
    assert refusal(wrench, ["1.2"], ";", "# decimal: comma").code == "calibration.mixed_decimals"


@pytest.mark.parametrize(
    ("settling", "thousand"),
    [
        ("12,5", False),
        ("6,1503", False),
        ("0,150", False),
        (",5", False),
        ("1234,567", False),
        ("1.234,567", False),
        ("1,234e0", False),
        ("1,234,567", True),
        ("1,234.5", True),
        ("1,23,456", True),
    ],
)
def test_one_number_settles_its_mark_for_the_whole_file(settling: str, thousand: bool) -> None:
    um = trace(["6,150", "950", settling], ";").deviation_um
    assert um[0] == (6.15 if thousand else 0.00615)
    mirrored = settling.translate(str.maketrans(",.", ".,"))
    if settling != "1,23,456":  # points in pairs of digits are no thousands anywhere
        assert trace(["6.150", "950", mirrored], ";").deviation_um[0] == um[0]


def test_numbers_beside_the_columns_settle_nothing_and_the_other_column_does() -> None:
    assert refusal(trace, ["6,150"], ";", "# room: 20,5", "# 20,5").code == "value.two_readings"
    assert refusal(trace, ["6,150", "12.5"], ";").code == "value.two_readings"
    text = "torque_n_m;force_n\n4;1,234\n# 12,5\n5;1,500\n"
    assert refusal(parse_table, text.encode()).code == "value.two_readings"
    assert refusal(wrench, ["12,5", "1,234", "0.5"], ";").code == "calibration.mixed_decimals"
    rows = [f"{angle + 0.5}".replace(".", ",") + ";6,150" for angle in ANGLES]
    assert parse_trace("\n".join(["angle_deg;deviation_nm", *rows]).encode()).deviation_um[0] == 0.00615
    rows = [f"{angle:.3f}\t{angle + 1:.3f}" for angle in ANGLES]  # begins with 0.000
    assert parse_trace("\n".join(["angle_deg\tdeviation_um", *rows]).encode()).deviation_um[1] == 21.0
    assert trace(["6.150"], ",").deviation_um[0] == 0.00615
    assert trace(['"1,234.5"', '"6,150"'], ",").deviation_um[:2].tolist() == [1.2345, 6.15]
    assert refusal(trace, ['"6,150"'], ",").code == "value.two_readings"
    assert refusal(trace, ['"0,5"'], ",").code == "trace.decimal_comma"
    assert refusal(trace, ["6,150"], ",").code == "trace.decimal_comma"
    assert refusal(wrench, ['"1,234"', '"2,000"'], ",").code == "value.two_readings"
    assert wrench(['"1,234"', '"1,234.5"'], ",").columns["force_n"].tolist() == [1234.0, 1234.5]


def test_one_column_of_deviations_and_blanks_between_cells_follow_the_same_rule() -> None:
    for cell, code in (
        ("6,150", "value.two_readings"),
        ("6 150", "trace.columns"),
        ("6\u202f150", "trace.columns"),
    ):
        text = "\n".join(["# angles: equal", "deviation_nm", *[cell] * 16]).encode()
        with pytest.raises(ProfileError) as caught:
            parse_trace(text)
        assert caught.value.problems[0].code == code
    assert refusal(trace, ["6.150"], " ").code == "value.two_readings"
    assert trace(["6.150", "7.25"], " ").deviation_um[0] == 0.00615


@pytest.mark.parametrize(
    "text", ["", "-", "1_0", "1,2,3", "12,34", "01,234", "1 23", "1.2.3", "1''234", "１", "1,234 567"]
)
def test_what_no_country_writes_has_no_large_reading(text: str) -> None:
    assert all(abs(float(reading)) < 100.0 for reading in number_readings(text).values())
