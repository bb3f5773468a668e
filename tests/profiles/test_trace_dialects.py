"""Traces as other programs write them: what means the same is taken, what does not is named once."""

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
        (["angle_deg;deviation_um", "1.234,5;0"], "trace.mixed_decimals", 2),
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
