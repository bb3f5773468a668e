"""A simulated lathe in the hands of an instructor: his commands are carried out between two polls, in any time.

A pause is here, too: simulated time and machine time stand still, and this thread with them. Nothing is polled, so
nothing times out. A stop goes its own way to the controller, which takes it in the pause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from console.session.station.commands import Command
from console.session.station.context import StationContext, Training

PAUSED_LOOK_S = 0.02  # period in which an end of the pause is looked for


@dataclass(frozen=True, kw_only=True)
class Instruct(Command):
    """A command of the instructor at a simulated lathe."""

    logged: ClassVar[bool] = False  # the log has the acts of the instructor instead

    def carry_out(self, context: StationContext) -> None:
        """Do it, in the link thread, between two polls; raises nothing."""
        raise NotImplementedError


def carry_out(context: StationContext) -> None:
    """Carry out what the instructor has commanded since the last poll; return when time is not paused."""
    _carry_out_all(context)
    training = context.training
    while training is not None and training.clock.paused:
        if training.clock.asked_on or training.clock.leaving:
            run_on(context, training, training.speed)
            return
        stop_waits = context.lathe.stop.reason is not None and not context.lathe.stop.proven
        if stop_waits is not context.state.stop_waits:
            context.tell(stop_waits=stop_waits)
        training.clock.wait(PAUSED_LOOK_S)
        _carry_out_all(context)


def _carry_out_all(context: StationContext) -> None:
    while context.orders:
        context.orders.popleft()(context)


def run_on(context: StationContext, training: Training, speed: float) -> None:
    """End a pause, if there is one; time passes at this speed."""
    training.speed = speed
    set_speed(context, training, speed)
    context.tell(stop_waits=False)


def set_speed(context: StationContext, training: Training, speed: float) -> None:
    """Change the time of the lathe and ours; a lathe that is gone has none."""
    if speed == 0.0:
        training.lathe.set_speed(speed)
        training.clock.set_speed(speed)
    else:
        training.clock.set_speed(speed)  # before anything else: this thread must come out of a pause
        context.tell(speed=speed)
        training.lathe.set_speed(speed)
    context.tell(speed=speed)
