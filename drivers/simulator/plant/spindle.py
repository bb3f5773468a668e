"""The spindle of a lathe with any drive, and its speed ripple."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.simulator.card.servo import Axis
from drivers.simulator.plant.ripple import Ripple


class Spindle:
    """A rotary axis: one of the drives, and a ripple after it that its loop does not see.

    `speed_ripple` is the fraction by which the speed oscillates about its mean, `ripple_per_turn` times a turn.
    """

    def __init__(
        self,
        drive: Axis,
        counts_per_turn: float,
        cycle_s: float,
        built: tuple[float, int] = (0.0, 2),
        phase_rad: float = 0.0,
    ) -> None:
        """`built` is its ripple without a fault: the fraction, and the cycles per turn."""
        self.drive = drive
        self._built = built
        self.speed_ripple, self.ripple_per_turn = built
        self._ripple = Ripple(counts_per_turn, cycle_s, phase_rad)

    def swing_as_built(self) -> None:
        """Restore the ripple without a fault."""
        self.speed_ripple, self.ripple_per_turn = self._built

    @property
    def origin(self) -> float:
        """Machine position of motor zero."""
        return self.drive.origin

    @origin.setter
    def origin(self, counts: float) -> None:
        self.drive.origin = counts

    @property
    def encoder_lost(self) -> bool:
        """Whether the encoder does not count."""
        return self.drive.encoder_lost

    @encoder_lost.setter
    def encoder_lost(self, lost: bool) -> None:
        self.drive.encoder_lost = lost

    @property
    def jammed(self) -> bool:
        """Whether the axis stands still whatever the force."""
        return self.drive.jammed

    @jammed.setter
    def jammed(self, jammed: bool) -> None:
        self.drive.jammed = jammed

    def close_loop(self) -> float:
        """Hold the present mean position; the ripple is a following error."""
        return self.drive.close_loop()

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`."""
        self.drive.rebase(counts)

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Run one servo cycle per command."""
        return self._turned(self.drive.follow(commands))

    def push(self, output: float, cycles: int) -> list[float]:
        """Run in open loop."""
        return self._turned(self.drive.push(output, cycles))

    def coast(self, cycles: int) -> list[float]:
        """Run with the amplifier disabled."""
        return self._turned(self.drive.coast(cycles))

    def _turned(self, track: list[float]) -> list[float]:
        if not (self.speed_ripple or self._ripple.swings):
            return track
        return self._ripple.swing(
            track, self.origin, self.speed_ripple, self.ripple_per_turn, jammed=self.drive.jammed
        )
