"""The coefficients of a notch filter: which a controller takes, and what it makes of them by each reading."""

from __future__ import annotations

import pytest

from profiles.axis.notch import Notch, Reading, is_coefficient
from profiles.fields import fault
from profiles.machine_fields import NOTCH_KEYS, SECTIONS

FIELDS = [field for field in SECTIONS["tool"] if field.key in NOTCH_KEYS]


@pytest.mark.parametrize(("value", "taken"), [(-2.0, True), (1.999, True), (2.0, False), (-2.001, False)])
def test_a_profile_may_state_what_a_controller_takes_as_it_is(value: float, taken: bool) -> None:
    """24 bits, 22 behind the point: 2 would be taken for -2 (tests/drivers/test_notch_filter.py)."""
    assert is_coefficient(value) is taken
    assert len(FIELDS) == 4
    for field in FIELDS:
        assert fault(field, value) == ("" if taken else "value.out_of_range") and field.limit == ">= -2, < 2"


@pytest.mark.parametrize(
    ("reading", "signs"),
    [
        (Reading.STATED, (1, 1, 1, 1)),
        (Reading.NUMERATOR, (-1, -1, 1, 1)),
        (Reading.DENOMINATOR, (1, 1, -1, -1)),
        (Reading.BOTH, (-1, -1, -1, -1)),
    ],
)
def test_another_reading_turns_the_signs_of_the_zeros_of_the_poles_or_of_both(
    reading: Reading, signs: tuple[int, ...]
) -> None:
    notch = Notch(n1=-0.5, n2=0.25, d1=-0.125, d2=0.0625)
    turned = tuple(sign * each for sign, each in zip(signs, notch.coefficients, strict=True))
    assert notch.read_as(reading).coefficients == turned
