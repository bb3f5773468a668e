"""A trace file is read strictly, with line numbers, and survives being written and read."""

import os
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.problem import ProfileError
from profiles.traces import Trace, parse_trace, read_trace, write_trace

POINTS = [f"{22.5 * i:g},{i % 3}" for i in range(16)]
SOUND = ["# part: 7", "angle_deg,deviation_um", *POINTS]


def found(lines: list[str], end: str = "\n") -> list[tuple[str, str]]:
    with pytest.raises(ProfileError) as caught:
        parse_trace(end.join(lines).encode(), where="t.csv")
    assert all(str(problem).isprintable() for problem in caught.value.problems)
    return [(problem.code, problem.where) for problem in caught.value.problems]


def test_a_plain_file() -> None:
    trace = parse_trace("\n".join(SOUND).encode())
    np.testing.assert_array_equal(trace.angle_deg, np.arange(16) * 22.5)
    np.testing.assert_array_equal(trace.deviation_um, np.arange(16) % 3)
    assert dict(trace.meta) == {"part": "7"}
    assert not trace.angle_deg.flags.writeable


def test_other_editors_are_welcome() -> None:
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


def test_many_bad_rows_do_not_flood() -> None:
    assert len(found([*SOUND, *["x,y"] * 1000])) == 20


def test_what_is_not_utf_8_is_refused_with_its_line() -> None:
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
