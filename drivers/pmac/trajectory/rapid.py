"""RAPID moves: every motor of the line is jogged, all in the time of the slowest.

Source: PMAC User Manual and Turbo User Manual, rapid-mode moves. The times are made equal before acceleration is
added, so that motors with different Ix19 to Ix21 finish at different times.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from drivers.pmac.trajectory.jog import JogSettings, jog_in, jog_time_ms
from drivers.pmac.trajectory.pieces import Cubic, Piece, Vector

SLIVER_MS = 1e-9
"""Ends of pieces this close to each other are one."""


def rapid_time_ms(start: Vector, target: Vector, settings: Sequence[JogSettings]) -> float:
    """Return the time of the slowest motor, before acceleration is added."""
    return max(
        jog_time_ms(there - here, motor) for here, there, motor in zip(start, target, settings, strict=True)
    )


def rapid(start: Vector, target: Vector, settings: Sequence[JogSettings]) -> tuple[Piece, ...]:
    """Move from rest at `start` to rest at `target` (counts); a motor without a distance stands still.

    Raises:
        NoAccelerationTimeError: Ix20 and Ix21 of a motor are both zero.
    """
    tm_ms = rapid_time_ms(start, target, settings)
    tracks = [
        jog_in(here, there, motor, tm_ms) for here, there, motor in zip(start, target, settings, strict=True)
    ]
    return together(tracks, target)


def together(tracks: Sequence[Sequence[Piece]], rest: Vector) -> tuple[Piece, ...]:
    """Join tracks of one motor each, starting together, into pieces of all; one that has ended is at `rest`."""
    ends = sorted({end for track in tracks for end in _ends(track)})
    times = [0.0]
    times += [end for end in ends if end - times[-1] > SLIVER_MS]
    return tuple(
        Piece(
            after - before,
            tuple(_cubic_at(track, before, still) for track, still in zip(tracks, rest, strict=True)),
        )
        for before, after in pairwise(times)
    )


def _ends(track: Sequence[Piece]) -> list[float]:
    ends, elapsed_ms = [], 0.0
    for piece in track:
        elapsed_ms += piece.duration_ms
        ends.append(elapsed_ms)
    return ends


def _cubic_at(track: Sequence[Piece], instant_ms: float, still: float) -> Cubic:
    """Return the active cubic at an instant, with its time counted from there."""
    begin_ms = 0.0
    for piece in track:
        end_ms = begin_ms + piece.duration_ms
        if end_ms - instant_ms > SLIVER_MS:
            return _later(piece.cubics[0], instant_ms - begin_ms)
        begin_ms = end_ms
    return (still, 0.0, 0.0, 0.0)


def _later(cubic: Cubic, t_ms: float) -> Cubic:
    """Return the same motion with its time counted from `t_ms` after its beginning."""
    c0, c1, c2, c3 = cubic
    return (
        ((c3 * t_ms + c2) * t_ms + c1) * t_ms + c0,
        (3.0 * c3 * t_ms + 2.0 * c2) * t_ms + c1,
        3.0 * c3 * t_ms + c2,
        c3,
    )
