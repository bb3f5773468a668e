"""The oval of a blank in its finger-tight readings, and how much of it a cut copies."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from profiles.fingerprint.blank_form import blank_oval
from profiles.fingerprint.readings import ClampReadings
from profiles.store import load_job, load_machine

JOB, MACHINE = load_job("lee-2001-experiment-1").job, load_machine("lee-2001-lathe").machine


def readings(places: int, *, inward: bool = False) -> ClampReadings:
    """10 um of oval, high at 20 degrees of the spindle, and 25 um of run-out; at full force a lobe comes in."""
    angles = [360.0 * place / places for place in range(places)]
    sign = -1.0 if inward else 1.0
    own = [
        10.0 * math.cos(2.0 * math.radians(angle - 20.0)) + 25.0 * math.cos(math.radians(angle - 70.0))
        for angle in angles
    ]
    lobe = [30.0 * math.cos(math.radians(3.0 * angle)) for angle in angles]
    return ClampReadings(
        angle_deg=tuple(angles),
        finger_um=tuple(sign * each for each in own),
        full_um=tuple(sign * (each - more) for each, more in zip(own, lobe, strict=True)),
        graduation_um=0.1,
        inward=inward,
    )


@pytest.mark.parametrize("inward", [False, True])
def test_the_oval_is_that_of_the_blank_whatever_the_force_does(inward: bool) -> None:
    found = blank_oval(readings(8, inward=inward), JOB, MACHINE)
    assert found is not None
    assert found.wave.amplitude_um == pytest.approx(10.0, abs=0.01)
    assert found.wave.phase_deg % 180.0 == pytest.approx(20.0, abs=0.1)
    assert 0.0 < found.limit_um < 0.5


def test_the_cut_copies_what_springs_in_series_copy() -> None:
    """By hand: 2.96 N at 0.1 mm; the loop gives 2.59 um/N at 33.3 Hz, the wall 0.25: c k / (1 + c k) of both."""
    found = blank_oval(readings(8), JOB, MACHINE)
    assert found is not None and found.copied is not None and found.copied_by_part is not None
    per_um = 2.96 / 100.0
    assert found.copied == pytest.approx(per_um * 2.83 / (1.0 + per_um * 2.83), rel=0.03)
    assert found.copied_by_part == pytest.approx(per_um * 0.245 / (1.0 + per_um * 0.245), rel=0.03)


def test_what_cannot_be_told_from_the_lobe_is_not_said() -> None:
    assert blank_oval(readings(6), JOB, MACHINE) is None
    assert blank_oval(readings(12), replace(JOB, jaws=2), MACHINE) is None
    unknown = blank_oval(readings(8), replace(JOB, material="cheese"), MACHINE)
    assert unknown is not None and unknown.copied is None
