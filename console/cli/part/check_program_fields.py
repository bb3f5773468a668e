"""Checked program for JSON: counts and ms, and the units of the axes where a motor has one."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping

from console.cli.part.check_program_lines import explanation_line, finding_line
from console.text.catalogue import Catalogue
from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis
from drivers.pmac.analysis.program import ProgramCheck
from drivers.pmac.analysis.units import unit_of
from drivers.pmac.trajectory.linear import Timing
from profiles.findings import Severity
from profiles.machine import MachineProfile

_LEVELS = {Severity.REFUSAL: "fault", Severity.WARNING: "warning", Severity.NOTICE: "notice"}
"""JSON names of the severities in a program."""


def program_fields(
    options: Namespace, machine: MachineProfile, checked: ProgramCheck, text: Catalogue
) -> dict[str, object]:
    """Return the program with every move, finding and sentence."""
    return {
        "file": options.file,
        "machine": machine.name,
        "program": checked.number,
        "start": {"source": checked.start.source.value, "positions": dict(checked.start.positions)},
        "ta_ms": options.ta_ms,
        "ts_ms": options.ts_ms,
        "duration_ms": checked.duration_ms,
        "moves": [_move(machine, move, place) for move, place in zip(checked.moves, checked.places, strict=True)],
        "findings": [
            {
                "level": _LEVELS[finding.severity],
                "code": finding.code.value,
                "lines": list(finding.lines),
                "values": dict(finding.values),
                "text": finding_line(finding, text),
            }
            for finding in checked.findings
        ],
        "explanation": [
            {"code": s.code.value, "values": dict(s.values), "text": explanation_line(s, text)}
            for s in checked.explanation
        ],
    }


def _move(machine: MachineProfile, move: MoveAnalysis, place: int) -> dict[str, object]:
    return {
        "line": place,
        "mode": move.mode,
        "by_move_time": move.by_move_time,
        "commanded": _times(move.asked),
        "effective": _times(move.used),
        "begins_ms": move.begins_ms,
        "ends_ms": move.ends_ms,
        "blended": move.blended,
        "motors": [_motor(machine, motor) for motor in move.motors],
    }


def _times(timing: Timing) -> dict[str, float]:
    return {"ta_ms": timing.ta_ms, "ts_ms": timing.ts_ms, "tm_ms": timing.tm_ms}


def _motor(machine: MachineProfile, motor: MotorMove) -> dict[str, object]:
    peaks = motor.peaks
    lengths = {
        "target": motor.target,
        "commanded": motor.commanded,
        "reached": motor.reached,
        "made": motor.made,
        "lost": motor.lost,
    }
    fields: dict[str, object] = {
        "motor": motor.motor,
        **{f"{name}_counts": counts for name, counts in lengths.items()},
        "turns": motor.turns,
        "velocity_counts_per_ms": peaks.velocity,
        "acceleration_counts_per_ms2": peaks.acceleration,
        "jerk_counts_per_ms3": peaks.jerk,
    }
    return fields | _in_units(machine, motor.motor, lengths, motor)


def _in_units(
    machine: MachineProfile, number: int, lengths: Mapping[str, float], motor: MotorMove
) -> dict[str, object]:
    unit = unit_of(machine, number)
    if unit is None:
        return {}
    peaks = motor.peaks

    def key(name: str, unit_name: str) -> str:
        return f"{name}_{unit_name.replace('/', '_per_')}"

    return {
        **{key(name, unit.name): counts * unit.per_count for name, counts in lengths.items()},
        key("velocity", unit.velocity_unit): peaks.velocity * unit.velocity,
        key("acceleration", unit.acceleration_unit): peaks.acceleration * unit.acceleration,
        key("jerk", unit.jerk_unit): None if peaks.jerk is None else peaks.jerk * unit.jerk,
    }
