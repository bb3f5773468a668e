"""Axis definitions as the manual gives them, their spelling, and the way back from motors to axes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.axes import (
    AxisDefinition,
    axis_positions,
    preset_origins,
    read_definitions,
    refuse_singular,
    scan_definition,
)
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from profiles.problem import ProfileError


def one(text: str) -> AxisDefinition:
    (definition,) = read_definitions([text])
    return definition


@pytest.mark.parametrize(
    ("text", "positions", "counts"),
    [
        ("#1->X", {"X": 12.0}, 12.0),
        ("#4->2000 A", {"A": 1.5}, 3000.0),
        ("#8->3333.333Z-666.667", {"Z": 3.0}, 9333.332),
        ("#1->8660X-5000Y", {"X": 1.0, "Y": 2.0}, -1340.0),
        ("#2->5000X+8660Y", {"X": 1.0, "Y": 2.0}, 22_320.0),
        ("#3->2000Z-6000", {"Z": 3.0}, 0.0),
        ("#6->-29.1X+100000Y", {"X": 10.0, "Y": 1.0}, 99_709.0),
        ("#1->U-V+W-10", {"U": 1.0, "V": 2.0, "W": 4.0}, -7.0),
        ("#1->-X", {"X": 3.0}, -3.0),
    ],
)
def test_the_manual_s_definitions_give_their_counts(text: str, positions: dict[str, float], counts: float) -> None:
    assert one(text).counts(positions) == pytest.approx(counts)


@pytest.mark.parametrize(
    ("typed", "reported"),
    [
        ("#1->8660 x - 5000 y + 10", "8660X-5000Y+10"),
        ("#1->X", "X"),
        ("#1->1X", "X"),
        ("#1->-X", "-1X"),
        ("#1->u-v", "U-1V"),
        ("#1->3333.333Z-666.667", "3333.333Z-666.667"),
        ("#1->X+0", "X"),
    ],
)
def test_a_definition_is_reported_in_one_spelling(typed: str, reported: str) -> None:
    assert str(one(typed)) == reported


@pytest.mark.parametrize(
    "text",
    ["0X", "X+0Y", "5", "X+", "X-", "", "X+A"],
    ids=["no scale", "no second scale", "no axis", "no offset", "no number", "nothing", "another three"],
)
def test_what_is_no_definition_is_err003(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        scan_definition(Scanner(text), 1)
    assert refusal.value.code == ErrorCode.DATA_ERROR
    with pytest.raises(ProfileError):
        one(f"#1->{text}")


@pytest.mark.parametrize("texts", [["X"], ["#1->X hello"], ["#->X"], ["#0->X"], ["#1->X", "#1->Y"], ["#4->é"]])
def test_a_wrong_entry_of_a_machine_profile_is_named(texts: list[str]) -> None:
    with pytest.raises(ProfileError) as refusal:
        read_definitions(texts)
    (problem,) = refusal.value.problems
    assert (problem.key, problem.value) == ("controller.axis_definitions", f'"{texts[-1]}"')


AXES = st.sampled_from(["X", "Y", "Z", "XY", "YX", "XYZ", "ZX", "U", "VW", "A", "C"])
SCALES = st.floats(-10_000, 10_000).map(lambda value: round(value, 3)).filter(bool)


@given(axes=AXES, scales=st.lists(SCALES, min_size=3, max_size=3), offset=st.integers(-9999, 9999))
def test_what_is_reported_is_read_as_the_same_definition(axes: str, scales: list[float], offset: int) -> None:
    terms = tuple(zip(axes, scales, strict=False))
    definition = AxisDefinition(motor=3, terms=terms, offset=float(offset))
    assert one(f"#3->{definition}") == definition


@given(x=st.floats(-1000, 1000), y=st.floats(-1000, 1000), z=st.floats(-1000, 1000))
def test_axis_positions_are_found_again_from_the_motors(x: float, y: float, z: float) -> None:
    read = read_definitions(["#1->8660X-5000Y+10", "#2->5000X+8660Y", "#3->29.1X-7Y+2000Z-6000"])
    by_motor = {definition.motor: definition for definition in read}
    counts = {motor: d.counts({"X": x, "Y": y, "Z": z}) for motor, d in by_motor.items()}
    found = axis_positions(by_motor, counts)
    assert found == pytest.approx({"X": x, "Y": y, "Z": z}, abs=1e-9)


def test_of_two_motors_on_an_axis_the_lower_number_says_where_it_is() -> None:
    by_motor = {d.motor: d for d in read_definitions(["#3->10Y", "#2->10Y"])}
    assert axis_positions(by_motor, {2: 50.0, 3: 70.0}) == {"Y": 5.0}


def test_an_axis_that_the_motors_do_not_determine_is_at_0() -> None:
    by_motor = {d.motor: d for d in read_definitions(["#1->10X+5Y"])}
    assert axis_positions(by_motor, {1: 50.0}) == {"X": 5.0, "Y": 0.0}


@pytest.mark.parametrize(
    "texts",
    [["#1->X+Y", "#2->X+Y"], ["#1->X+Y", "#2->2X+2Y-5", "#3->Z"], ["#1->X+Y", "#2->Y+Z", "#3->X+2Y+Z"]],
)
def test_motors_that_depend_on_one_another_are_err003(texts: list[str]) -> None:
    with pytest.raises(PmacError) as refusal:
        refuse_singular(read_definitions(texts))
    assert refusal.value.code == ErrorCode.DATA_ERROR


@pytest.mark.parametrize(
    "texts",
    [["#1->X+Y"], ["#1->X", "#2->X"], ["#1->X+Y", "#2->X-Y", "#3->X+Y"], ["#1->Z", "#2->Z", "#3->X+Y"], []],
    ids=["not yet complete", "a gantry", "a gantry of sums", "one group of two", "none"],
)
def test_gantries_and_what_is_not_yet_complete_are_allowed(texts: list[str]) -> None:
    refuse_singular(read_definitions(texts))


def test_a_preset_axis_is_where_it_was_told_to_be() -> None:
    (definition,) = read_definitions(["#1->100X+50"])
    origins = preset_origins({}, {"X": 3.0}, {"X": 10.0})
    assert origins == {"X": 7.0}
    moved = definition.shifted(origins)
    assert moved.counts({"X": 10.0}) == definition.counts({"X": 3.0})
    assert axis_positions({1: moved}, {1: 350.0}) == {"X": 10.0}


def test_a_second_preset_starts_from_the_first() -> None:
    once = preset_origins({}, {"X": 3.0, "Y": 1.0}, {"X": 10.0, "Y": 4.0})
    twice = preset_origins(once, {"X": 12.0, "Y": 4.0}, {"X": 0.0})
    assert twice == {"X": -5.0, "Y": 3.0}
    assert preset_origins(twice, {"X": 1.0, "Y": 4.0}, {"X": 6.0, "Q": 1.0}) == {"Y": 3.0}
