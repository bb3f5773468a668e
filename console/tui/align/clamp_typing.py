"""Indicator readings of a clamping as they are typed: the number of places, then all of both states. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

from profiles.fingerprint.readings import ClampReadings

MOST_TYPED = 48
GRADUATION_UM, INCH_GRADUATION_UM = 1.0, 2.54
"""Of the dial that is taken for what somebody reads: 0.001 mm, or 0.0001 in where lengths are shown in inches."""

STATES = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampTyping:
    """What was typed so far for the clamping that was made `at`: places, and readings, um, finger-tight first."""

    at: str = ""
    places: int = 0
    values: tuple[float, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether every place was read in both states."""
        return 0 < self.places * STATES == len(self.values)

    @property
    def full(self) -> bool:
        """Whether the next reading is one at full force."""
        return len(self.values) >= self.places

    @property
    def place(self) -> int:
        """The place of the next reading, from 0."""
        return len(self.values) % self.places if self.places else 0

    @property
    def angle_deg(self) -> float:
        """The angle of the next place from jaw 1, in the direction of the spindle."""
        return 360.0 * self.place / self.places if self.places else 0.0

    def with_value(self, value: float) -> ClampTyping:
        """Return it with the number of places, or the next reading."""
        if not self.places:
            return replace(self, places=round(value))
        return replace(self, values=(*self.values, value))

    def dropped(self) -> ClampTyping:
        """Return it without the last thing typed."""
        return replace(self, values=self.values[:-1]) if self.values else replace(self, places=0)

    def readings(self, *, simulated: bool, inch: bool = False) -> ClampReadings:
        """Return the readings, of a complete one; `inch`: those of a dial in inches."""
        return ClampReadings(
            angle_deg=tuple(360.0 * place / self.places for place in range(self.places)),
            finger_um=self.values[: self.places],
            full_um=self.values[self.places :],
            from_jaw_1=True,
            graduation_um=INCH_GRADUATION_UM if inch else GRADUATION_UM,
            simulated=simulated,
        )


NOTHING_TYPED = ClampTyping()
