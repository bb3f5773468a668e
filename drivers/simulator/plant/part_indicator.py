"""An indicator on the part in the simulated chuck: read finger-tight and at full force, at the same places.

The stylus is set to the mark by eye, once for a lathe. The part is turned by hand, once round each way, so that
the play of the dial pulls both ways.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.fingerprint.readings import ClampReadings

LEAST_PLACES, PLACES_A_LOBE = 16, 5  # enough for the second harmonic of the lobe, too
FORCE_DIGITS = 10  # N: to that a hand would state the force of finger-tight

Surface = Callable[[float], float]
"""How far out the clamped surface is, um, at an angle of the part from the spindle index, deg."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FromJaw:
    """Places that count from jaw 1, which is at this angle of the spindle."""

    places: int
    jaw_1_deg: float


class PartIndicator:
    """The indicator of one lathe."""

    def __init__(self, true: TrueParameters) -> None:
        self._chance = true.chance("part indicator")
        self._noise_um, self._play_um = true.indicator_noise_um, 0.5 * true.indicator_backlash_um
        self._graduation_um = true.indicator_graduation_um
        self._off_deg = self._chance.gauss(0.0, true.gauge_mark_sd_deg)
        if true.parts_before:
            self._chance = true.chance_of_part("part indicator")
        self._finger_fraction = true.finger_force_fraction

    def readings(
        self, finger: Surface, full: Surface, jaws: int, force_n: float, from_jaw_1: FromJaw | None = None
    ) -> ClampReadings:
        """Return the readings of both states, each once round and back.

        With `from_jaw_1` they are at that number of places, which count from jaw 1, and once round alone.
        """
        places = max(LEAST_PLACES, PLACES_A_LOBE * jaws) if from_jaw_1 is None else from_jaw_1.places
        jaw_1_deg = 0.0 if from_jaw_1 is None else from_jaw_1.jaw_1_deg
        once = [360.0 * place / places for place in range(places)]
        angles = once if from_jaw_1 is not None else [*once, *reversed(once)]
        at = [angle + jaw_1_deg for angle in angles]
        said_n = FORCE_DIGITS * round(self._finger_fraction * force_n / FORCE_DIGITS)
        return ClampReadings(
            angle_deg=tuple(angles),
            finger_um=self._read(finger, at),
            full_um=self._read(full, at),
            from_jaw_1=from_jaw_1 is not None,
            graduation_um=self._graduation_um or None,
            finger_force_n=said_n or None,
            simulated=True,
        )

    def _read(self, surface: Surface, angles: Sequence[float]) -> tuple[float, ...]:
        """Return what the dial shows at the angles, in turn; it begins in the middle of its play."""
        shown, found = surface(angles[0] + self._off_deg), []
        for angle in angles:
            pushed = surface(angle + self._off_deg)
            shown = min(max(shown, pushed - self._play_um), pushed + self._play_um)
            read = shown + (self._chance.gauss(0.0, self._noise_um) if self._noise_um else 0.0)
            step = self._graduation_um
            found.append(step * round(read / step) if step else read)
        return tuple(found)
