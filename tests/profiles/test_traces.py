"""Traces in the forms that people write."""

from __future__ import annotations

import math
import os
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.problem import Problem, ProfileError
from profiles.roundness import evaluate
from profiles.trace_files.header import header_of
from profiles.traces import Trace, parse_trace, read_trace, write_trace

POINTS = [f"{22.5 * i:g},{i % 3}" for i in range(16)]
SOUND = ["# part: 7", "angle_deg,deviation_um", *POINTS]


def found(lines: list[str], end: str = "\n") -> list[tuple[str, str]]:
    with pytest.raises(ProfileError) as caught:
        parse_trace(end.join(lines).encode(), where="t.csv")
    assert all(str(problem).isprintable() for problem in caught.value.problems)
    return [(problem.code, problem.where) for problem in caught.value.problems]


def test_a_plain_file_is_read_as_other_editors_write_it() -> None:
    trace = parse_trace("\n".join(SOUND).encode())
    np.testing.assert_array_equal(trace.angle_deg, np.arange(16) * 22.5)
    np.testing.assert_array_equal(trace.deviation_um, np.arange(16) % 3)
    assert dict(trace.meta) == {"part": "7"}
    assert not trace.angle_deg.flags.writeable
    lines = ["# a remark", "#state:free ", "", " angle_deg , deviation_um", "# part: a: b", *POINTS, "  ", ""]
    trace = parse_trace(b"\xef\xbb\xbf" + "\r\n".join(lines).replace(",", " ,\t").encode())
    assert trace.angle_deg.size == 16
    assert dict(trace.meta) == {"state": "free", "part": "a: b"}


@pytest.mark.parametrize(
    ("row", "code"),
    [
        ("1,x", "trace.not_number"),
        ("1,1_000", "trace.not_number"),
        ("1,１", "trace.not_number"),
        ("1,", "trace.not_number"),
        ("1,0x1", "trace.not_number"),
        ("1,nan", "trace.not_finite"),
        ("1,-Infinity", "trace.not_finite"),
        ("1,1e999", "trace.not_finite"),
        ("1", "trace.columns"),
        ("1,5,x", "trace.columns"),
        ("1,5,0", "trace.decimal_comma"),
        ("1;5", "trace.separator"),
        ("-0.1,0", "trace.negative_angle"),
        ("360,1", "trace.duplicate_angle"),
        ("360.1,0", "trace.out_of_range"),
        ("1,2000000", "trace.beyond"),
        ("22.50,1", "trace.duplicate_angle"),
    ],
)
def test_a_bad_row_is_refused_with_its_line(row: str, code: str) -> None:
    assert found([*SOUND, row]) == [(code, "t.csv:19")]


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ([], [("trace.empty", "t.csv")]),
        (["\ufeff", " ", ""], [("trace.empty", "t.csv")]),
        (["# part: 7"], [("trace.no_header", "t.csv")]),
        (POINTS, [("trace.no_header", "t.csv:1")]),
        (["angle_deg,deviation_um,note", *POINTS], [("trace.columns", "t.csv:1")]),
        (["angle_deg", *POINTS], [("trace.columns", "t.csv:1")]),
        (["deviation_um,angle_deg", *POINTS], [("trace.columns", "t.csv:1")]),
        (SOUND[:-1], [("trace.few_points", "t.csv")]),
        (["# a: 1", "# a: 2", *SOUND], [("trace.meta", "t.csv:2")]),
        (["# : 1", *SOUND], [("trace.meta", "t.csv:1")]),
        (["# a: \x1b[31m", *SOUND], [("trace.meta", "t.csv:1")]),
    ],
)
def test_a_bad_file(lines: list[str], expected: list[tuple[str, str]]) -> None:
    assert found(lines) == expected


def test_bad_rows_do_not_flood_and_bytes_have_their_line() -> None:
    assert len(found([*SOUND, *["x,y"] * 1000])) == 20
    with pytest.raises(ProfileError) as caught:
        parse_trace(b"angle_deg,deviation_um\n1,\xb5\n", where="t.csv")
    assert (caught.value.problems[0].code, caught.value.problems[0].where) == ("trace.not_utf8", "t.csv:2")


def test_what_is_no_regular_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "gone", tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(ProfileError) as caught:
            read_trace(path)
        assert caught.value.problems[0].code == "trace.unreadable"


def test_a_file_above_the_cap(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.touch()
    os.truncate(path, 50_000_001)
    with pytest.raises(ProfileError) as caught:
        read_trace(path)
    assert caught.value.problems[0].code == "trace.too_large"


def test_a_file_is_not_overwritten_unless_asked(tmp_path: Path) -> None:
    trace = parse_trace("\n".join(SOUND).encode())
    write_trace(tmp_path / "t.csv", trace)
    with pytest.raises(ProfileError) as caught:
        write_trace(tmp_path / "t.csv", trace)
    assert caught.value.problems[0].code == "file.exists"
    write_trace(tmp_path / "t.csv", trace, overwrite=True)


@pytest.mark.parametrize("meta", [{"a:b": "c"}, {" a": "b"}, {"a": "b\nc"}, {"": "x"}, {"a": "\ud800"}])
def test_what_could_not_be_read_back_is_not_written(tmp_path: Path, meta: dict[str, str]) -> None:
    trace = parse_trace("\n".join(SOUND).encode())
    bad = Trace(angle_deg=trace.angle_deg, deviation_um=trace.deviation_um, meta=meta)
    with pytest.raises(ProfileError):
        write_trace(tmp_path / "t.csv", bad)
    short = Trace(angle_deg=trace.angle_deg[:3], deviation_um=trace.deviation_um)
    with pytest.raises(ProfileError):
        write_trace(tmp_path / "t.csv", short)
    assert not list(tmp_path.iterdir())


@given(
    st.lists(st.floats(0, 360, exclude_max=True), min_size=16, max_size=40, unique=True),
    st.data(),
    st.dictionaries(st.sampled_from(["state", "part", "방향"]), st.sampled_from(["free", "a: b", "", "7"])),
)
def test_round_trip(
    tmp_path_factory: pytest.TempPathFactory, angles: list[float], data: st.DataObject, meta: dict[str, str]
) -> None:
    size = len(angles)
    deviations = data.draw(st.lists(st.floats(-1e6, 1e6), min_size=size, max_size=size))
    path = tmp_path_factory.mktemp("traces") / "t.csv"
    given_trace = Trace(angle_deg=np.array(angles), deviation_um=np.array(deviations), meta=MappingProxyType(meta))
    write_trace(path, given_trace)
    met = read_trace(path)
    assert met.angle_deg.tobytes() == given_trace.angle_deg.tobytes()
    assert met.deviation_um.tobytes() == given_trace.deviation_um.tobytes()
    assert dict(met.meta) == meta


@given(
    st.binary(max_size=300)
    | st.lists(st.sampled_from([*SOUND, "#", ",", "x"])).map(lambda r: "\n".join(r).encode())
)
def test_any_bytes_are_a_trace_or_a_refusal(content: bytes) -> None:
    try:
        trace = parse_trace(content, where="t")
    except ProfileError as error:
        assert all(str(problem).isprintable() for problem in error.problems)
    else:
        assert trace.angle_deg.size >= 16


# Traces as other programs write them: what means the same is taken, what does not is named once.

DIALECT_POINTS = [f"{22.5 * i:g},{0.5 * (i % 3):g}" for i in range(16)]
HEADER = "angle_deg,deviation_um"


def parsed(*lines: str) -> Trace:
    return parse_trace("\n".join(lines).encode(), where="t.csv")


def problems(*lines: str) -> list[Problem]:
    with pytest.raises(ProfileError) as caught:
        parsed(*lines)
    return list(caught.value.problems)


def test_remarks_quotes_and_signs_may_stand_anywhere() -> None:
    trace = parsed(
        "",
        "# part: 7",
        HEADER,
        "# state: free",
        *DIALECT_POINTS[:8],
        "# state: late",
        "",
        "# x",
        *DIALECT_POINTS[8:],
    )
    assert trace.angle_deg.size == 16
    assert dict(trace.meta) == {"part": "7", "state": "free"}
    quoted = [",".join(f'"{cell}"' for cell in line.split(",")) for line in (HEADER, *DIALECT_POINTS)]
    np.testing.assert_array_equal(parsed(*quoted).deviation_um, parsed(HEADER, *DIALECT_POINTS).deviation_um)
    assert parsed("# units: µm", "angle_deg,deviation", *DIALECT_POINTS).deviation_um[1] == 0.5


@pytest.mark.parametrize("closing", ["360,0", "360.0,0.0000000005", '"360","0"'])
def test_a_point_that_closes_the_turn_is_left_out(closing: str) -> None:
    assert parsed(HEADER, *DIALECT_POINTS, closing).angle_deg.tolist() == [22.5 * i for i in range(16)]


def test_points_in_the_plane_stand_once_and_may_be_closed() -> None:
    (problem,) = problems(HEADER, *DIALECT_POINTS, "360,0.001")
    assert (problem.code, problem.where, problem.limit) == ("trace.duplicate_angle", "t.csv:18", "t.csv:2")
    assert [p.code for p in problems(HEADER, *DIALECT_POINTS, "360,0", "360,0")] == ["trace.duplicate_angle"]
    assert [p.code for p in problems(HEADER, *DIALECT_POINTS[1:], "360,0")] == ["trace.out_of_range"]
    (problem,) = problems("x_mm,y_mm", *CIRCLE, CIRCLE[3])
    assert (problem.code, problem.where, problem.limit) == ("trace.duplicate_point", "t.csv:18", "t.csv:5")
    assert problem.value.startswith(CIRCLE[3][:20]) and problem.key == "x_mm,y_mm"
    repeated = problems("x_mm,y_mm", *CIRCLE, CIRCLE[1], CIRCLE[1], CIRCLE[1], CIRCLE[1])
    assert [p.where for p in repeated] == [f"t.csv:{line}" for line in range(18, 22)]
    assert parsed("x_mm,y_mm", *CIRCLE, CIRCLE[0]).angle_deg.size == 16
    (problem,) = problems("x_mm,y_mm", *CIRCLE[:15], CIRCLE[0], CIRCLE[15])
    assert (problem.code, problem.where, problem.limit) == ("trace.duplicate_point", "t.csv:17", "t.csv:2")


@pytest.mark.parametrize(
    ("lines", "code", "line"),
    [
        ([HEADER, "0;0,5", "22,5;1,5"], "trace.separator", 2),
        (["angle_deg;deviation_um", *(p.replace(".", ",") for p in DIALECT_POINTS)], "trace.separator", 2),
        (["angle_deg;deviation_um", "0;0", "22,5;1,5", "45.5;1"], "trace.mixed_decimals", 4),
        (["angle_deg;deviation_um", "0,5;0", "1.5;0"], "trace.mixed_decimals", 3),
        (["angle_deg,deviation", *DIALECT_POINTS], "trace.units", 1),
        (["# units: mm", HEADER, *DIALECT_POINTS], "trace.units", 2),
        (["deviation_um", *(str(i) for i in range(16))], "trace.angles", 1),
        (["# angles: equal", HEADER, *DIALECT_POINTS], "trace.angles", 2),
        ([HEADER, *(p.replace(".", ",") for p in DIALECT_POINTS[1:])], "trace.decimal_comma", 2),
        ([HEADER, *(f'"{i},5","{i},25"' for i in range(40))], "trace.decimal_comma", 2),
        ([HEADER, *(f"{i - 180},1" for i in range(360))], "trace.negative_angle", 2),
        ([HEADER, "x,y", "x,y", *(f"{i - 180},1" for i in range(360))], "trace.negative_angle", 4),
    ],
)
def test_what_spoils_a_whole_file_is_told_once(lines: list[str], code: str, line: int) -> None:
    (problem,) = problems(*lines)
    assert (problem.code, problem.where) == (code, f"t.csv:{line}")
    assert problem.value


@pytest.mark.parametrize("content", [b'"', b'angle_deg,deviation_um\n"1"x\r"2,3', b'"a\r"b'])
def test_quotes_that_are_none_are_refused(content: bytes) -> None:
    with pytest.raises(ProfileError):
        parse_trace(content)


def test_problems_say_what_was_met(tmp_path_factory: pytest.TempPathFactory) -> None:
    (repeated,) = problems("# a: 1", "# a: 2", HEADER, *DIALECT_POINTS)
    assert (repeated.value, repeated.limit) == ("# a: 2", "# key: value")
    with pytest.raises(ProfileError) as caught:
        parse_trace(b"angle_deg,deviation_um\n1,\xb5\n")
    assert caught.value.problems[0].value == "0xb5"
    sound = parsed(HEADER, *DIALECT_POINTS)
    odd = Trace(angle_deg=sound.angle_deg, deviation_um=sound.deviation_um, meta={"a:b": "c"})
    with pytest.raises(ProfileError) as caught:
        write_trace(tmp_path_factory.mktemp("t") / "t.csv", odd)
    assert caught.value.problems[0].value == "# a:b: c"


@pytest.mark.parametrize(
    "header",
    [
        "Angle [deg];Deviation [µm]",
        "Angle (°);Deviation (\u03bcm)",
        '"Theta / deg";"Radial deviation / micrometers"',
        "angle_deg\tdeviation_um",
        "Angle [deg] Deviation [um]",
        "spindle angle, degrees;Δr [um]",
        "각도 [deg];편차 [um]",
    ],
)
def test_columns_are_named_as_people_name_them(header: str) -> None:
    mark = next((mark for mark in ";\t" if mark in header), " ")
    rows = [point.replace(",", mark) for point in DIALECT_POINTS]
    np.testing.assert_array_equal(parsed(header, *rows).deviation_um, parsed(HEADER, *DIALECT_POINTS).deviation_um)
    in_mm = header.replace("µm", "mm").replace("\u03bcm", "mm").replace("um", "mm").replace("micrometers", "mm")
    assert parsed(in_mm, *rows).deviation_um[1] == 500.0


@pytest.mark.parametrize(
    "header", ["Angle;Deviation [µm]", "Angle [rad];Deviation [µm]", "Angle [deg];Roughness [µm]"]
)
def test_columns_that_are_not_known_are_told_with_those_that_are(header: str) -> None:
    (problem,) = problems(header, *(point.replace(",", ";") for point in DIALECT_POINTS))
    assert (problem.code, problem.value, problem.limit) == ("trace.columns", header, f"{HEADER} | x_mm,y_mm")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, end: str) -> None:
    text = end.join(["# part: 7", "Angle [°],Deviation [µm]", *DIALECT_POINTS, ""])
    mark = "\ufeff" if encoding in ("utf-16-le", "utf-16-be") else ""
    trace = parse_trace((mark + text).encode(encoding))
    np.testing.assert_array_equal(trace.deviation_um, parsed(HEADER, *DIALECT_POINTS).deviation_um)
    assert dict(trace.meta) == {"part": "7"}


def test_what_is_wrong_in_any_line_end_has_its_line() -> None:
    with pytest.raises(ProfileError) as caught:
        parse_trace(
            "\r".join([HEADER, *DIALECT_POINTS[:3], "x,1", *DIALECT_POINTS[3:]]).encode("utf-16"), where="t.csv"
        )
    assert [(p.code, p.where) for p in caught.value.problems] == [("trace.not_number", "t.csv:5")]
    with pytest.raises(ProfileError) as caught:
        parse_trace(b"\xff\xfea", where="t.csv")
    assert caught.value.problems[0].code == "trace.not_utf8"


CIRCLE = [f"{math.cos(math.pi * i / 8)!r},{math.sin(math.pi * i / 8)!r}" for i in range(16)]


# Kinds of trace files beside the plain one: dialects, units, several turns, points in the plane, surface data.

ANGLES = [22.5 * i for i in range(16)]
DEVIATIONS = [0.5 * (i % 3) for i in range(16)]
PLAIN = "\n".join(["angle_deg,deviation_um", *(f"{a},{d}" for a, d in zip(ANGLES, DEVIATIONS, strict=True))])


def kind_problems(text: str) -> list[Problem]:
    with pytest.raises(ProfileError) as caught:
        parse_trace(text.encode(), where="t.csv")
    return list(caught.value.problems)


def same_as_plain(trace: Trace) -> None:
    np.testing.assert_allclose(trace.angle_deg, ANGLES)
    np.testing.assert_allclose(trace.deviation_um, DEVIATIONS)
    assert not trace.deviation_um.flags.writeable


@pytest.mark.parametrize("separator", [";", "\t", " ", "  ", " ; "])
@pytest.mark.parametrize("decimal", [".", ","])
def test_separators_and_decimal_commas(separator: str, decimal: str) -> None:
    head, *rows = PLAIN.split("\n")
    rows = [row.replace(",", separator).replace(".", decimal) for row in rows]
    same_as_plain(parse_trace("\n".join([head.replace(",", separator), *rows]).encode()))


@pytest.mark.parametrize(
    ("head", "columns", "factor"),
    [
        ("", "angle_deg,deviation_mm", 1e-3),
        ("", "angle_deg,deviation_nm", 1e3),
        ("# units: mm\n", "angle_deg,deviation", 1e-3),
        ("# units: nm\n", "angle_deg,deviation_nm", 1e3),
    ],
)
def test_units_are_those_that_are_declared(head: str, columns: str, factor: float) -> None:
    rows = [f"{a},{d * factor!r}" for a, d in zip(ANGLES, DEVIATIONS, strict=True)]
    trace = parse_trace((head + "\n".join([columns, *rows])).encode())
    same_as_plain(trace)
    assert "units" not in trace.meta


def test_equal_angles_ranges_and_turns() -> None:
    text = "\n".join(["# angles: equal", "deviation_um", *map(str, DEVIATIONS)])
    same_as_plain(parse_trace(text.encode()))
    rows = [f"{a - 360 if a >= 180 else a},{d}" for a, d in zip(ANGLES, DEVIATIONS, strict=True)]
    text = "\n".join(["# angle_range: -180..180", "angle_deg,deviation_um", *rows[8:], *rows[:8]])
    trace = parse_trace(text.encode())
    np.testing.assert_allclose(trace.angle_deg, ANGLES[8:] + ANGLES[:8])
    closed = parse_trace(f"{text}\n180,{DEVIATIONS[8]}".encode())
    assert closed.angle_deg.size == 16
    assert [p.code for p in kind_problems(f"{text}\n181,0")] == ["trace.out_of_range"]
    rows = [f"{22.5 * i},{i}" for i in range(48)]
    trace = parse_trace("\n".join(["# turns: 3", "angle_deg,deviation_um", *rows]).encode())
    assert (trace.angle_deg[-1], trace.meta["turns"]) == (1057.5, "3")
    assert next(p.limit for p in kind_problems("\n".join(["# turns: 2", "angle_deg,deviation_um", *rows]))) == (
        ">= 0, < 720 deg"
    )


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("# turns: 0", "trace.key"),
        ("# turns: two", "trace.key"),
        ("# units: inch", "trace.key"),
        ("# angles: unequal", "trace.key"),
        ("# angle_range: 0..180", "trace.key"),
        ("# turns: 2\n# angle_range: -180..180", "trace.key"),
        ("# angle_range: -180..180\n# turns: 2", "trace.key"),
    ],
)
def test_what_would_change_the_numbers_is_refused_with_its_line(line: str, code: str) -> None:
    (problem,) = kind_problems(f"{line}\n{PLAIN}")
    assert (problem.code, problem.where) == (code, f"t.csv:{1 + line.count(chr(10))}")
    assert problem.value and problem.limit


def test_units_come_in_time_and_what_is_not_stated_is_unknown() -> None:
    head, rows = PLAIN.split("\n", 1)
    assert [p.code for p in kind_problems(f"{head}\n# units: um\n{rows}")] == ["trace.meta_late"]
    header, warnings = header_of({})
    assert (header.state, header.direction, header.jaw_1_deg, header.turns) == ("unknown", None, None, 1)
    assert (header.phase_known, header.jaw_1_of(90.0), warnings) == (False, None, ())


def test_points_in_the_plane_stand_about_their_own_centre() -> None:
    t = np.radians(np.arange(360))
    radius_mm = 26 + 0.0275 * np.sin(3 * t)
    x_mm, y_mm = (100 + radius_mm * np.cos(t)).tolist(), (radius_mm * np.sin(t)).tolist()
    rows = [f"{x!r};{y!r}" for x, y in zip(x_mm, y_mm, strict=True)]
    trace = parse_trace("\n".join(["x_mm;y_mm", *rows]).encode())
    assert trace.centre_mm is not None and trace.centre_mm[0] == pytest.approx(100, abs=1e-9)
    assert float(trace.meta["radius_mm"]) == pytest.approx(26, abs=1e-9)
    result = evaluate(trace.angle_deg, trace.deviation_um, None, radius_mm=26.0)
    assert [circle.ront_um for circle in result.circles] == pytest.approx([55] * 4, abs=1e-6)
    assert [p.code for p in kind_problems("\n".join(["# radius_mm: 26", "x_mm;y_mm", *rows]))] == ["trace.meta"]


SDF = """aBCR-1.0
ManufacID = Gauge
NumPoints = 16
NumProfiles = 1
Xscale = 1.0e-3
Yscale = 1
Zscale = 1.0E-6
DataType = 7
*
; the profile
{values}
*
remarks of the instrument
"""


def test_a_surface_data_file() -> None:
    trace = parse_trace(SDF.format(values="\n".join(map(str, DEVIATIONS))).replace("\n", "\r\n").encode())
    same_as_plain(trace)
    header, warnings = header_of(trace.meta)
    assert header.radius_mm == pytest.approx(16 / (2 * math.pi))
    assert (header.size, warnings) == ("relative", ())
    assert not header.phase_known


@pytest.mark.parametrize(
    ("old", "new", "code", "where"),
    [
        ("aBCR", "bBCR", "trace.format", "t.csv"),
        ("NumProfiles = 1", "NumProfiles = 2", "trace.format", "t.csv"),
        ("NumPoints = 16", "NumPoints = 17", "trace.format", "t.csv"),
        ("Zscale = 1.0E-6\n", "", "trace.format", "t.csv"),
        ("\n1.0\n", "\nBAD\n", "trace.not_finite", "t.csv:13"),
        ("\n1.0\n", "\n1,0\n", "trace.not_number", "t.csv:13"),
    ],
)
def test_a_surface_data_file_that_is_none(old: str, new: str, code: str, where: str) -> None:
    (problem,) = kind_problems(SDF.format(values="\n".join(map(str, DEVIATIONS))).replace(old, new, 1))
    assert (problem.code, problem.where) == (code, where)


@pytest.mark.parametrize(
    ("meta", "jaw_1_deg"),
    [
        ({"direction": "cw", "jaw_1_deg": "12.5"}, 12.5),
        ({"direction": "ccw", "start_mark": "jaw 1"}, 0.0),
        ({"direction": "spindle", "start_mark": "spindle index"}, 90.0),
        ({"direction": "ccw", "start_mark": "spindle index"}, -90.0),
        ({"direction": "cw", "start_mark": "unknown"}, None),
        ({"start_mark": "jaw 1"}, None),
    ],
)
def test_jaw_1_needs_a_direction_and_a_mark(meta: dict[str, str], jaw_1_deg: float | None) -> None:
    assert header_of(meta)[0].jaw_1_of(90.0) == jaw_1_deg


@pytest.mark.parametrize(
    "key", ["radius_mm", "direction", "jaw_1_deg", "filter_upr", "size", "method", "start_mark"]
)
def test_a_value_that_cannot_be_used_is_a_warning(key: str) -> None:
    header, (warning,) = header_of({key: "nan"})
    assert (warning.code, warning.key, warning.value) == ("trace.header_value", key, "nan")
    assert getattr(header, key) is None
