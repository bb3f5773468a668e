"""The state that SAVE keeps: settings, definitions, programs and tables, in memory or in a persistent file.

The values of P, Q and M are not included, nor an incomplete table. The file is JSON, written atomically.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

from drivers.pmac.axes import scan_definition
from drivers.pmac.compensation.table_text import read_table, table_lines
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import StoredLine, stored_line, stored_plc_lines
from drivers.pmac.memory import scan_pointer
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.leads import Conversion
from drivers.simulator.card.plc_programs import PlcPrograms
from drivers.simulator.card.table_memory import Password, TableMemory
from profiles.files import printable, read_regular_file, write_atomically
from profiles.problem import Problem, ProfileError
from profiles.strict_values import from_json, read_own

SCHEMA = 1
UNREADABLE = "file.unreadable"
CAP_BYTES = 4_000_000  # more than any controller has room for; parsed, it takes some twenty times as much
Texts = Mapping[str, tuple[str, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedState:
    """The whole state as text, by number; `axes` are definitions such as `#1->X` by coordinate system.

    `tables` are the lines that send a compensation table, by its motor, `conversion` the changed words of the
    encoder conversion table, by their line, `kinematics` the programs INVERSE and FORWARD by coordinate system.
    """

    family: str
    settings: Mapping[str, float]
    pointers: Mapping[str, str]
    axes: Texts
    programs: Texts
    plcs: Texts
    password: str
    tables: Texts
    conversion: Mapping[str, int]
    kinematics: Mapping[str, Texts]


class Memories(Protocol):
    """The parts of a controller that SAVE keeps."""

    dialect: Dialect
    programs: dict[int, list[StoredLine]]
    plcs: PlcPrograms
    systems: dict[int, CoordinateSystem]
    tables: TableMemory
    conversion: Conversion
    password: Password

    @property
    def variables(self) -> VariableStore:
        """Its numbered variables."""


class Flash:
    """The non-volatile memory; with a `path`, a file."""

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._state: SavedState | None = None

    def save(self, controller: Memories) -> None:
        """Save the present state. Raises ProfileError: `file.not_writable`; the earlier state is still there."""
        state = _take_saved_state(controller)
        if self._path is not None:
            content = json.dumps({"schema": SCHEMA, **asdict(state)}, indent=1).encode("ascii")
            write_atomically(self._path, content, overwrite=True)
        self._state = state

    def power_up(self, controller: Memories) -> None:
        """Restore what an earlier process has saved, if there is such a file.

        Raises:
            ProfileError: `file.unreadable`, not such a file, or of another family of controllers;
                `schema.unsupported`.
        """
        if self._path is None or not self._path.exists():
            return
        content, where = read_regular_file(self._path, cap_bytes=CAP_BYTES), printable(str(self._path))
        try:
            state = read_own(
                SavedState, from_json(content), schema=SCHEMA, code=UNREADABLE, where=where, judge=_judge
            )
            if state.family != controller.dialect.name:
                raise ValueError(f"saved by a controller of the family {state.family}")
            _put_back(state, controller)
        except (ValueError, KeyError, PmacError) as error:
            raise ProfileError(Problem(code=UNREADABLE, where=where, value=printable(str(error)))) from error
        self._state = state

    def restore(self, controller: Memories) -> None:
        """Restore the saved state; without one, the controller stays as it is."""
        if self._state is not None:
            _put_back(self._state, controller)


def _take_saved_state(controller: Memories) -> SavedState:
    variables = controller.variables
    return SavedState(
        family=controller.dialect.name,
        settings={str(index): value for index, value in sorted(variables.settings().items())},
        pointers={str(index): str(pointer) for index, pointer in sorted(variables.pointers.items())},
        axes={
            str(number): tuple(f"#{motor}->{text}" for motor, text in system.frame.definitions.items())
            for number, system in controller.systems.items()
            if system.frame.definitions
        },
        programs=_texts({number: [line.text for line in lines] for number, lines in controller.programs.items()}),
        plcs=_texts({number: [line.text for line in lines] for number, lines in controller.plcs.buffers.items()}),
        conversion={str(line): word for line, word in controller.conversion.changed_words.items()},
        tables=_texts({number: table_lines(table) for number, table in controller.tables.tables.items()}),
        password=controller.password.text,
        kinematics={
            str(number): {
                kind: tuple(line.text for line in lines) for kind, lines in system.kinematic_lines.items()
            }
            for number, system in controller.systems.items()
            if system.kinematic_lines
        },
    )


def _texts(listings: Mapping[int, Iterable[str]]) -> Texts:
    return {str(number): tuple(lines) for number, lines in sorted(listings.items())}


def _judge(state: SavedState) -> None:
    """Refuse invalid numbers of variables, systems and programs."""
    for numbered in asdict(state).values():
        if isinstance(numbered, Mapping):
            _ = [int(number) for number in numbered]


def _put_back(state: SavedState, controller: Memories) -> None:
    variables = controller.variables
    variables.replace_i({int(index): value for index, value in state.settings.items()})
    highest = controller.dialect.highest_address
    scanned = {int(index): scan_pointer(Scanner(text), highest) for index, text in state.pointers.items()}
    variables.pointers.clear()
    variables.pointers.update({index: pointer for index, pointer in scanned.items() if pointer is not None})
    for system in controller.systems.values():
        for motor in tuple(system.frame.definitions):
            system.define(motor, None)
    for number, texts in state.axes.items():
        for text in texts:
            scanner = Scanner(text)
            scanner.expect("#")
            motor = scanner.take_integer() or 0
            scanner.expect("->")
            controller.systems[int(number)].define(motor, scan_definition(scanner, motor))
    programs = {int(number): [stored_line(line) for line in lines] for number, lines in state.programs.items()}
    plcs = {
        int(number): [kept for line in lines for kept in stored_plc_lines(line)]
        for number, lines in state.plcs.items()
    }
    for index, system in controller.systems.items():
        kept = state.kinematics.get(str(index), {})
        system.kinematic_lines = {kind: [stored_line(line) for line in lines] for kind, lines in kept.items()}
    controller.programs.clear()
    controller.programs.update(programs)
    controller.plcs.buffers.clear()
    controller.plcs.buffers.update(plcs)
    motor_count = controller.dialect.motor_count
    controller.tables.replace([read_table(lines, motor_count) for lines in state.tables.values()])
    controller.conversion.reset({int(line): word for line, word in state.conversion.items()})
    controller.password = Password(state.password)
