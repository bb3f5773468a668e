"""A table of measurements as a spreadsheet exports it, and what is refused of one, with its line."""

from __future__ import annotations

import pytest

from profiles.calibration.table import CalibrationKind, column_name, parse_table
from profiles.problem import ProfileError

PLAIN = "torque_n_m,force_n\n10,3700\n20.5,7400\n"


def refused(text: str | bytes, kind: CalibrationKind | None = None) -> list[tuple[str, str, str]]:
    with pytest.raises(ProfileError) as caught:
        parse_table(text.encode() if isinstance(text, str) else text, kind, where="t.csv")
    return [
        (problem.code.removeprefix("calibration."), problem.where, problem.key)
        for problem in caught.value.problems
    ]


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        "\ufeff" + PLAIN.replace("\n", "\r\n"),
        "Torque (N·m);Force [N];remark\n10;3700;\n\n20,5;7400;second pull\n;;\n",
        "note\tForce N\ttorque Nm\n1\t3700\t10\n2\t7400\t20,5\n",
        '# bench: 2\n# free words\n"torque_n_m","force_n"\n"10","3700"\n# later\n20.5,7.4e3,,\n',
    ],
)
def test_what_a_spreadsheet_writes_is_read(text: str) -> None:
    table = parse_table(text.encode())
    assert table.kind is CalibrationKind.WRENCH
    assert table.columns["torque_n_m"].tolist() == [10.0, 20.5]
    assert table.columns["force_n"].tolist() == [3700.0, 7400.0]


def test_utf_16_header_lines_and_unused_columns_are_told() -> None:
    text = "# Jaws: 3\nTorque (N m)\tForce (N)\tby\n10\t3700\tme\n"
    table = parse_table(text.encode("utf-16"))
    assert (dict(table.meta), table.ignored, table.lines) == ({"jaws": "3"}, ("by",), (3,))


def test_headings_with_their_units() -> None:
    names = ("Deflection (µm)", "Angle [°]", "Chucking force, N", "torque Nm")
    assert [column_name(name) for name in names] == [
        "deflection_um",
        "angle_deg",
        "chucking_force_n",
        "torque_n_m",
    ]


def test_every_wrong_row_is_named_with_its_line() -> None:
    text = 'torque_n_m,force_n\n10,3700\n-5,100\n1_0,100\n5\n7,nan\n8,"1,5"\n'
    assert refused(text) == [
        ("out_of_range", "t.csv:3", "torque_n_m"),
        ("not_number", "t.csv:4", "torque_n_m"),
        ("cells", "t.csv:5", ""),
        ("not_number", "t.csv:6", "force_n"),
        ("not_number", "t.csv:7", "force_n"),
    ]


def test_what_spoils_the_whole_file_is_told_once() -> None:
    assert refused("torque_n_m;force_n\n10,5;3700\n20.5;1\n") == [("mixed_decimals", "t.csv:3", "torque_n_m")]
    assert refused("torque,force\n1,2\n") == [("columns", "t.csv:1", "")]
    assert refused("torque_n_m,force_n,force_n\n1,2,3\n") == [("columns", "t.csv:1", "")]
    assert refused("") == [("empty", "t.csv", "")]
    assert refused(PLAIN, CalibrationKind.DEFLECTION) == [("columns", "t.csv:1", "")]
    assert refused(PLAIN.encode() + b"\xb5") == [("not_text", "t.csv:4", "")]
    assert refused("# a: 1\n# a: 2\n" + PLAIN) == [("meta", "t.csv:2", "")]
    assert len(refused("torque_n_m,force_n\n" + "x,1\n" * 100)) == 20


def test_a_table_of_more_rows_than_anybody_measures_is_refused() -> None:
    with pytest.raises(ProfileError) as caught:
        parse_table(b"torque_n_m;force_n\n" + b"10;1000\n" * 10_001, where="t.csv")
    (problem,) = caught.value.problems
    assert (problem.code, problem.where) == ("calibration.too_large", "t.csv:10002")
    assert (problem.value, problem.limit) == ("> 10000 rows", "<= 10000 rows")
