"""Gathered numbers become the words of a register all at once, as one by one."""

from __future__ import annotations

from math import floor, inf, isfinite, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.gathering.gather import packed


def test_a_register_holds_the_nearest_integer_halves_up_below_zero_as_a_complement() -> None:
    assert packed([[2.5, -2.5, -0.2]], (3,), b"") == bytes.fromhex("030000 feffff 000000")


def test_a_sample_has_its_sources_one_after_the_other_and_then_its_padding() -> None:
    assert packed([[1.0, 2.0], [-1.0, 256.0]], (6, 3), b"\xab\xcd\xef") == bytes.fromhex(
        "010000000000 ffffff abcdef 020000000000 000100 abcdef"
    )


@pytest.mark.parametrize(("value", "word"), [(nan, "000000"), (inf, "000000"), (2.0**80 + 2.0**40, "000000")])
def test_what_no_register_holds_leaves_the_other_samples_alone(value: float, word: str) -> None:
    assert packed([[1.0, value, -1.0]], (3,), b"") == bytes.fromhex(f"010000 {word} ffffff")


@given(st.lists(st.floats() | st.floats(-1e15, 1e15), min_size=1), st.sampled_from((3, 6)))
def test_many_are_packed_as_each_by_itself(values: list[float], width: int) -> None:
    whole = (floor(value + 0.5) if isfinite(value) else 0 for value in values)
    assert packed([values], (width,), b"") == b"".join(
        (each % 256**width).to_bytes(width, "little") for each in whole
    )
