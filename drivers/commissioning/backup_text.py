"""A configuration as text: lines as they are typed, readable for people and for a host that restores them.

Text after a `;` is a comment. The first lines are the header; its hash covers all lines after it. Compensation
tables are listed with the hash of their entries and not restored: each job makes its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from drivers.commissioning.configuration import Configuration, digest
from drivers.commissioning.setting_names import named
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_number

TITLE = "; trilobe controller backup 1"
END_OF_HEADER = "; ----"
LEFT_OUT = (
    "; Left out: values of P, Q and M; entries of compensation tables; the handshake of the host (I3, I4, I6).",
    "; Programs were looked for under 1 to 99 and 1000 to 1003. Sending PLCs back leaves them switched off.",
    "; Limits, kill mode, commutation and addresses are among these lines: read them before you send them.",
)
NO_LIMIT = "; no limit"
LIMITS_OFF_AT_ZERO = frozenset(
    (
        "fatal_error",
        "positive_limit",
        "negative_limit",
        "abort_deceleration",
        "program_speed",
        "program_acceleration",
        "jog_acceleration",
    )
)
"""The limits that a 0 disables, by the keys of their names."""

_WORDS_A_LINE = 8


def backup_text(configuration: Configuration, date: str) -> str:
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


def _body(configuration: Configuration) -> Iterator[str]:
    dialect = configuration.dialect
    yield from LEFT_OUT
    for name in configuration.locked:
        yield f"; locked {name}"
    yield from _setting_lines(configuration.settings, dialect)
    yield from _conversion(configuration)
    yield from ("", "; M-variables; those that are not named point at nothing", f"M0..{dialect.highest_index}->*")
    yield from (f"M{index}->{text}" for index, text in sorted(configuration.pointers.items()))
    yield from ("", "; axis definitions")
    for motor, axis in sorted(configuration.axes.items(), key=lambda item: (item[1].system, item[0])):
        yield f"&{axis.system}#{motor}->{axis.text}"
    yield from ("", "; compensation tables: definition, number of entries, hash of the entries")
    for motor, table in sorted(configuration.tables.items()):
        yield f"; #{motor} COMP {table.definition} {table.entry_count} {table.sha256}"
    yield from _buffers("PLC", configuration.plcs)
    yield from _buffers("PROG", configuration.programs)


def _setting_lines(settings: Mapping[int, float], dialect: Dialect) -> Iterator[str]:
    """Return the I-variables as lines: a run of zeros is one line, and each group has a title."""
    kept = sorted(settings)
    title, place = None, 0
    while place < len(kept):
        index = kept[place]
        if _title(index, dialect) != title:
            title = _title(index, dialect)
            yield from ("", title)
        if _no_limit(index, settings[index], dialect):
            yield f"I{index}=0 {NO_LIMIT}"
            place += 1
            continue
        last = place
        while settings[index] == 0.0 and last + 1 < len(kept) and _continues(settings, dialect, kept, last):
            last += 1
        name = f"I{index}" if last == place else f"I{index}..{kept[last]}"
        yield f"{name}={setting_text(index, settings[index], dialect)}"
        place = last + 1


def _no_limit(index: int, value: float, dialect: Dialect) -> bool:
    """Whether a setting is a disabled limit: it gets a line of its own."""
    return value == 0.0 and named(index, dialect).name.key in LIMITS_OFF_AT_ZERO


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
    return runs and same and not _no_limit(following, 0.0, dialect)


def _title(index: int, dialect: Dialect) -> str:
    """Return the title line of a hundred settings."""
    block = index // 100
    system = block - dialect.system_index(0, 0) // 100
    if block == 0:
        return "; the card"
    if block <= dialect.motor_count:
        return f"; motor {block}"
    if dialect.system_offset and 1 <= system <= dialect.system_count:
        return f"; coordinate system {system}"
    return f"; I{100 * block} to I{100 * block + 99}"


def _conversion(configuration: Configuration) -> Iterator[str]:
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
