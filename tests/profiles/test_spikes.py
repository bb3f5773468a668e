"""One wrong digit among the readings of a part is told; lobes, steps and noise are not taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.roundness import evaluate, spike

ANGLES_DEG = np.arange(3600) / 10.0


def part(points: int, lobes: int, um: float, noise_um: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    angle_deg = 360.0 * np.arange(points) / points
    noise = np.random.default_rng(seed).normal(0.0, noise_um, points)
    return angle_deg, um * np.cos(np.radians(lobes * angle_deg)) + noise


@pytest.mark.parametrize("wrong_um", [1000.0, -90.0, 9.0])
def test_a_flipped_digit_is_told_with_its_angle_and_its_size(wrong_um: float) -> None:
    angle_deg, deviation_um = part(3600, 3, 5.0, 0.2, 1)
    deviation_um[900] += wrong_um
    told = [each for each in evaluate(angle_deg, deviation_um).warnings if each.code == "trace.spike"]
    assert [each.key for each in told] == ["90 deg"]
    assert float(told[0].value.split()[0]) == pytest.approx(wrong_um, abs=1.0)
    assert [each.code for each in evaluate(angle_deg, deviation_um, robust=True).warnings] == []


@given(
    points=st.integers(12, 720),
    lobes=st.integers(1, 6),
    um=st.floats(0.0, 200.0),
    noise_um=st.floats(0.0, 3.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_lobed_part_with_noise_has_none(points: int, lobes: int, um: float, noise_um: float, seed: int) -> None:
    _, deviation_um = part(points, lobes, um, noise_um, seed)
    assert spike(deviation_um) is None


@given(st.integers(1, 700), st.floats(1.0, 500.0))
def test_a_step_is_none(begin: int, height_um: float) -> None:
    """A flat, a keyway, a mark where the tool dwelt."""
    deviation_um = np.zeros(720)
    deviation_um[begin : begin + 10] = height_um
    assert spike(deviation_um) is None
