"""Kinds of trace files beside the plain one: dialects, units, several turns, points in the plane, surface data."""

import math

import numpy as np
import pytest

from profiles.problem import Problem, ProfileError
from profiles.roundness import evaluate
from profiles.trace_files.header import header_of
from profiles.traces import Trace, parse_trace

ANGLES = [22.5 * i for i in range(16)]
DEVIATIONS = [0.5 * (i % 3) for i in range(16)]
PLAIN = "\n".join(["angle_deg,deviation_um", *(f"{a},{d}" for a, d in zip(ANGLES, DEVIATIONS, strict=True))])


def problems(text: str) -> list[Problem]:
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


def test_equal_angles_need_not_be_written() -> None:
    text = "\n".join(["# angles: equal", "deviation_um", *map(str, DEVIATIONS)])
    same_as_plain(parse_trace(text.encode()))


def test_a_declared_range_may_be_negative() -> None:
    rows = [f"{a - 360 if a >= 180 else a},{d}" for a, d in zip(ANGLES, DEVIATIONS, strict=True)]
    text = "\n".join(["# angle_range: -180..180", "angle_deg,deviation_um", *rows[8:], *rows[:8]])
    trace = parse_trace(text.encode())
    np.testing.assert_allclose(trace.angle_deg, ANGLES[8:] + ANGLES[:8])
    closed = parse_trace(f"{text}\n180,{DEVIATIONS[8]}".encode())
    assert closed.angle_deg.size == 16
    assert [p.code for p in problems(f"{text}\n181,0")] == ["trace.out_of_range"]


def test_turns_run_on() -> None:
    rows = [f"{22.5 * i},{i}" for i in range(48)]
    trace = parse_trace("\n".join(["# turns: 3", "angle_deg,deviation_um", *rows]).encode())
    assert (trace.angle_deg[-1], trace.meta["turns"]) == (1057.5, "3")
    assert next(p.limit for p in problems("\n".join(["# turns: 2", "angle_deg,deviation_um", *rows]))) == (
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
    (problem,) = problems(f"{line}\n{PLAIN}")
    assert (problem.code, problem.where) == (code, f"t.csv:{1 + line.count(chr(10))}")
    assert problem.value and problem.limit


def test_a_unit_that_comes_too_late_is_refused() -> None:
    head, rows = PLAIN.split("\n", 1)
    assert [p.code for p in problems(f"{head}\n# units: um\n{rows}")] == ["trace.meta_late"]


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
    assert [p.code for p in problems("\n".join(["# radius_mm: 26", "x_mm;y_mm", *rows]))] == ["trace.meta"]


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
    (problem,) = problems(SDF.format(values="\n".join(map(str, DEVIATIONS))).replace(old, new, 1))
    assert (problem.code, problem.where) == (code, where)


def test_what_a_header_does_not_state_is_unknown() -> None:
    header, warnings = header_of({})
    assert (header.state, header.direction, header.jaw_1_deg, header.turns) == ("unknown", None, None, 1)
    assert (header.phase_known, header.jaw_1_of(90.0), warnings) == (False, None, ())


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
