"""Address a motor, a coordinate system and a controller, and assign motors to axes."""

from __future__ import annotations

from drivers.pmac.axes import scan_definition
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.context import ALL_CARDS, HIGHEST_CARD, Context, Handler

MOTORS_IN_A_BANK = 8


def address_card(scanner: Scanner, context: Context) -> None:
    """`@n`: what follows is for controller n; `@@`: for all; `@` reports. It matters only with bit 1 of I1.

    Raises PmacError: 003, a number above 15.
    """
    if scanner.accept("@"):
        context.card_number = ALL_CARDS
        return
    number = scanner.take_integer()
    if number is None:
        addressed = context.card_number
        context.lines.append("@" if addressed == ALL_CARDS else str(addressed or 0))
    elif number > HIGHEST_CARD:
        raise PmacError(ErrorCode.DATA_ERROR, f"card {number}, 0 to {HIGHEST_CARD}")
    else:
        context.card_number = number


def _address_motor(scanner: Scanner, context: Context) -> None:
    number = scanner.take_integer()
    if number is None:
        context.lines.append(str(context.motor_number))
        return
    addressed = context.motor_number
    select_motor(context, number)
    if scanner.accept("->"):
        context.motor_number = addressed
        _define_axis(scanner, context, number)


def select_motor(context: Context, number: int) -> None:
    """`#1`: address a motor. Raises PmacError: 003, there is none."""
    if number not in context.controller.motors:
        raise PmacError(ErrorCode.DATA_ERROR, f"motor {number}, 1 to {context.dialect.motor_count}")
    context.motor_number = number


def _address_bank(scanner: Scanner, context: Context) -> None:
    """`##1`: the control characters report motors 9 to 16.

    With eight motors, and with a space between the signs, it is `#`, and `#1` after it.
    """
    banks = context.dialect.motor_count // MOTORS_IN_A_BANK
    behind = scanner.mark()
    scanner.reset(behind - 1)
    if banks == 1 or context.text[scanner.position - 1] != "#":
        context.lines.append(str(context.motor_number))
        return
    scanner.reset(behind)
    number = scanner.take_integer()
    if number is None:
        context.lines.append(str(context.motor_bank))
    elif number < banks:
        context.motor_bank = number
    else:
        raise PmacError(ErrorCode.DATA_ERROR, f"##{number}: {banks} times {MOTORS_IN_A_BANK} motors")


def _define_axis(scanner: Scanner, context: Context, motor: int) -> None:
    controller = context.controller
    if scanner.at_end or scanner.peek("#&") or scanner.accept(","):
        system = controller.system_of(motor)
        context.lines.append(str(system.frame.definitions[motor]) if system is not None else "0")
        return
    controller.define_axis(context.system_number, motor, scan_definition(scanner, motor))


def _address_system(scanner: Scanner, context: Context) -> None:
    number = scanner.take_integer()
    if number is None:
        context.lines.append(str(context.system_number))
    else:
        select_system(context, number)


def select_system(context: Context, number: int) -> None:
    """`&1`: address a coordinate system. Raises PmacError: 003, there is none."""
    if number not in context.controller.systems:
        raise PmacError(ErrorCode.DATA_ERROR, f"&{number}, 1 to {len(context.controller.systems)}")
    context.system_number = number


def _undefine(scanner: Scanner, context: Context) -> None:
    """UNDEFINE the axes of the addressed coordinate system, UNDEFINE ALL those of every one."""
    controller = context.controller
    systems = list(controller.systems.values()) if scanner.accept("ALL") else [context.system]
    for system in systems:
        for motor in tuple(system.frame.definitions):
            controller.define_axis(system.number, motor, None)


WORDS: dict[str, Handler] = {
    "#": _address_motor,
    "##": _address_bank,
    "&": _address_system,
    **dict.fromkeys(("UNDEFINE", "UNDEF"), _undefine),
}
