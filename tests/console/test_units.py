"""Lengths in inches: converted once, nothing lost, and what is typed is what is kept."""

from __future__ import annotations

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.typed_number import stored_length, typed_length
from console.text.catalogue import load
from console.tui.pages.fields import FORM, entry_of, judge, limit_of, written
from console.units import METRIC, Units
from profiles.problem import Problem, ProfileError
from tests.tui.stage import experiment

INCH = Units("inch")
FIELDS = {field.key: field for field in FORM}
MM_IN_AN_INCH = Decimal("25.4")  # exactly, by the international yard and pound agreement of 1959


@pytest.mark.parametrize(
    ("value", "unit", "decimals", "shown"),
    [
        (25.4, "mm", 3, "1.00000 in"),
        (0.001, "mm", 3, "0.00004 in"),
        (52.0, "mm", 1, "2.047 in"),
        (76.0131, "mm", 4, "2.992642 in"),
        (2.54, "um", 2, "100.0 uin"),
        (1.0, "um", 0, "39 uin"),
        (50.8, "mm/s", 1, "2.000 in/s"),
        (0.127, "mm/rev", 3, "0.00500 in/rev"),
        (1000.0, "rpm", 0, "1000 rpm"),
        (12.5, "N/um", 1, "12.5 N/um"),
    ],
)
def test_a_value_is_shown_in_inches(value: float, unit: str, decimals: int, shown: str) -> None:
    assert INCH.show(value, unit, decimals) == shown
    assert METRIC.show(value, unit, decimals) == f"{value:.{decimals}f} {unit}"


SHOWN = st.sampled_from([("mm", 3), ("mm", 1), ("mm", 4), ("um", 2), ("um", 1)])


@given(st.integers(-5_000_000, 5_000_000), SHOWN)
def test_what_millimetres_tell_apart_inches_tell_apart(steps: int, shown: tuple[str, int]) -> None:
    unit, decimals = shown
    values = [steps / 10**decimals, (steps + 1) / 10**decimals]
    assert len({INCH.figure(value, unit, decimals) for value in values}) == 2


@given(st.decimals(min_value="0.0001", max_value="19", places=6), st.booleans())
def test_what_is_typed_is_kept_exactly_and_shown_again_as_typed(typed: Decimal, comma: bool) -> None:
    text = f"{typed:f}".replace(".", ",") if comma and typed < 1 else f"{typed:f}"
    judged = judge(experiment(), FIELDS["diameter_mm"], text, INCH)
    assert judged.problems == ()
    kept = judged.work.job.diameter_mm
    assert Decimal(repr(kept)) == Decimal(repr(float(typed * MM_IN_AN_INCH)))
    assert Decimal(written(FIELDS["diameter_mm"], judged.work.job, INCH)) == typed


@given(st.floats(0.001, 500.0))
def test_an_entry_that_is_left_as_it_began_keeps_every_digit(value_mm: float) -> None:
    work = judge(experiment(), FIELDS["overhang_mm"], f"{Decimal(repr(value_mm)):f}", METRIC).work
    began = entry_of(FIELDS["overhang_mm"], work, INCH)
    assert judge(work, FIELDS["overhang_mm"], f" {began} ", INCH).work is work


@pytest.mark.parametrize("key", [field.key for field in FORM if field.rule.unit in ("mm", "um", "mm/rev")])
def test_the_shown_range_is_that_of_the_field(key: str) -> None:
    field = FIELDS[key]
    assert limit_of(field, METRIC) == field.rule.limit
    *_, most = limit_of(field, INCH).split(", ")
    sign, number, unit = most.split(" ")
    assert (sign, unit) == ("<=", INCH.unit(field.rule.unit))
    assert judge(experiment(), field, number, INCH).problems == ()
    beyond = f"{Decimal(number) * Decimal('1.001'):f}"
    (problem,) = judge(experiment(), field, beyond, INCH).problems
    assert (problem.code, problem.value, problem.limit) == ("value.out_of_range", beyond, limit_of(field, INCH))


def test_a_number_that_could_be_two_is_refused_in_inches_too() -> None:
    with pytest.raises(ProfileError) as error:
        stored_length("1,234", "diameter_mm", "", "mm", INCH)
    assert [problem.code for problem in error.value.problems] == ["value.ambiguous"]
    assert typed_length("0,5", "z", "", "mm", INCH) == 12.7
    assert typed_length("0,5", "c", "", "°", INCH) == 0.5
    with pytest.raises(ProfileError):
        typed_length("half", "z", "", "mm", INCH)


def test_a_message_has_both_units() -> None:
    metric = "the target 300.000 mm is out of range; allowed 0.000 … 254.000 mm, ± 2.5 um, 3 mm/s, 5 N/um"
    assert INCH.beside(metric) == (
        "the target 300.000 mm (11.81102 in) is out of range; allowed 0.000 … 254.000 mm (0.00000 … 10.00000 in), "
        "± 2.5 um (98 uin), 3 mm/s (0.12 in/s), 5 N/um"
    )
    assert METRIC.beside(metric) == metric


def test_commands_speak_in_millimetres_whatever_a_screen_shows() -> None:
    problem = Problem(code="screen.number_out_of_range", value="3.0 mm", limit="<= 2.0 mm")
    assert "in)" not in load("en").problem(problem)
