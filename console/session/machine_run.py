"""One part on a machine behind a link: who controls it, what was commissioned, and how it is left behind."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from console.session.commissioned import Commissioned
from console.session.interlocks import Interlock, refuse_unless
from console.session.owning import Owning
from console.session.reaching import Reached
from console.session.sequence import Shop
from console.session.signals import Interruption
from drivers.lathe import Lathe
from drivers.standing import Standing
from profiles.problem import ProblemError


def guard(interruption: Interruption, lathe: Lathe, now_s: Callable[[], float]) -> None:
    """Stop this machine when the command is to end, from the claim on; nothing is sent while it is another's.

    `now_s` is the time of the machine.
    """
    ownership = lathe.ownership
    interruption.guard(
        lathe.stop,
        now_s=now_s,
        anothers=lambda: lathe.anothers,
        changing=lambda: ownership is not None and ownership.standing is Standing.CHANGING,
    )


def machine_shop(reached: Reached, commissioned: Commissioned) -> Shop:
    """Return the shop of a reached machine: of iron, the operator clamps and measures."""
    lathe = reached.lathe

    def admit() -> None:
        """Become the owner, and look at what was commissioned, before anything is written."""
        reached.owning.claim()
        refuse_unless(Interlock(name="controller_verified", problems=lathe.verify()))
        commissioned.take_fingerprint()
        refuse_unless(Interlock(name="commissioned", problems=commissioned.problems(lathe.snapshot())))

    def judge() -> Interlock:
        return Interlock(name="commissioned", problems=commissioned.problems(lathe.snapshot()))

    simulated = reached.shop
    if simulated is None:
        return Shop(lathe=lathe, clamp=lambda _: None, measure=None, simulated=False, admit=admit, judge=judge)
    return Shop(
        lathe=lathe,
        clamp=simulated.mount,
        measure=simulated.measure,
        simulated=True,
        collisions=lambda: simulated.look().collisions,
        turn=simulated.set_spindle if lathe.machine.spindle.followed else None,
        admit=admit,
        judge=judge,
    )


def leave(lathe: Lathe, owning: Owning | None) -> bool:
    """Leave the machine with its drives off and nobody's; False when that cannot be proven. Raises no problem.

    A machine that is left in doubt keeps the number of this console: whoever comes next has to look at it.
    """
    ownership = lathe.ownership
    ours = ownership is None or ownership.standing is Standing.OWNER
    if lathe.has_moved and ours and not _switched_off(lathe):
        return False
    if owning is not None:
        owning.release()
    return True


def _switched_off(lathe: Lathe) -> bool:
    with suppress(ProblemError):
        if lathe.stop.reason is None:
            lathe.switch_off()
            return True
    lathe.stop.kill("end")
    if lathe.stop.given_up:  # it was waited for as long as that makes sense, and does not become more likely by it
        return False
    try:
        lathe.wait_for_rest()
    except ProblemError:
        return False
    return True
