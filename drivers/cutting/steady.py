"""The steady cut: the moves between those that lead into it and out of it, their speed and their stroke."""

from __future__ import annotations

from itertools import pairwise

from drivers.pmac.check import CheckedMove, CheckedProgram, loop_lines
from drivers.pmac.program_text import ProgramText
from drivers.pmac.trajectory.cubics import motion_of
from profiles.machine import MachineProfile

STEADY_FEED = 0.999999
"""Share of the longest feed in a loop from which a move belongs to the steady cut."""


def steady_moves(
    program: ProgramText, checked: CheckedProgram, machine: MachineProfile
) -> tuple[CheckedMove, ...]:
    """Return the moves of the loop in which the carriage feeds, without those that lead into and out of it."""
    lines = loop_lines(program.program)
    index = checked.motors.index(machine.carriage.motor)
    steps = [
        (after.record.target[index] - before.record.target[index], after)
        for before, after in pairwise(checked.moves)
        if after.record.line in lines
    ]
    furthest = max(step for step, _ in steps)
    moves = [move for step, move in steps if step > STEADY_FEED * furthest]
    tail = max(2, len(moves) // 4)
    return tuple(moves[-tail - 1 : -1])


def speed_rpm(loop: tuple[CheckedMove, ...], checked: CheckedProgram, machine: MachineProfile) -> float:
    """Return the speed of the spindle in the steady cut."""
    index = checked.motors.index(machine.spindle.motor)
    counts = loop[-1].record.target[index] - loop[0].record.target[index]
    minutes = sum(move.used.tm_ms for move in loop[1:]) / 60_000.0
    return counts / machine.spindle.counts_per_rev / minutes


def stroke(loop: tuple[CheckedMove, ...], checked: CheckedProgram, machine: MachineProfile) -> tuple[float, float]:
    """Return the lowest and highest tool position of the steady cut, counts."""
    index = checked.motors.index(machine.tool.motor)
    return motion_of([piece for move in loop[1:] for piece in move.pieces], index).extent()
