"""Address a motor, a coordinate system and a controller, and assign motors to axes."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.axes import scan_definition
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.simulator.context import ALL_CARDS, HIGHEST_CARD, Context, Handler, Reading, Step

MOTORS_IN_A_BANK = 8


def read_card(scanner: Scanner) -> int | None:
    """Read what follows `@`: the number of a card, ALL_CARDS for `@@`, or None, which reports.

    Raises PmacError: 003, a number above 15.
    """
    if scanner.accept("@"):
        return ALL_CARDS
    number = scanner.take_integer()
    if number is not None and number > HIGHEST_CARD:
        raise PmacError(ErrorCode.DATA_ERROR, f"card {number}, 0 to {HIGHEST_CARD}")
    return number


@dataclass(frozen=True, slots=True)
class AddressCard:
    """`@n`: what follows is for controller n; `@@`: for all; `@` reports. It matters only with bit 1 of I1."""

    number: int | None

    def __call__(self, context: Context) -> None:
        """Address it, or report."""
        if self.number is not None:
            context.card_number = self.number
            return
        addressed = context.card_number
        context.lines.append("@" if addressed == ALL_CARDS else str(addressed or 0))


def _address_motor(scanner: Scanner, reading: Reading) -> Step:
    number = scanner.take_integer()
    if number is None:
        return lambda context: context.lines.append(str(context.motor_number))
    if not 1 <= number <= reading.dialect.motor_count:
        raise PmacError(ErrorCode.DATA_ERROR, f"motor {number}, 1 to {reading.dialect.motor_count}")
    if scanner.accept("->"):
        return _axis(scanner, number)

    def step(context: Context) -> None:
        context.motor_number = number

    return step


def _address_bank(scanner: Scanner, reading: Reading) -> Step:
    """`##1`: the control characters report motors 9 to 16.

    With eight motors, and with a space between the signs, it is `#`, and `#1` after it.
    """
    banks = reading.dialect.motor_count // MOTORS_IN_A_BANK
    behind = scanner.mark()
    scanner.reset(behind - 1)
    if banks == 1 or reading.text[scanner.position - 1] != "#":
        return lambda context: context.lines.append(str(context.motor_number))
    scanner.reset(behind)
    number = scanner.take_integer()
    if number is None:
        return lambda context: context.lines.append(str(context.motor_bank))
    if number >= banks:
        raise PmacError(ErrorCode.DATA_ERROR, f"##{number}: {banks} times {MOTORS_IN_A_BANK} motors")

    def step(context: Context) -> None:
        context.motor_bank = number

    return step


def _axis(scanner: Scanner, motor: int) -> Step:
    """`#1->` reports the definition in the addressed system, 0 for a motor of another one; or define or clear."""
    if scanner.at_end or scanner.peek("#&") or scanner.accept(","):

        def report(context: Context) -> None:
            definition = context.system.frame.definitions.get(motor)
            context.lines.append("0" if definition is None else str(definition))

        return report
    definition = scan_definition(scanner, motor)

    def define(context: Context) -> None:
        if definition is not None or motor in context.system.frame.definitions:
            context.controller.define_axis(context.system_number, motor, definition)

    return define


def _address_system(scanner: Scanner, reading: Reading) -> Step:
    number = scanner.take_integer()
    if number is None:
        return lambda context: context.lines.append(str(context.system_number))
    if not 1 <= number <= reading.dialect.system_count:
        raise PmacError(ErrorCode.DATA_ERROR, f"&{number}, 1 to {reading.dialect.system_count}")

    def step(context: Context) -> None:
        context.system_number = number

    return step


def _undefine(scanner: Scanner, reading: Reading) -> Step:
    """UNDEFINE the axes of the addressed coordinate system, UNDEFINE ALL those of every one."""
    every = scanner.accept("ALL")

    def step(context: Context) -> None:
        controller = context.controller
        systems = list(controller.systems.values()) if every else [context.system]
        for system in systems:
            for motor in tuple(system.frame.definitions):
                controller.define_axis(system.number, motor, None)

    return step


WORDS: dict[str, Handler] = {
    "#": _address_motor,
    "##": _address_bank,
    "&": _address_system,
    **dict.fromkeys(("UNDEFINE", "UNDEF"), _undefine),
}
