"""What a controller's servo loop is set to: its PID with limits, and its notch filter."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoGains:
    """The PID of the controller (Ix30 to Ix35, Ix08, Ix09), its notch filter (Ix36 to Ix39) and its limit Ix69.

    Of Ix63, the integrator limit, only 0 has an effect: it disables the integrator.

    Output in DAC bits = 2^-19 Ix30 (Ix08 (FE + (Ix32 CV + Ix35 CA)/128 + Ix33 IE/2^23) - Ix31 Ix09 AV/128),
    counts and counts per cycle (PMAC User Manual, PID; Software Reference, Ix30 to Ix35).
    """

    ix08: float
    ix09: float
    ix30: float
    ix31: float
    ix32: float
    ix33: float
    ix34: float
    ix35: float
    ix36: float = 0.0
    ix37: float = 0.0
    ix38: float = 0.0
    ix39: float = 0.0
    ix63: float = 4_194_304.0
    ix69: float


class NotchFilter:
    """The filter (1 + n1/z + n2/z^2) / (1 + d1/z + d2/z^2) between the PID and the limit of the output.

    It remembers what was put out, so that it comes back from the limit at once, and one whose poles are outside
    the unit circle stays at the limit.
    """

    def __init__(self, gains: ServoGains) -> None:
        self._n1, self._n2, self._d1, self._d2 = gains.ix36, gains.ix37, gains.ix38, gains.ix39
        self._in_1 = self._in_2 = self._out_1 = self._out_2 = 0.0

    def begin(self) -> None:
        """Forget everything, as where a loop is closed."""
        self._in_1 = self._in_2 = self._out_1 = self._out_2 = 0.0

    def continue_from(self, before: NotchFilter) -> None:
        """Take over what another one remembers, where coefficients change in a closed loop."""
        self._in_1, self._in_2 = before._in_1, before._in_2
        self._out_1, self._out_2 = before._out_1, before._out_2

    def filter_output(self, output: float) -> float:
        """Return the output of this cycle, still without its limit."""
        found = output + self._n1 * self._in_1 + self._n2 * self._in_2
        found -= self._d1 * self._out_1 + self._d2 * self._out_2
        self._in_1, self._in_2 = output, self._in_1
        return found

    def put_out(self, output: float) -> None:
        """Remember what was put out after all."""
        self._out_1, self._out_2 = output, self._out_1


def notch_of(gains: ServoGains) -> NotchFilter | None:
    """Return the filter of these settings; None where all four are 0."""
    return NotchFilter(gains) if gains.ix36 or gains.ix37 or gains.ix38 or gains.ix39 else None
