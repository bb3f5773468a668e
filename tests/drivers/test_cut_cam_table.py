"""The table of a cam: zeros where it is switched, the whole amplitude over the part, chords within their limit."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cutting.corrected import with_table
from drivers.cutting.planning import Strategy, plan_cut
from drivers.pmac.check import CheckedMove, CheckedProgram
from drivers.pmac.compensation.table import step_counts
from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.program_text import read_program
from drivers.pmac.programs.cam import CHORD_LIMIT_UM, Cam, make_cam
from drivers.pmac.programs.setup import cut_setup
from drivers.pmac.trajectory.cubics import motion_of
from drivers.pmac.trajectory.linear import Timing
from drivers.pmac.trajectory.pieces import Piece, position_at
from drivers.pmac.trajectory.planned import MoveRecord
from profiles.compensations.path import LobedPath, target_path
from profiles.store import load_job, load_machine

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import JobMaker

MACHINE = load_machine("lee-2001-lathe").machine
JOB = load_job("lee-2001-experiment-1").job
TURN = 10_000

angles_deg = st.floats(-180.0, 180.0)


def cam(command: LobedPath, overhang_mm: float = JOB.overhang_mm) -> Cam:
    return make_cam(MACHINE, cut_setup(replace(JOB, overhang_mm=overhang_mm), MACHINE), command)


def sine(amplitude_um: float = 31.0, lobes: int = 3, phase_deg: float = 17.0) -> LobedPath:
    return LobedPath(mean_um=100.0, amplitude_um=amplitude_um, lobes=lobes, phase_deg=phase_deg)


@given(amplitude=st.floats(0.5, 200.0), lobes=st.integers(2, 12), crest=angles_deg)
def test_the_tool_is_on_the_sinusoid_wherever_the_spindle_is(amplitude: float, lobes: int, crest: float) -> None:
    command = sine(amplitude, lobes, crest)
    made = cam(command)
    setup = cut_setup(JOB, MACHINE)
    spindle = np.linspace(0.0, TURN, 1237)
    z = setup.carriage_start + 0.5 * setup.carriage_counts
    tool = np.array([made.mean + made.table.correction(float(angle), z) for angle in spindle])
    error_um = (tool - setup.surface) * 0.2 - command.at_um(spindle * 0.036)
    # Half a sixteenth of a count is what entries, and the constant against them, are rounded by.
    assert np.abs(error_um).max() <= CHORD_LIMIT_UM + 0.2 / 16.0
    assert made.chord_error_um <= CHORD_LIMIT_UM


@given(overhang=st.floats(10.0, 190.0), crest=angles_deg)
def test_the_rows_are_zero_where_it_is_switched_and_whole_over_the_part(overhang: float, crest: float) -> None:
    made = cam(sine(phase_deg=crest), overhang)
    setup = cut_setup(replace(JOB, overhang_mm=overhang), MACHINE)
    table = made.table
    rows = np.array(table.grid)
    assert np.all(rows[0] == 0.0)
    assert np.all(rows[-1] == 0.0)
    # Switched there, with the spindle anywhere, nothing is thrown.
    assert step_counts(table, (None, (0.0, made.zero_z + 100.0))) == 0.0
    whole = table.correction(1234.0, setup.carriage_start)
    assert whole == pytest.approx(table.correction(1234.0, setup.carriage_start + setup.carriage_counts))
    assert made.full_z <= setup.carriage_start
    # No place of the travel is rolled over into another one: -5 to 199 mm.
    assert table.definition.sources[1].span_counts >= 204_000


@pytest.mark.parametrize("z_mm", [-5.0, -0.001, 0.0, 0.001, 50.0])
def test_from_the_end_of_the_travel_through_home_to_the_part_the_table_adds_nothing(z_mm: float) -> None:
    assert step_counts(cam(sine()).table, (None, 1000.0 * z_mm)) == 0.0


def test_at_the_zero_of_the_spindle_the_table_is_zero_and_the_program_carries_the_rest(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    made = cam(sine(phase_deg=40.0))
    assert [row[0] for row in made.table.grid] == [0.0] * len(made.table.grid)
    setup = cut_setup(JOB, MACHINE)
    constant = made.mean - setup.surface - 500.0
    assert constant == pytest.approx(155.0 * math.cos(math.radians(120.0)), rel=2e-3)
    plan = plan_cut(experiment(1), machine, Strategy.CAM)
    assert plan.table is not None
    assert [sent.table for sent in plan.program.tables] == [plan.table]


def test_the_table_is_sent_in_lines_that_a_card_takes_before_the_program(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    plan = plan_cut(experiment(1), machine, Strategy.CAM)
    assert plan.table is not None
    sent = table_lines(plan.table)
    lines = plan.program.lines
    assert lines[:3] == ("ENDGATHER", "DELETE GATHER", "#1 DELETE COMP")
    assert lines[3 : 3 + len(sent)] == tuple(sent)
    assert lines.index("OPEN PROG 3") > 3 + len(sent)
    # 7200 are known to take 11 s at 38400 baud.
    assert len(plan.table.entries) < 7200
    assert read_program(plan.text).lines == lines


def turning(duration_ms: float, z_from: float, z_per_ms: float) -> CheckedProgram:
    """Tool at 1000, spindle at 1000 rpm from zero, Z as told: one move of one piece."""
    cubics = ((1000.0, 0.0, 0.0, 0.0), (0.0, TURN / 60.0, 0.0, 0.0), (z_from, z_per_ms, 0.0, 0.0))
    piece = Piece(duration_ms, cubics)
    end = tuple(position_at(cubic, duration_ms) for cubic in cubics)
    timing = Timing(ta_ms=0.0, ts_ms=0.0, tm_ms=duration_ms)
    move = CheckedMove(record=MoveRecord(line=0, target=end, asked=timing, timing=None), pieces=(piece,))
    nothing = {1: 0.0, 2: 0.0, 3: 0.0}
    return CheckedProgram(
        motors=(1, 2, 3),
        moves=(move,),
        duration_ms=duration_ms,
        peak_velocity=nothing,
        lowest=nothing,
        highest=nothing,
    )


@pytest.mark.parametrize(("z_from", "z_per_ms"), [(172_000.0, 0.8), (155_000.0, 10.0), (160_000.0, 20.0)])
def test_what_the_table_adds_is_put_into_the_motion_a_cycle_late(z_from: float, z_per_ms: float) -> None:
    """Motors 2 and 3 come behind motor 1: the table sees them where they were in the cycle before."""
    period_ms = 0.4427
    table = cam(sine()).table
    made = with_table(turning(400.0, z_from, z_per_ms), table, period_ms)
    instant_ms, errors = 0.0, []
    for piece in made.moves[0].pieces:
        for share in (0.0, 0.3, 0.7):
            t_ms = instant_ms + share * piece.duration_ms
            seen_ms = t_ms - period_ms
            added = table.correction(seen_ms * TURN / 60.0, z_from + z_per_ms * seen_ms)
            errors.append(position_at(piece.cubics[0], share * piece.duration_ms) - 1000.0 - added)
        instant_ms += piece.duration_ms
    assert instant_ms == pytest.approx(400.0)
    assert np.abs(errors).max() * 0.2 < 0.1
    pieces = made.moves[0].pieces
    assert (made.lowest[1], made.highest[1]) == motion_of(pieces, 0).extent()
    # 155 counts at 50 Hz are 48.7 counts/ms at most.
    assert made.peak_velocity[1] == pytest.approx(155.0 * 0.314159, rel=0.02) or z_per_ms > 1.0


def test_the_amplitude_of_the_command_is_that_of_the_servo_with_the_delay_of_the_source(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """0.885 at -0.903 rad is the loop at 50 Hz; one cycle of 0.4427 ms is another 0.1391 rad."""
    plan = plan_cut(experiment(1), machine, Strategy.CAM)
    assert plan.table is not None
    z = plan.carriage_start + 1000.0
    spindle = np.arange(0.0, TURN, 5.0)
    tool = np.array([plan.table.correction(float(angle), z) for angle in spindle]) * 0.2
    lobe = 2.0 * np.mean(tool * np.exp(-1j * 3.0 * spindle * 2.0 * np.pi / TURN))
    assert abs(lobe) == pytest.approx(27.5 / 0.885, rel=2e-3)
    ahead = (math.radians(3 * target_path(experiment(1)).phase_deg) + np.angle(lobe)) % (2 * math.pi)
    assert ahead == pytest.approx(0.903 + 0.1391, abs=0.003)
