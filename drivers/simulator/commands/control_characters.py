"""The functions of control characters, except those that edit the line itself (CR, backspace, ^I, ^N, ^Y)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivers.simulator.card import reports
from drivers.simulator.card.motor import Motor
from drivers.simulator.context import Context

Action = Callable[[Context], str | None]
"""The function; it returns the text for the host, None when there is none."""


def control(letter: str) -> int:
    """Return the code of a control character by its letter."""
    return ord(letter) - 0x40


CONTROL_X = control("X")
"""Discards pending input and output."""


def _motors(report: Callable[[Context, Motor], str]) -> Action:
    def action(context: Context) -> str:
        motors = context.controller.motors
        return " ".join(report(context, motors[number]) for number in reports.eight_motors(context.motor_bank))

    return action


def _systems(context: Context) -> str:
    controller = context.controller
    return " ".join(reports.system_status(controller, number) for number in controller.systems)


def _disable_plcs(context: Context) -> None:
    context.controller.plcs.disable_all()


ACTING: Mapping[int, Action] = {
    control("A"): lambda context: context.controller.abort_all(),
    control("D"): _disable_plcs,
    control("K"): lambda context: context.controller.kill_all(),
    control("O"): lambda context: context.controller.hold_all(),
    control("Q"): lambda context: context.controller.quit_all(),
    control("R"): lambda context: context.controller.run_all(),
    control("S"): lambda context: context.controller.step_all(),
}
"""They act as soon as they arrive, before every pending line."""

STOPS = (control("A"), control("K"))
"""From a host, they also discard pending commands (CMD): none of them may move what was just stopped."""

REPORTING: Mapping[int, Action] = {
    control("B"): _motors(lambda context, motor: reports.motor_status(context.controller, motor)),
    control("C"): _systems,
    control("F"): _motors(lambda _, motor: reports.following_error(motor)),
    control("G"): lambda context: reports.global_status(context.controller, all_cards=context.all_cards),
    control("P"): _motors(lambda context, motor: reports.position(context.controller, motor)),
    control("V"): _motors(lambda _, motor: reports.velocity(motor)),
}
"""They are answered before every pending line, within the host's share."""

ACTIONS: Mapping[int, Action] = {**ACTING, **REPORTING}
"""Others have no function, or edit the line itself."""
