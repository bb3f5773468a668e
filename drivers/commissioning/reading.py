"""Read the configuration of a controller through a client. Nothing is written and nothing moves.

Everything here raises `DriverError` when the link breaks or the controller answers something unexpected.

The values of P, Q and M are read range by range, and written to a backup as lines to be sent. A value of 0 is not
written; before the others everything is set to 0. Left out are the P-variables that this program uses, and each M
that points at memory: writing there may switch an output.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from drivers.commissioning.configuration import (
    AxisEntry,
    ControllerConfiguration,
    TableEntry,
    digest,
    fleeting_settings,
)
from drivers.commissioning.user_buffer import BYTES_A_WORD, Seen, read_place, read_words
from drivers.controller import Controller, query_in_lines
from drivers.errors import ControllerError, RefusedError, out_of_step
from drivers.pmac.buffer_text import BufferKind, in_full
from drivers.pmac.dialect import Dialect, SettingScope
from drivers.pmac.expected_replies import number_of, replied_number
from drivers.pmac.language.errors import ErrorCode
from drivers.pmac.language.expressions import HIGHEST_PLC
from drivers.pmac.language.listing import without_end
from drivers.pmac.language.text import format_number
from drivers.pmac.programs.setup import is_signed
from drivers.pmac.reserved import OWN_VARIABLES
from drivers.pmac.status import decode
from profiles.problem import Problem

NUMBERS_A_LINE = 50  # variables per query of a range: a third of a second on a 9600-baud line
WORDS_A_LINE = 16
MOTORS_A_LINE = 8
SETTINGS_A_LINE = 12
BYTES_A_REQUEST, BYTES_A_LINE = 20, 2  # both ways; most values are 0
TIMEOUT_S = 10.0
LISTING_TIMEOUT_S = 60.0  # of a program or table
PLC_TIMEOUT_S = 30.0  # the longest PLC is listed in a third of that at 9600 baud
TABLE_LINES = 32  # lines of the conversion table that are read where only the machine matters

PROGRAM_NUMBERS = (*range(1, 100), *range(1000, 1004))  # a controller does not list its program numbers
BUFFERS_OPEN = ("motion_buffer_open", "plc_buffer_open", "rotary_open")  # a program is being entered
_SYSTEM_SHIFT = 20
_FORM = re.compile(r"M\d+->")
_ENTRY = re.compile(r"-?[0-9]{1,9}")  # of a compensation table, as LIST COMP has it
VALUES_A_LINE = 200  # a third of a second at 9600 baud where most are 0
VALUES_TIMEOUT_S = 20.0  # 200 long numbers take 4 s at 9600 baud

_VALUE = re.compile(r"((?:&\d+)?[PQM]\d+)=(-?[\d.]+)")
_ZERO = re.compile(r"(?:&\d+)?[PQM]\d+\.\.\d+=0")
_NAME = re.compile(r"(?:&(\d+))?([PQM])(\d+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """How much is read: ranges of I-variables and of M-definitions, motors, numbers of PLCs and programs.

    `tables` are the motors whose compensation tables are read, None: all of `motors`.
    Of the table that belongs to motor `unlisted_table` only the definition is read: entries take seconds.
    `values` is whether the values of P, Q and M are kept, the entries of tables and the words of the user buffer.
    `user_buffer` is whether it is asked where that one is.
    """

    settings: tuple[range, ...]
    pointers: tuple[range, ...]
    motors: tuple[int, ...]
    plcs: tuple[int, ...] = tuple(range(HIGHEST_PLC + 1))
    programs: tuple[int, ...] = PROGRAM_NUMBERS
    tables: tuple[int, ...] | None = None
    unlisted_table: int | None = None
    values: bool = False
    user_buffer: bool = False

    @property
    def table_motors(self) -> tuple[int, ...]:
        """The motors whose compensation tables are read."""
        return self.motors if self.tables is None else self.tables


def whole_card(dialect: Dialect, *, values: bool = False, programs: Iterable[int] = ()) -> Extent:
    """Return the full extent of the family, with the values of P, Q and M if asked for.

    `programs` are looked for beside those under the usual numbers.
    """
    numbers = (range(dialect.highest_index + 1),)
    motors = tuple(dialect.numbers(SettingScope.MOTOR))
    looked_for = tuple(sorted({*PROGRAM_NUMBERS, *programs}))
    return Extent(
        settings=numbers, pointers=numbers, motors=motors, programs=looked_for, values=values, user_buffer=True
    )


def of_motors(dialect: Dialect, motors: Iterable[int], pointers: Iterable[int] = ()) -> Extent:
    """Return what concerns some motors: their settings, those of the controller and of coordinate system 1.

    `pointers` are the M-variables whose definitions matter. Axis definitions and Ix00 are those of every motor.
    """
    blocks = {0, *motors, dialect.system_index(1, 0) // 100}
    every_motor = tuple(dialect.numbers(SettingScope.MOTOR))
    settings = [range(100 * block, 100 * block + 100) for block in sorted(blocks)]
    settings += [range(100 * each, 100 * each + 1) for each in every_motor if each not in blocks]
    first = dialect.conversion_table.first_setting
    if first is not None:
        settings.append(range(first, first + TABLE_LINES))
    single = tuple(range(index, index + 1) for index in sorted(pointers))
    return Extent(settings=tuple(settings), pointers=single, motors=every_motor, programs=())


def read_values(client: Controller, dialect: Dialect, pointers: Iterable[int]) -> dict[str, float]:
    """Return all values that are not 0, by names such as `P7`, `&2Q5` and `M3`; `pointers` are those of M."""
    found: dict[str, float] = {}
    for before, kind, whole in _ranges(dialect, pointers):
        for start in range(whole.start, whole.stop, VALUES_A_LINE):
            part = range(start, min(start + VALUES_A_LINE, whole.stop))
            line = f"{before}{kind}{part.start}..{part.stop - 1}"
            texts = client.question(line, VALUES_TIMEOUT_S, lines=len(part))
            values = (replied_number(each, client.link.address, line) for each in texts)
            found.update(
                {f"{before}{kind}{n}": value for n, value in zip(part, values, strict=True) if value != 0.0}
            )
    client.request("&1", lines=0)
    return found


def value_lines(values: Mapping[str, float], dialect: Dialect, pointers: Iterable[int]) -> Iterator[str]:
    """Yield the lines that set them, and 0 wherever there is none."""
    for before, kind, whole in _ranges(dialect, pointers):
        yield f"{before}{kind}{whole.start}..{whole.stop - 1}=0"
    yield from (f"{name}={format_number(values[name])}" for name in sorted(values, key=order_of))


def read_value_line(line: str) -> tuple[str, float] | None:
    """Return name and value of a line; None for one that sets a range to 0. Raises ValueError: neither."""
    found = _VALUE.fullmatch(line)
    if found is not None:
        return found[1], float(found[2])
    if _ZERO.fullmatch(line):
        return None
    raise ValueError(line)


def highest_of(name: str) -> int:
    """Return the index in the name of a value."""
    return order_of(name)[2]


def order_of(name: str) -> tuple[str, int, int]:
    """Return what sorts the names of values: by letter, coordinate system and number."""
    found = _NAME.fullmatch(name)
    assert found is not None
    return found[2], int(found[1] or 0), int(found[3])


def _ranges(dialect: Dialect, pointers: Iterable[int]) -> Iterator[tuple[str, str, range]]:
    """Yield the ranges of a backup: the system before the letter, the letter, and numbers without a gap."""
    every = dialect.highest_index + 1
    yield "", "P", range(OWN_VARIABLES.start)
    if OWN_VARIABLES.stop < every:
        yield "", "P", range(OWN_VARIABLES.stop, every)
    for system in dialect.numbers(SettingScope.SYSTEM):
        yield f"&{system}", "Q", range(every)
    first = 0
    for pointer in (*sorted(pointers), every):
        if first < pointer:
            yield "", "M", range(first, pointer)
        first = pointer + 1


def expected_work(dialect: Dialect, extent: Extent) -> int:
    """Return how much there is to read, in the unit of `work_done`; programs that are there come on top."""
    settings, pointers = (sum(map(len, ranges)) for ranges in (extent.settings, extent.pointers))
    listings = len(extent.plcs) + len(extent.programs) + len(extent.table_motors)
    whole = work_done((settings + pointers) // NUMBERS_A_LINE + listings, settings + pointers)
    if extent.values:
        values = (len(dialect.numbers(SettingScope.SYSTEM)) + 2) * (dialect.highest_index + 1)
        whole += work_done(values // VALUES_A_LINE, values)
    return whole


def work_done(requests: int, lines: int) -> int:
    """Return how much was read by these requests: about the number of bytes, of which a line of data has few."""
    return BYTES_A_REQUEST * requests + BYTES_A_LINE * lines


def work_of_words(count: int) -> int:
    """Return how much words of the user buffer are, beside their requests, in the unit of `work_done`."""
    return BYTES_A_WORD * count


def requests_of_words(count: int) -> int:
    """Return the work of the requests that read all words of a user buffer."""
    requests = -(-count // WORDS_A_LINE)
    return work_done(requests, requests)


def read_configuration(
    client: Controller, dialect: Dialect, extent: Extent, seen_words: Seen = lambda done, of: None
) -> ControllerConfiguration:
    """Read everything in `extent`, with PLCs, tables and the conversion table.

    The user buffer comes first, since only the controller knows its size: `seen_words` takes how far that is.

    Raises RefusedError: `controller.entering`, somebody is entering a program: queries would become lines of it;
        `controller.user_buffer`, where its words are asked for.
    """
    refuse_open_buffer(client, dialect)
    place, misplaced = _user_buffer(client, dialect, extent)
    user_words = read_words(client, place, seen_words) if place and extent.values else None
    kind, version = (text.strip() for text in client.query("TYPE", "VERSION", again=True))
    motors, locked, entries = extent.motors, list[str](), dict[int, tuple[int, ...]]()
    pointers = dict(_pointers(client, extent.pointers))
    programs = dict(_listings(client, BufferKind.PROGRAM, extent.programs, LISTING_TIMEOUT_S, locked))
    further = set(extent.programs) - set(PROGRAM_NUMBERS) - programs.keys()
    return ControllerConfiguration(
        family=dialect.name,
        kind=kind,
        version=version,
        settings=read_ranges(client, dialect, extent.settings),
        axes=dict(_axes(client, dialect, motors)),
        pointers=pointers,
        plcs=dict(_listings(client, BufferKind.PLC, extent.plcs, PLC_TIMEOUT_S, locked)),
        programs=programs,
        no_programs=tuple(sorted(number for number in further if f"PROG {number}" not in locked)),
        tables=dict(_tables(client, extent.table_motors, extent.unlisted_table, entries)),
        conversion=_conversion(client, dialect),
        entries=entries if extent.values else {},
        values=read_values(client, dialect, pointers) if extent.values else None,
        kinematics=dict(_kinematics(client, dialect, locked)) if extent.values else {},
        locked=tuple(locked),
        user_buffer=place,
        misplaced_buffer=misplaced,
        user_words=user_words,
    )


def _user_buffer(client: Controller, dialect: Dialect, extent: Extent) -> tuple[range | None, Problem | None]:
    """Return the place of the user buffer; where its words are not wanted, also why it cannot be there."""
    try:
        return (read_place(client, dialect) if extent.user_buffer else None), None
    except RefusedError as error:
        if extent.values:
            raise
        return None, error.problems[0]


def refuse_open_buffer(client: Controller, dialect: Dialect) -> None:
    """Make sure that no program is being entered. Raises RefusedError: `controller.entering`."""
    try:
        status = decode(client.query("???", again=True)[0], dialect.global_bits)
    except ValueError as error:
        raise out_of_step(client.link.address, "???", str(error)) from error
    if not status.isdisjoint(BUFFERS_OPEN):
        raise RefusedError(Problem(code="controller.entering", where=client.link.address))


def ask_or_none(client: Controller, line: str, timeout_s: float = TIMEOUT_S) -> tuple[str, ...] | None:
    """Return the data of a query, None if the controller has no such item."""
    try:
        return client.question(line, timeout_s)
    except ControllerError as error:
        if error.error_number == ErrorCode.DATA_ERROR:
            return None
        raise


def holds_another(client: Controller, number: int) -> bool:
    """Whether there is anything in the buffer of a motion program but what a console has left in it."""
    return not is_signed(ask_or_none(client, f"LIST PROG{number}") or ())


def number_in(text: str, where: str) -> float:
    """Parse an I-variable as reported, in any format of I9. Raises LinkError: `link.out_of_step`."""
    try:
        return number_of(text)
    except ValueError as error:
        raise out_of_step(where, "I", text[:40]) from error


def read_settings(client: Controller, numbers: Iterable[int]) -> Mapping[int, float]:
    """Return some I-variables by number; the controller must have all of them."""
    asked, where = list(numbers), client.link.address
    texts = query_in_lines(client, [f"I{index}" for index in asked], SETTINGS_A_LINE)
    return {index: number_in(text, where) for index, text in zip(asked, texts, strict=True)}


def read_gathering(client: Controller, dialect: Dialect) -> Mapping[int, float]:
    """Return the settings that gathering two channels changes, by number."""
    gather = dialect.gathering
    return read_settings(client, (gather.period, *gather.masks, gather.first_source, gather.first_source + 1))


def read_ranges(client: Controller, dialect: Dialect, ranges: Iterable[range]) -> dict[int, float]:
    """Return I-variables by number, without those that the host sets when it connects, and without timers."""
    where, left_out = client.link.address, fleeting_settings(dialect)
    reports = _reports(client, ranges, "I{first}..{last}")
    return {index: number_in(text, where) for index, text in reports if index not in left_out}


def _pointers(client: Controller, ranges: Iterable[range]) -> Iterator[tuple[int, str]]:
    for index, text in _reports(client, ranges, "M{first}..{last}->"):
        definition = _FORM.sub("", text.strip(), count=1)
        if definition != "*":
            yield index, definition


def _reports(client: Controller, ranges: Iterable[range], form: str) -> Iterator[tuple[int, str]]:
    """Query variables range by range, without those that the controller lacks."""
    for whole in ranges:
        for start in range(whole.start, whole.stop, NUMBERS_A_LINE):
            yield from _part(client, range(start, min(start + NUMBERS_A_LINE, whole.stop)), form)


def _part(client: Controller, part: range, form: str) -> Iterator[tuple[int, str]]:
    texts = ask_or_none(client, form.format(first=part.start, last=part.stop - 1))
    if texts is not None:
        yield from zip(part, texts, strict=True)
    elif len(part) > 1:
        middle = part.start + len(part) // 2
        yield from _part(client, range(part.start, middle), form)
        yield from _part(client, range(middle, part.stop), form)


def _axes(client: Controller, dialect: Dialect, motors: Sequence[int]) -> Iterator[tuple[int, AxisEntry]]:
    """Yield the definitions; a motor is asked for in its own system, since in another one it has none."""
    states = query_in_lines(client, [f"#{motor}?" for motor in motors], MOTORS_A_LINE)
    systems = [_system_of(state, dialect, client.link.address) for state in states]
    asked = [f"&{system}#{motor}-> &1" for system, motor in zip(systems, motors, strict=True)]
    found = query_in_lines(client, asked, MOTORS_A_LINE)
    for motor, system, text in zip(motors, systems, found, strict=True):
        if text.strip() != "0":
            yield motor, AxisEntry(system, text.strip())


def _system_of(status: str, dialect: Dialect, where: str) -> int:
    """Return the coordinate system from a motor's status: its number less one is in the second word."""
    try:
        assigned = "assigned" in decode(status, dialect.motor_bits)
        second = int(status[6:12], 16)
    except ValueError as error:
        raise out_of_step(where, "?", status[:40]) from error
    return (second >> _SYSTEM_SHIFT) % dialect.system_count + 1 if assigned else 1


def _listings(
    client: Controller, kind: BufferKind, numbers: Iterable[int], timeout_s: float, locked: list[str]
) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield the text of each buffer that has one; buffers under a password are named in `locked`."""
    for number in numbers:
        kept = listed_lines(client, kind, number, timeout_s, locked)
        if kept:
            yield number, kept


def listed_lines(
    client: Controller, kind: BufferKind, number: int, timeout_s: float, locked: list[str]
) -> tuple[str, ...] | None:
    """Return a listing in full, whatever I9 is, and without its end; None where there is no such buffer.

    What is behind a password is named in `locked`.
    """
    try:
        lines = ask_or_none(client, kind.line("LIST", number), timeout_s)
    except ControllerError as error:
        if error.error_number != ErrorCode.PASSWORD:
            raise
        locked.append(kind.buffer_name(number))
        return None
    return None if lines is None else in_full(kind, without_end(each.strip() for each in lines))


def _kinematics(
    client: Controller, dialect: Dialect, locked: list[str]
) -> Iterator[tuple[tuple[int, str], tuple[str, ...]]]:
    """Yield the kinematic programs of each coordinate system that have text, in a family that has any."""
    for system in dialect.numbers(SettingScope.SYSTEM) if dialect.kinematics is not None else ():
        for kind in (BufferKind.INVERSE, BufferKind.FORWARD):
            lines = listed_lines(client, kind, system, LISTING_TIMEOUT_S, locked)
            if lines:
                yield (system, kind), lines
    client.request("&1", lines=0)


def _tables(
    client: Controller, motors: Sequence[int], unlisted: int | None, kept: dict[int, tuple[int, ...]]
) -> Iterator[tuple[int, TableEntry]]:
    """Yield the tables; their entries are put into `kept`."""
    for motor in motors:
        definition = ask_or_none(client, f"#{motor}LIST COMP DEF")
        if not definition:
            continue
        listed = () if motor == unlisted else client.question(f"#{motor}LIST COMP", LISTING_TIMEOUT_S)
        entries = " ".join(listed).split()
        wrong = [text for text in entries if _ENTRY.fullmatch(text) is None]
        if wrong:
            raise out_of_step(client.link.address, "LIST COMP", wrong[0][:40])
        kept[motor] = tuple(map(int, entries))
        yield motor, TableEntry(definition[0].strip(), len(entries), digest(entries))


def _conversion(client: Controller, dialect: Dialect) -> tuple[int, ...]:
    table = dialect.conversion_table
    if table.first_setting is not None:
        return ()
    words: list[int] = []
    for line in range(0, table.lines, WORDS_A_LINE):
        (text,) = client.query(f"RHY:${table.first_address + line:X},{WORDS_A_LINE}", again=True)
        try:
            words += [int(word, 16) for word in text.split()]
        except ValueError as error:
            raise out_of_step(client.link.address, "RHY", text[:40]) from error
    return tuple(words)
