"""The jaws of a chuck and the ring that they bend: lobe, oval of a harder jaw, overtone."""

from __future__ import annotations

from dataclasses import dataclass

JAW_STIFFNESS_N_PER_UM = 50.0  # radial stiffness of a jaw with its guide and its contact, a usual value
OVAL = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Jaws:
    """The jaws of a chuck holding a ring with `force_n` in all, jaw 1 a fraction `first_harder` above the mean.

    A radial load bends a ring n times a turn by 1 / (n^2 - 1)^2 of it: an oval is softer than any lobe. Loads W_i
    at angles a_i make a harmonic of sum W_i cos n (angle - a_i). With jaw 1 the fraction d above the mean, the
    others below it, and n no multiple of the N jaws, that is W d N / (N - 1) against the N W of the lobe.
    """

    count: int
    force_n: float
    first_harder: float

    @property
    def oval_fraction(self) -> float:
        """Amplitude of the second harmonic over that of the lobe; two jaws make their lobe of it."""
        if self.count == OVAL:
            return 0.0
        softer = (self.count**2 - 1) ** 2 / (OVAL**2 - 1) ** 2
        return self.first_harder / (self.count - 1) * softer

    @property
    def shift_um(self) -> float:
        """The displacement of the whole part off the axis by jaw 1, against the stiffness N k / 2 of the chuck.

        Two opposite jaws are stiff by 2 k along their line, and rigid across it.
        """
        unbalanced_n = self.force_n / self.count * self.first_harder * self.count / (self.count - 1)
        stiffness = JAW_STIFFNESS_N_PER_UM * (self.count if self.count == OVAL else self.count / 2.0)
        return unbalanced_n / stiffness


def ring_overtone(jaws: int) -> float:
    """Return the harmonic of order 2N over the lobe of a ring under N equal radial loads: 0.052 of three jaws.

    Both are highest at the jaws: a load bends a ring n times a turn by 1 / (n^2 - 1)^2 of it, and all multiples
    of N have the same phase.
    """
    return ((jaws**2 - 1) / ((2 * jaws) ** 2 - 1)) ** 2
