"""One part on a machine behind a link: who controls it, what was commissioned, and how it is left behind."""

from __future__ import annotations

from contextlib import suppress

from console.session.commissioned import Commissioned
from console.session.interlocks import Interlock, refuse_unless
from console.session.reaching import Reached
from console.session.sequence import Shop
from drivers.ownership import Standing
from profiles.problem import ProblemError


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


def leave(reached: Reached) -> None:
    """Leave the machine with its drives off, as far as it can be told, and nobody's. Never raises a problem."""
    lathe, ownership = reached.lathe, reached.lathe.ownership
    if lathe.has_moved and ownership is not None and ownership.standing is Standing.OWNER:
        with suppress(ProblemError):
            if lathe.stop.reason is None:
                lathe.switch_off()
            else:
                lathe.stop.kill("end")
                lathe.wait_for_rest()
    reached.owning.release()
