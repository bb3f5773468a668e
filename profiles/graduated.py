"""The first part with a compensation nobody has tried: a share of it, from which sign and angle can be judged.

A lobe E that is compensated by the share s leaves E |1 - s c|, with c = 1 where the tool does what it was meant to
do. With half of it a wrong sign (c = -1) leaves 3/2 E, and one that is off by d degrees of spindle
E |1 - exp(-j N d) / 2|: the part is worse by half a lobe at most, and the two cases are a whole lobe apart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from profiles.compensation import CutPath, LobedPath, residual_um_pp

PARTIAL_SHARE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """What is left of the lobe, um p-p: with sign and angle as meant, and with the sign (or half a lobe) wrong."""

    right_um_pp: float
    wrong_um_pp: float


def share_of(path: CutPath, share: float) -> CutPath:
    """Return a path with this share of its waves, at the same mean; axes answer in proportion."""
    return CutPath(wanted=_shared(path.wanted, share), command=_shared(path.command, share))


def expected(lobe_um_pp: float, share: float) -> Expected:
    """Return what a share of the compensation leaves of a lobe of `lobe_um_pp`."""
    return Expected(
        right_um_pp=residual_um_pp(lobe_um_pp, share),
        wrong_um_pp=residual_um_pp(lobe_um_pp, -share),
    )


def _shared(path: LobedPath, share: float) -> LobedPath:
    overtones = tuple(replace(wave, amplitude_um=share * wave.amplitude_um) for wave in path.overtones)
    return replace(path, amplitude_um=share * path.amplitude_um, overtones=overtones)
