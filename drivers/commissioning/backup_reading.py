"""Read the text of a backup into the configuration that it was written from."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.commissioning.backup_text import END_OF_HEADER, TITLE
from drivers.commissioning.configuration import AxisEntry, Configuration, TableEntry, digest
from drivers.pmac.dialect import DIALECTS
from profiles.files import printable
from profiles.problem import Problem, ProfileError

CAP_BYTES = 16_000_000
MOST_LINES = 300_000  # every setting, every pointer, and programs up to the memory of a controller
MOST_CHARACTERS = 1000  # characters per line: a controller accepts a quarter of it
MOST_WORDS = 8192  # words of the encoder conversion table, far more than any has
_HEADER = ("family", "type", "version", "date", "sha256")
_SETTING = re.compile(r"I(\d+)(?:\.\.(\d+))?=(-?[\d.]+|\$[0-9A-F]+)(?: ; no limit)?")
_POINTER = re.compile(r"M(\d+)(\.\.\d+)?->(.+)")
_AXIS = re.compile(r"&(\d+)#(\d+)->(.+)")
_WORDS = re.compile(r"WY:\$[0-9A-F]+,([$0-9A-F,]+)")
_TABLE = re.compile(r"; #(\d+) COMP (\S+) (\d+) ([0-9a-f]{64})")
_LOCKED = re.compile(r"; locked (.+)")
_OPEN = re.compile(r"OPEN (PLC|PROG)(\d+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Backup:
    """A configuration with the date of its header."""

    configuration: Configuration
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
    gathered = _Gathered(highest_index=DIALECTS[header["family"]].highest_index)
    for number, line in enumerate(body, start=end + 2):
        _refuse_above(len(line), MOST_CHARACTERS, "characters", f"{where}:{number}")
        try:
            gathered.take(line)
        except ValueError as error:
            value = f"{number}: {printable(line, 60)}"
            raise ProfileError(Problem(code="controller.backup_line", where=where, value=value)) from error
        _refuse_above(gathered.highest, gathered.highest_index, "I, M", f"{where}:{number}")
        _refuse_above(len(gathered.conversion), MOST_WORDS, "WY", f"{where}:{number}")
    return Backup(configuration=gathered.configuration(header), date=header["date"])


def _refuse_above(actual: int, most: int, unit: str, where: str) -> None:
    if actual > most:
        value, code = printable(str(actual), 30), "controller.backup_too_large"
        raise ProfileError(Problem(code=code, where=where, key=unit, value=value, limit=str(most)))


@dataclass
class _Gathered:
    """The content of the lines so far. A line `I0..N=` costs memory per entry: none above the highest is kept."""

    highest_index: int
    settings: dict[int, float] = field(default_factory=dict)
    axes: dict[int, AxisEntry] = field(default_factory=dict)
    pointers: dict[int, str] = field(default_factory=dict)
    buffers: dict[str, dict[int, list[str]]] = field(default_factory=lambda: {"PLC": {}, "PROG": {}})
    tables: dict[int, TableEntry] = field(default_factory=dict)
    conversion: list[int] = field(default_factory=list)
    locked: list[str] = field(default_factory=list)
    highest: int = 0
    _open: list[str] | None = None

    def take(self, line: str) -> None:
        """Parse one line. Raises ValueError: not a line of a backup."""
        if self._open is not None:
            if line == "CLOSE":
                self._open = None
            elif line != "CLEAR" or self._open:
                self._open.append(line)
            return
        readers: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], None]], ...] = (
            (_SETTING, self._setting),
            (_POINTER, self._pointer),
            (_AXIS, self._axis),
            (_WORDS, self._words),
            (_TABLE, self._table),
            (_LOCKED, lambda found: self.locked.append(found[1])),
            (_OPEN, self._begin),
        )
        for pattern, read in readers:
            if found := pattern.fullmatch(line):
                read(found)
                return
        if line and not line.startswith(";"):
            raise ValueError(line)

    def configuration(self, header: dict[str, str]) -> Configuration:
        """Return the complete configuration."""
        return Configuration(
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
        )

    def _setting(self, found: re.Match[str]) -> None:
        value = float(int(found[3][1:], 16)) if found[3].startswith("$") else float(found[3])
        first, last = int(found[1]), int(found[2] or found[1])
        self.highest = max(self.highest, last)
        if last <= self.highest_index:
            self.settings.update(dict.fromkeys(range(first, last + 1), value))

    def _pointer(self, found: re.Match[str]) -> None:
        self.highest = max(self.highest, int(found[1]))
        if found[2] is None:
            self.pointers[int(found[1])] = found[3]

    def _axis(self, found: re.Match[str]) -> None:
        self.axes[int(found[2])] = AxisEntry(int(found[1]), found[3])

    def _words(self, found: re.Match[str]) -> None:
        self.conversion += [int(word.removeprefix("$"), 16) for word in found[1].split(",")]

    def _table(self, found: re.Match[str]) -> None:
        self.tables[int(found[1])] = TableEntry(found[2], int(found[3]), found[4])

    def _begin(self, found: re.Match[str]) -> None:
        self._open = self.buffers[found[1]][int(found[2])] = []
