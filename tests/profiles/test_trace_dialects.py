"""Traces as other programs write them: what means the same is taken, what does not is named once."""

import math

import numpy as np
import pytest

from profiles.problem import Problem, ProfileError
from profiles.traces import Trace, parse_trace, write_trace

POINTS = [f"{22.5 * i:g},{0.5 * (i % 3):g}" for i in range(16)]
HEADER = "angle_deg,deviation_um"


def parsed(*lines: str) -> Trace:
    return parse_trace("\n".join(lines).encode(), where="t.csv")


def problems(*lines: str) -> list[Problem]:
    with pytest.raises(ProfileError) as caught:
        parsed(*lines)
    return list(caught.value.problems)


def test_remarks_and_blank_lines_may_stand_anywhere() -> None:
    trace = parsed("", "# part: 7", HEADER, "# state: free", *POINTS[:8], "# state: late", "", "# x", *POINTS[8:])
    assert trace.angle_deg.size == 16
    assert dict(trace.meta) == {"part": "7", "state": "free"}


def test_cells_may_be_quoted() -> None:
    quoted = [",".join(f'"{cell}"' for cell in line.split(",")) for line in (HEADER, *POINTS)]
    np.testing.assert_array_equal(parsed(*quoted).deviation_um, parsed(HEADER, *POINTS).deviation_um)


@pytest.mark.parametrize("closing", ["360,0", "360.0,0.0000000005", '"360","0"'])
def test_a_point_that_closes_the_turn_is_left_out(closing: str) -> None:
    assert parsed(HEADER, *POINTS, closing).angle_deg.tolist() == [22.5 * i for i in range(16)]


def test_a_closing_point_that_differs_stands_against_the_one_at_0() -> None:
    (problem,) = problems(HEADER, *POINTS, "360,0.001")
    assert (problem.code, problem.where, problem.limit) == ("trace.duplicate_angle", "t.csv:18", "t.csv:2")
    assert [p.code for p in problems(HEADER, *POINTS, "360,0", "360,0")] == ["trace.duplicate_angle"]
    assert [p.code for p in problems(HEADER, *POINTS[1:], "360,0")] == ["trace.out_of_range"]


@pytest.mark.parametrize(
    ("lines", "code", "line"),
    [
        ([HEADER, "0;0,5", "22,5;1,5"], "trace.separator", 2),
        (["angle_deg;deviation_um", *(p.replace(".", ",") for p in POINTS)], "trace.separator", 2),
        (["angle_deg;deviation_um", "0;0", "22,5;1,5", "45.5;1"], "trace.mixed_decimals", 4),
        (["angle_deg;deviation_um", "0,5;0", "1.5;0"], "trace.mixed_decimals", 3),
        (["angle_deg,deviation", *POINTS], "trace.units", 1),
        (["# units: mm", HEADER, *POINTS], "trace.units", 2),
        (["deviation_um", *(str(i) for i in range(16))], "trace.angles", 1),
        (["# angles: equal", HEADER, *POINTS], "trace.angles", 2),
        ([HEADER, *(p.replace(".", ",") for p in POINTS[1:])], "trace.decimal_comma", 2),
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
    (repeated,) = problems("# a: 1", "# a: 2", HEADER, *POINTS)
    assert (repeated.value, repeated.limit) == ("# a: 2", "# key: value")
    with pytest.raises(ProfileError) as caught:
        parse_trace(b"angle_deg,deviation_um\n1,\xb5\n")
    assert caught.value.problems[0].value == "0xb5"
    sound = parsed(HEADER, *POINTS)
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
    rows = [point.replace(",", mark) for point in POINTS]
    np.testing.assert_array_equal(parsed(header, *rows).deviation_um, parsed(HEADER, *POINTS).deviation_um)
    in_mm = header.replace("µm", "mm").replace("\u03bcm", "mm").replace("um", "mm").replace("micrometers", "mm")
    assert parsed(in_mm, *rows).deviation_um[1] == 500.0


@pytest.mark.parametrize(
    "header", ["Angle;Deviation [µm]", "Angle [rad];Deviation [µm]", "Angle [deg];Roughness [µm]"]
)
def test_columns_that_are_not_known_are_told_with_those_that_are(header: str) -> None:
    (problem,) = problems(header, *(point.replace(",", ";") for point in POINTS))
    assert (problem.code, problem.value, problem.limit) == ("trace.columns", header, f"{HEADER} | x_mm,y_mm")


def test_a_unit_in_the_header_may_have_its_sign() -> None:
    assert parsed("# units: µm", "angle_deg,deviation", *POINTS).deviation_um[1] == 0.5


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, end: str) -> None:
    text = end.join(["# part: 7", "Angle [°],Deviation [µm]", *POINTS, ""])
    mark = "\ufeff" if encoding in ("utf-16-le", "utf-16-be") else ""
    trace = parse_trace((mark + text).encode(encoding))
    np.testing.assert_array_equal(trace.deviation_um, parsed(HEADER, *POINTS).deviation_um)
    assert dict(trace.meta) == {"part": "7"}


def test_what_is_wrong_in_any_line_end_has_its_line() -> None:
    with pytest.raises(ProfileError) as caught:
        parse_trace("\r".join([HEADER, *POINTS[:3], "x,1", *POINTS[3:]]).encode("utf-16"), where="t.csv")
    assert [(p.code, p.where) for p in caught.value.problems] == [("trace.not_number", "t.csv:5")]
    with pytest.raises(ProfileError) as caught:
        parse_trace(b"\xff\xfea", where="t.csv")
    assert caught.value.problems[0].code == "trace.not_utf8"


CIRCLE = [f"{math.cos(math.pi * i / 8)!r},{math.sin(math.pi * i / 8)!r}" for i in range(16)]


def test_a_point_in_the_plane_stands_there_once() -> None:
    (problem,) = problems("x_mm,y_mm", *CIRCLE, CIRCLE[3])
    assert (problem.code, problem.where, problem.limit) == ("trace.duplicate_point", "t.csv:18", "t.csv:5")
    assert problem.value.startswith(CIRCLE[3][:20]) and problem.key == "x_mm,y_mm"
    repeated = problems("x_mm,y_mm", *CIRCLE, CIRCLE[1], CIRCLE[1], CIRCLE[1], CIRCLE[1])
    assert [p.where for p in repeated] == [f"t.csv:{line}" for line in range(18, 22)]


def test_a_contour_in_the_plane_may_be_closed() -> None:
    assert parsed("x_mm,y_mm", *CIRCLE, CIRCLE[0]).angle_deg.size == 16
    (problem,) = problems("x_mm,y_mm", *CIRCLE[:15], CIRCLE[0], CIRCLE[15])
    assert (problem.code, problem.where, problem.limit) == ("trace.duplicate_point", "t.csv:17", "t.csv:2")
