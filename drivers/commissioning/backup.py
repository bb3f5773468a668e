"""A configuration as text: lines as they are typed, readable for people and for a host that restores them.

Text after a `;` is a comment. The first lines are the header; its hash covers all lines after it. Compensation
tables are listed with the hash of their entries, and restored where the entries were kept.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from drivers.commissioning.configuration import AxisEntry, ControllerConfiguration, TableEntry, digest
from drivers.commissioning.reading import highest_of, read_value_line, value_lines
from drivers.commissioning.setting_names import name_setting
from drivers.commissioning.user_buffer import UserBufferLines, definition, title, word_lines
from drivers.pmac.compensation.table_text import entry_lines
from drivers.pmac.dialect import DIALECTS, Dialect, SettingScope
from drivers.pmac.execution.kinematics import FORWARD, INVERSE
from drivers.pmac.language.text import format_number
from profiles.files import printable
from profiles.problem import Problem, ProfileError

TITLE = "; trilobe controller backup 1"
END_OF_HEADER = "; ----"
_WITHOUT_VALUES = (
    "; Left out: values of P, Q and M; entries of tables; words of the user buffer; the handshake (I3, I4, I6)."
)
_WITH_VALUES = "; Left out: P971 to P1023; values of M that point at memory; the handshake (I3, I4, I6)."
LEFT_OUT = (
    "; Programs were looked for under 1 to 99 and 1000 to 1003. Sending PLCs back leaves them switched off.",
    "; Limits, kill mode, commutation and addresses are among these lines: read them before you send them.",
)
NO_LIMIT = "; no limit"
LIMITS_OFF_AT_ZERO = frozenset(  # the limits that a 0 disables, by the keys of their names
    "fatal_error positive_limit negative_limit abort_deceleration program_speed program_acceleration "
    "jog_acceleration".split()
)
_WORDS_A_LINE, _NUMBERS_A_LINE = 8, 20
DELETE_GATHER, UNDEFINE = "DELETE GATHER", "UNDEFINE ALL"

CAP_BYTES = 16_000_000
MOST_LINES = 300_000  # every setting, every pointer, and programs up to the memory of a controller
MOST_CHARACTERS = 1000  # characters per line: a controller accepts a quarter of it
MOST_WORDS = 8192  # words of the encoder conversion table, far more than any has
_HEADER = ("family", "type", "version", "date", "sha256")
_TYPED = re.compile(r'(?:[^";]|"[^"]*"?)*')


def backup_text(configuration: ControllerConfiguration, date: str) -> str:
    """Return the text of a backup; `date` is copied as given."""
    body = list(_body(configuration))
    header = {
        "family": configuration.family,
        "type": configuration.kind,
        "version": configuration.version,
        "date": date,
        "sha256": digest(body),
    }
    lines = (TITLE, *(f"; {key} {value}" for key, value in header.items()), END_OF_HEADER, *body)
    return "".join(f"{line}\n" for line in lines)


def _body(configuration: ControllerConfiguration) -> Iterator[str]:
    dialect = configuration.dialect
    yield _WITHOUT_VALUES if configuration.values is None else _WITH_VALUES
    yield from LEFT_OUT
    for name in configuration.locked:
        yield f"; locked {name}"
    for start in range(0, len(configuration.no_programs), _NUMBERS_A_LINE):
        part = configuration.no_programs[start : start + _NUMBERS_A_LINE]
        yield f"; no program under {', '.join(map(str, part))}"
    yield from _setting_lines(configuration.settings, dialect)
    yield from _conversion(configuration)
    yield from ("", "; M-variables; those that are not named point at nothing", f"M0..{dialect.highest_index}->*")
    yield from (f"M{index}->{text}" for index, text in sorted(configuration.pointers.items()))
    yield from ("", "; axis definitions", UNDEFINE)
    for motor, axis in sorted(configuration.axes.items(), key=lambda item: (item[1].system, item[0])):
        yield f"&{axis.system}#{motor}->{axis.text}"
    yield from ("", "; compensation tables: definition, number of entries, hash of the entries")
    for motor, table in sorted(configuration.tables.items()):
        yield f"; #{motor} COMP {table.definition} {table.entry_count} {table.sha256}"
    yield from _storage(configuration)
    yield from _buffers("PLC", configuration.plcs)
    yield from _buffers("PROG", configuration.programs)
    for (system, kind), lines in sorted(configuration.kinematics.items()):
        yield from ("", f"; {kind} of &{system}", f"&{system}OPEN {kind}", "CLEAR", *lines, "CLOSE")
    if configuration.values is not None:
        yield from ("", "; values of P, Q and M; all others are 0")
        yield from value_lines(configuration.values, dialect, configuration.pointers)


def _storage(configuration: ControllerConfiguration) -> Iterator[str]:
    """Delete all tables from the lowest motor up, then define them from the highest one down, as they need.

    The user buffer lies above all of them at the end of memory: it is defined between.
    """
    place, words = configuration.user_buffer, configuration.user_words
    if place is not None:
        yield from ("", title(place))
    if words is None and not configuration.entries:
        return
    yield DELETE_GATHER
    yield from (f"#{motor}DELETE COMP" for motor in configuration.dialect.numbers(SettingScope.MOTOR))
    if place is not None and words is not None:
        yield definition(len(place))
        yield from word_lines(place, words)
    for motor in sorted(configuration.entries, reverse=True):
        entries = configuration.entries[motor]
        yield f"#{motor}DEFINE COMP {configuration.tables[motor].definition}"
        yield from entry_lines(entries)
    yield "#1"


def typed_lines(text: str) -> tuple[str, ...]:
    """Return the lines of a backup as they are sent to a controller, without comments and none empty."""
    typed = (_TYPED.match(line) for line in text.splitlines())
    return tuple(line for found in typed if found and (line := found[0].strip()))


def _setting_lines(settings: Mapping[int, float], dialect: Dialect) -> Iterator[str]:
    """Return the I-variables as lines: a run of zeros is one line, and each group has a title."""
    kept = sorted(settings)
    title, place = None, 0
    while place < len(kept):
        index = kept[place]
        if _title(index, dialect) != title:
            title = _title(index, dialect)
            yield from ("", title)
        if is_no_limit(index, settings[index], dialect):
            yield f"I{index}=0 {NO_LIMIT}"
            place += 1
            continue
        last = place
        while settings[index] == 0.0 and last + 1 < len(kept) and _continues(settings, dialect, kept, last):
            last += 1
        name = f"I{index}" if last == place else f"I{index}..{kept[last]}"
        yield f"{name}={setting_text(index, settings[index], dialect)}"
        place = last + 1


def is_no_limit(index: int, value: float, dialect: Dialect) -> bool:
    """Whether a setting is a limit that is 0, which is none."""
    return value == 0.0 and name_setting(index, dialect).name.key in LIMITS_OFF_AT_ZERO


def setting_text(index: int, value: float, dialect: Dialect) -> str:
    """Return the value of an I-variable as it is typed: addresses in hexadecimal."""
    if value and index in dialect.hexadecimal and value == int(value) and value > 0:
        return f"${int(value):X}"
    return format_number(value)


def _continues(settings: Mapping[int, float], dialect: Dialect, kept: list[int], place: int) -> bool:
    """Whether the setting after `place` is the next number, 0, and of the same owner."""
    index, following = kept[place], kept[place + 1]
    same = _title(index, dialect) == _title(following, dialect)
    runs = following == index + 1 and settings[following] == 0.0
    return runs and same and not is_no_limit(following, 0.0, dialect)


def _title(index: int, dialect: Dialect) -> str:
    block = index // 100
    system = block - dialect.system_index(0, 0) // 100
    if block == 0:
        return "; the card"
    if block <= dialect.motor_count:
        return f"; motor {block}"
    if dialect.system_offset and 1 <= system <= dialect.system_count:
        return f"; coordinate system {system}"
    return f"; I{100 * block} to I{100 * block + 99}"


def _conversion(configuration: ControllerConfiguration) -> Iterator[str]:
    words, first = configuration.conversion, configuration.dialect.conversion_table.first_address
    if not words:
        return
    yield from ("", "; encoder conversion table")
    for start in range(0, len(words), _WORDS_A_LINE):
        part = ",".join(f"${word:X}" for word in words[start : start + _WORDS_A_LINE])
        yield f"WY:${first + start:X},{part}"


def _buffers(kind: str, buffers: Mapping[int, tuple[str, ...]]) -> Iterator[str]:
    for number, lines in sorted(buffers.items()):
        yield from ("", f"; {kind} {number}", f"OPEN {kind}{number}", "CLEAR", *lines, "CLOSE")


@dataclass(frozen=True, slots=True, kw_only=True)
class Backup:
    """A configuration with the date of its header."""

    configuration: ControllerConfiguration
    date: str


def read_backup(text: str, where: str) -> Backup:
    """Read a backup.

    Raises:
        ProfileError: `controller.no_backup`, no such file; `controller.backup_changed`, its hash differs;
            `controller.backup_line`, a malformed line; `controller.backup_too_large`, more than fits a controller.
    """
    _refuse_above(text.count("\n"), MOST_LINES, "lines", where)
    lines = text.splitlines()
    if not lines or lines[0] != TITLE or END_OF_HEADER not in lines[: len(_HEADER) + 2]:
        raise ProfileError(Problem(code="controller.no_backup", where=where, limit=TITLE))
    end = lines.index(END_OF_HEADER)
    header = dict(line.removeprefix("; ").split(" ", 1) for line in lines[1:end] if " " in line[2:])
    body = lines[end + 1 :]
    if not set(_HEADER) <= header.keys() or header["family"] not in DIALECTS:
        raise ProfileError(Problem(code="controller.no_backup", where=where, limit=TITLE))
    if digest(body) != header["sha256"]:
        raise ProfileError(Problem(code="controller.backup_changed", where=where, limit=header["sha256"][:12]))
    gathered = _BackupContent(DIALECTS[header["family"]])
    for number, line in enumerate(body, start=end + 2):
        _refuse_above(len(line), MOST_CHARACTERS, "characters", f"{where}:{number}")
        try:
            gathered.take(line)
        except ValueError as error:
            value = f"{number}: {printable(line, 60)}"
            raise ProfileError(Problem(code="controller.backup_line", where=where, value=value)) from error
        _refuse_above(gathered.highest, gathered.dialect.highest_index, "I, M", f"{where}:{number}")
        _refuse_above(len(gathered.conversion), MOST_WORDS, "WY", f"{where}:{number}")
    if not gathered.user_buffer.is_complete:
        raise ProfileError(Problem(code="controller.backup_line", where=where, value=f"{len(lines)}: W"))
    return Backup(configuration=gathered.configuration(header), date=header["date"])


def _refuse_above(actual: int, most: int, unit: str, where: str) -> None:
    if actual > most:
        value, code = printable(str(actual), 30), "controller.backup_too_large"
        raise ProfileError(Problem(code=code, where=where, key=unit, value=value, limit=str(most)))


@dataclass
class _BackupContent:
    """The content of the lines so far. A line `I0..N=` costs memory per entry: none above the highest is kept."""

    dialect: Dialect
    settings: dict[int, float] = field(default_factory=dict)
    axes: dict[int, AxisEntry] = field(default_factory=dict)
    pointers: dict[int, str] = field(default_factory=dict)
    buffers: dict[str, dict[int, list[str]]] = field(default_factory=lambda: {"PLC": {}, "PROG": {}})
    tables: dict[int, TableEntry] = field(default_factory=dict)
    conversion: list[int] = field(default_factory=list)
    locked: list[str] = field(default_factory=list)
    no_programs: list[int] = field(default_factory=list)
    entries: dict[int, list[int]] = field(default_factory=dict)
    values: dict[str, float] | None = None
    kinematics: dict[tuple[int, str], list[str]] = field(default_factory=dict)
    highest: int = 0
    user_buffer: UserBufferLines = field(init=False)
    _open: list[str] | None = None
    table: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.user_buffer = UserBufferLines(self.dialect)

    def take(self, line: str) -> None:
        """Parse one line. Raises ValueError: not a line of a backup."""
        if self._open is not None:
            if line == "CLOSE":
                self._open = None
            elif line != "CLEAR" or self._open:
                self._open.append(line)
        elif not self.user_buffer.take(line):
            for pattern, read in _LINES:
                if found := re.fullmatch(pattern, line):
                    read(self, found)
                    return
            self._value(line)

    def begin_text(self, found: re.Match[str]) -> None:
        """Begin the text of a PLC or a program, up to its CLOSE."""
        self._open = self.buffers[found[1]][int(found[2])] = []

    def begin_kinematics(self, found: re.Match[str]) -> None:
        """Begin the text of a kinematic program, up to its CLOSE."""
        self._open = self.kinematics[int(found[1]), found[2]] = []

    def begin_table(self, found: re.Match[str]) -> None:
        """Begin the entries of a compensation table."""
        self.table = self.entries[int(found[1])] = []

    def take_pointer(self, found: re.Match[str]) -> None:
        """Take the definition of an M-variable; that of a range is of undefined ones."""
        self.highest = max(self.highest, int(found[1]))
        if found[2] is None:
            self.pointers[int(found[1])] = found[3]

    def take_setting(self, found: re.Match[str]) -> None:
        """Take the value of an I-variable, or of a range of them."""
        value = float(int(found[3][1:], 16)) if found[3].startswith("$") else float(found[3])
        first, last = int(found[1]), int(found[2] or found[1])
        self.highest = max(self.highest, last)
        if last <= self.dialect.highest_index:
            self.settings.update(dict.fromkeys(range(first, last + 1), value))

    def _value(self, line: str) -> None:
        named = read_value_line(line)
        self.values = {} if self.values is None else self.values
        if named is not None:
            self.highest = max(self.highest, highest_of(named[0]))
            self.values[named[0]] = named[1]

    def configuration(self, header: dict[str, str]) -> ControllerConfiguration:
        """Return the complete configuration."""
        return ControllerConfiguration(
            family=header["family"],
            kind=header["type"],
            version=header["version"],
            settings=self.settings,
            axes=self.axes,
            pointers=self.pointers,
            plcs={number: tuple(lines) for number, lines in self.buffers["PLC"].items()},
            programs={number: tuple(lines) for number, lines in self.buffers["PROG"].items()},
            tables=self.tables,
            conversion=tuple(self.conversion),
            locked=tuple(self.locked),
            no_programs=tuple(self.no_programs),
            entries={motor: tuple(entries) for motor, entries in self.entries.items()},
            values=self.values,
            kinematics={which: tuple(lines) for which, lines in self.kinematics.items()},
            user_buffer=self.user_buffer.place,
            user_words=self.user_buffer.words,
        )


# The lines of a backup: the first pattern that fits reads it. Only a host needs those that nothing reads.
_LINES: tuple[tuple[str, Callable[[_BackupContent, re.Match[str]], object]], ...] = (
    (r"I(\d+)(?:\.\.(\d+))?=(-?[\d.]+|\$[0-9A-F]+)(?: ; no limit)?", _BackupContent.take_setting),
    (r"M(\d+)(\.\.\d+)?->(.+)", _BackupContent.take_pointer),
    (r"&(\d+)#(\d+)->(.+)", lambda to, at: to.axes.update({int(at[2]): AxisEntry(int(at[1]), at[3])})),
    (
        r"WY:\$[0-9A-F]+,([$0-9A-F,]+)",
        lambda to, at: to.conversion.extend(int(word.removeprefix("$"), 16) for word in at[1].split(",")),
    ),
    (
        r"; #(\d+) COMP (\S+) (\d+) ([0-9a-f]{64})",
        lambda to, at: to.tables.update({int(at[1]): TableEntry(at[2], int(at[3]), at[4])}),
    ),
    (r"; locked (.+)", lambda to, at: to.locked.append(at[1])),
    (
        r"; no program under (\d{1,5}(?:, \d{1,5})*)",
        lambda to, at: to.no_programs.extend(map(int, at[1].split(", "))),
    ),
    (r"OPEN (PLC|PROG)(\d+)", _BackupContent.begin_text),
    (rf"&(\d+)OPEN ({INVERSE}|{FORWARD})", _BackupContent.begin_kinematics),
    (r"#(\d+)DEFINE COMP (\S+)", _BackupContent.begin_table),
    (r"-?\d+(?: -?\d+)*", lambda to, at: to.table.extend(map(int, at[0].split()))),
    (rf"|;.*|{UNDEFINE}|{DELETE_GATHER}|#\d+(?:DELETE COMP)?", lambda to, at: None),
)
