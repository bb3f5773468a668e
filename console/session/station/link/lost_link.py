"""A lost link as a value: since when, what the console tries, and what is still valid afterwards."""

from __future__ import annotations

from dataclasses import dataclass

from console.session.cut.alignment import Alignment
from profiles.problem import Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class Validity:
    """One stamp after a lost link: `home`, `jaw`, `touch_off` or `clamping`; whether it holds, and why or why not.

    `why` is a key of the texts `validity.*`, `value` what it names: a time, the axes.
    """

    stamp: str
    holds: bool
    why: str
    value: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LostLink:
    """A link that was lost at `since_s` (machine time of the last poll), and is back since `back_s`, if it is.

    `attempts` counts how often it was tried to open it, `problem` is why the last attempt failed. `silent`: the
    link is there, and nothing answers on it. `for_ever`: there is nothing left to connect to. `validity` is known
    once the machine was read. `returned` names the checkpoint, where an instructor has gone back to one.
    """

    since_s: float
    silent: bool = False
    for_ever: bool = False
    attempts: int = 0
    problem: Problem | None = None
    back_s: float | None = None
    validity: tuple[Validity, ...] = ()
    returned: str = ""

    @property
    def away_s(self) -> float:
        """How long nothing was read, s; 0 while that lasts."""
        return 0.0 if self.back_s is None else self.back_s - self.since_s


def validity_of(
    before: Alignment,
    now: Alignment,
    *,
    homed_axes: tuple[str, ...],
    unhomed: tuple[str, ...],
    ours: bool,
    chuck: bool | None,
) -> tuple[Validity, ...]:
    """Return what is still valid, by what the controller reports now.

    `before` is the alignment when the link was lost. `homed_axes` and `unhomed` are the axes that are homed, and
    those that are not, by the last poll. `ours` is whether nobody else has had control. `chuck` is what the
    controller senses of it: True closed, None if it senses nothing.
    """
    return (
        _home(before, homed_axes, unhomed),
        _of_home("jaw", None if before.jaw is None else before.jaw.at, now.homed, ours),
        _of_home("touch_off", None if before.touch_off is None else before.touch_off.at, now.homed, ours),
        _clamping(before, ours, chuck),
    )


def _home(before: Alignment, homed: tuple[str, ...], unhomed: tuple[str, ...]) -> Validity:
    if not unhomed:
        return Validity(stamp="home", holds=True, why="home_kept")
    if before.homed and not homed:
        return Validity(stamp="home", holds=False, why="home_reset")
    why = "home_lost" if before.homed or homed else "home_none"
    return Validity(stamp="home", holds=False, why=why, value=", ".join(unhomed))


def _of_home(stamp: str, at: str | None, homed: bool, ours: bool) -> Validity:
    if at is None:
        return Validity(stamp=stamp, holds=False, why="none")
    if not ours:
        return Validity(stamp=stamp, holds=False, why="handed_over")
    return Validity(stamp=stamp, holds=homed, why="kept" if homed else "home_gone", value=at)


def _clamping(before: Alignment, ours: bool, chuck: bool | None) -> Validity:
    if before.clamping is None:
        return Validity(stamp="clamping", holds=False, why="none")
    if chuck is False:
        return Validity(stamp="clamping", holds=False, why="chuck_open")
    if not ours:
        return Validity(stamp="clamping", holds=False, why="handed_over")
    why = "chuck_unseen" if chuck is None else "chuck_closed"
    return Validity(stamp="clamping", holds=True, why=why, value=before.clamping.at)
