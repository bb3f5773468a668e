"""The shape-preserving cubic: the same as scipy's, whatever the points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from profiles.axis.response import monotone_cubic


@settings(max_examples=60)
@given(
    steps=st.lists(st.floats(0.1, 50.0), min_size=1, max_size=12),
    values=st.lists(st.sampled_from([-3.0, 0.0, 0.25, 1.0, 7.5]), min_size=13, max_size=13),
)
def test_it_is_the_curve_of_scipy(steps: list[float], values: list[float]) -> None:
    from scipy.interpolate import PchipInterpolator

    x = np.concatenate(([1.0], 1.0 + np.cumsum(steps)))
    y = np.array(values[: x.size])
    at = np.linspace(x[0], x[-1], 101)
    assert monotone_cubic(x, y, at) == pytest.approx(PchipInterpolator(x, y)(at), abs=1e-9)


def test_it_keeps_to_the_values_beside_it_and_passes_through_its_points() -> None:
    x, y = np.array([10.0, 30.0, 50.0, 80.0]), np.array([1.0, 0.9, 0.9, 0.5])
    assert monotone_cubic(x, y, x) == pytest.approx(y)
    between = monotone_cubic(x, y, np.linspace(30.0, 50.0, 11))
    assert between == pytest.approx(0.9)
    assert (np.diff(monotone_cubic(x, y, np.linspace(10.0, 80.0, 200))) <= 1e-12).all()
