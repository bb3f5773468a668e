"""The lobe as a compensation table: each row runs over the spindle angle, the amplitude changes with Z.

The rows are evenly spaced over the whole travel of Z, so that no position rolls over into another one. Those
before the part are zeros; from one of them to the next the amplitude grows to its full value, clear of the part;
after the cut they are zeros again. The table holds the cam less its value at spindle zero; the program adds that
constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.compensation.table import PARTS_PER_COUNT, CompensationTable, TableDefinition, TableSource
from drivers.pmac.programs.setup import CutSetup
from profiles.compensations.path import LobedPath, chord_error, chord_scale
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError

CHORD_LIMIT_UM = 0.05  # Permitted deviation of the linear interpolation from the sinusoid
ROW_MM = 10.0  # Approximate Z distance over which the amplitude grows
ROWS_IN_FRONT = 2  # Least number of row spacings before the part: one of zeros, one in which the amplitude grows
LEAST_ROW_MM = 0.5  # A shorter spacing leaves no place to stand in the row of zeros
INSIDE_MM = 0.2  # Distance of the carriage from the last row of zeros while the table is switched


@dataclass(frozen=True, slots=True, kw_only=True)
class Cam:
    """A table with the data that the program needs; positions in counts.

    `mean` is the program's tool position, the table's constant included. Up to `zero_z` the carriage is in a row
    of zeros, from `full_z` on the amplitude is full. `chord_error_um` is the error of the linear interpolation.
    `push_um` is that of the command.
    """

    table: CompensationTable
    mean: float
    zero_z: float
    full_z: float
    chord_error_um: float
    push_um: float = 0.0

    @property
    def bytes_to_send(self) -> int:
        """Length of the entries as text, each with its space or line end."""
        return sum(len(str(entry)) + 1 for entry in self.table.entries)


def make_cam(machine: MachineProfile, setup: CutSetup, command: LobedPath) -> Cam:
    """Return the table that makes the tool follow `command` (um from the surface, infeed) by the spindle's angle.

    Raises ProblemError: `program.no_zero_row`, there is no room before the part.
    """
    columns, per_mm = column_count(command), machine.carriage.counts_per_mm
    spacing, front, full, rows = _rows(machine, setup)
    definition = TableDefinition(
        motor=machine.tool.motor,
        sources=(
            TableSource(machine.spindle.motor, setup.counts_per_turn),
            TableSource(machine.carriage.motor, rows * spacing),
        ),
        target=machine.tool.motor,
        columns=columns,
        rows=rows,
    )
    wave = _corners_um(command, columns) / setup.tool_count_um
    held = float(wave[0])
    gain = np.zeros(rows + 1)
    places = spacing * np.arange(front, full + 1)
    gain[front : full + 1] = 1.0 + command.growth_per_mm * (places - setup.carriage_middle) / per_mm
    # The program adds a constant; a row with harmonics of another amplitude has the difference.
    whole = (gain > 0.0).astype(float)
    entries = np.rint(PARTS_PER_COUNT * (np.outer(gain, wave) - held * whole[:, None])).astype(int).ravel()
    return Cam(
        table=definition.filled([int(entry) for entry in entries[1:]]),
        mean=setup.surface + command.mean_um / setup.tool_count_um + held,
        zero_z=(front - 1) * spacing - INSIDE_MM * per_mm,
        full_z=front * spacing,
        chord_error_um=_chord_error_um(command, columns),
        push_um=command.push_um,
    )


def column_count(command: LobedPath) -> int:
    """Return the fewest columns, the same number for each lobe, that keep the chord error within its limit."""
    columns = 4 * max(wave.lobes for wave in command.harmonics)
    columns += -columns % command.lobes
    while _chord_error_um(command, columns) > CHORD_LIMIT_UM:
        columns += command.lobes
    return columns


def _chord_error_um(command: LobedPath, columns: int) -> float:
    return sum(wave.amplitude_um * chord_error(columns / wave.lobes) for wave in command.harmonics)


def _corners_um(command: LobedPath, columns: int) -> NDArray[np.float64]:
    """Return the harmonics at the columns of a turn, both ends included, scaled up to compensate the chords."""
    angle_deg = 360.0 * np.arange(columns + 1) / columns
    corners = np.zeros(columns + 1)
    for wave in command.harmonics:
        corners += chord_scale(columns / wave.lobes) * wave.at_um(angle_deg)
    return corners


def _rows(machine: MachineProfile, setup: CutSetup) -> tuple[int, int, int, int]:
    """Return the spacing in counts, the first and the last row of full amplitude, and the number of spacings.

    Raises ProblemError: `program.no_zero_row`.
    """
    carriage = machine.carriage
    front = max(ROWS_IN_FRONT, round(setup.carriage_start / (ROW_MM * carriage.counts_per_mm)))
    spacing = math.floor(setup.carriage_start / front)
    least = LEAST_ROW_MM * carriage.counts_per_mm
    if spacing < least:
        here_mm = setup.carriage_start / carriage.counts_per_mm
        value, limit = f"{here_mm:.2f} mm", f">= {ROWS_IN_FRONT * LEAST_ROW_MM:g} mm"
        raise ProblemError(Problem(code="program.no_zero_row", key="overhang_mm", value=value, limit=limit))
    # The carriage keeps feeding for some turns while the tool retracts.
    end = setup.carriage_start + setup.carriage_counts + setup.carriage_per_turn
    full = math.ceil(end / spacing) + 1
    travel = (carriage.travel_max_mm - carriage.travel_min_mm) * carriage.counts_per_mm
    return spacing, front, full, max(full + 1, math.ceil(travel / spacing) + 1)
