"""Numbers as six countries write them, in every file that is imported: read as meant and shown, or refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from profiles.calibration.table import MeasuredTable, parse_table
from profiles.problem import Problem, ProfileError
from profiles.trace_files.header import header_of
from profiles.trace_files.number_marks import number_readings
from profiles.traces import Trace, parse_trace, read_trace, write_trace

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


def test_numbers_above_the_columns_in_remarks_and_with_the_other_mark_settle_nothing() -> None:
    assert refusal(trace, ["6,150"], ";", "# room: 20,5", "# 20,5").code == "value.two_readings"
    assert refusal(trace, ["6,150", "12.5"], ";").code == "value.two_readings"
    text = "torque_n_m;force_n\n4;1,234\n# 12,5\n5;1,500\n"
    assert refusal(parse_table, text.encode()).code == "value.two_readings"
    assert refusal(wrench, ["12,5", "1,234", "0.5"], ";").code == "calibration.mixed_decimals"


def test_the_other_column_settles_the_same_mark() -> None:
    rows = [f"{angle + 0.5}".replace(".", ",") + ";6,150" for angle in ANGLES]
    assert parse_trace("\n".join(["angle_deg;deviation_nm", *rows]).encode()).deviation_um[0] == 0.00615
    rows = [f"{angle:.3f}\t{angle + 1:.3f}" for angle in ANGLES]  # begins with 0.000
    assert parse_trace("\n".join(["angle_deg\tdeviation_um", *rows]).encode()).deviation_um[1] == 21.0


def test_where_commas_separate_a_point_is_the_decimal_sign_and_a_quoted_comma_is_not() -> None:
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
