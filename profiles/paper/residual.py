"""The residual of a cut: the commanded trajectory through the servo that followed it.

The part stands high by (E/2) cos(phase); the tool goes in by E sum c_k Re(T(k f) exp(j k phase)), see `prog_1`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, floats

Servo = Callable[[ArrayLike], Complexes]
"""From frequencies in Hz to responses."""

PLACES = 3600


def ideal_servo(frequency_hz: ArrayLike) -> Complexes:
    """Return 1 at every frequency."""
    return np.ones(np.shape(frequency_hz), dtype=np.complex128)


def left_um(
    error_um_pp: float, waves: Mapping[int, float], servo: Servo, lobe_hz: float, phase_rad: ArrayLike
) -> Floats:
    """Return the deviation of the part at phases of the lobe, in their shape; positive where it stands high."""
    phase = floats(phase_rad)
    moved = np.zeros(phase.shape)
    responses = servo(np.array(list(waves), dtype=np.float64) * lobe_hz)
    for (k, share), response in zip(waves.items(), responses, strict=True):
        moved += share * np.real(response * np.exp(1j * k * phase))
    return floats(error_um_pp * (0.5 * np.cos(phase) - moved))


def left_um_pp(error_um_pp: float, waves: Mapping[int, float], servo: Servo, lobe_hz: float) -> float:
    """Return the remaining roundness error: order N does not move the centre of a circle."""
    phase = 2 * np.pi * np.arange(PLACES) / PLACES
    return float(np.ptp(left_um(error_um_pp, waves, servo, lobe_hz, phase)))


def left_by_compliance_um_pp(error_um_pp: float, depth_um: float, mean_shift_um: float) -> float:
    """Return the lobe that a perfect sine leaves where the error is caused by compliance, in proportion to depth.

    removed = s (depth + shift - tool), s = s0 + (E / 2 D) sin(3 angle), and s0 = 1 - E / (2 D), because nothing
    is cut deeper than the tool goes: E (1 - s0) + E shift / D are left.
    """
    share = error_um_pp / (2 * depth_um)
    return error_um_pp * share + error_um_pp * mean_shift_um / depth_um
