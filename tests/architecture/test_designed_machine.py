"""The machine of the benchmarks with designed gains: its variables and its gains say the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import learning
from benchmarks.designed_loop import machine_text
from profiles.axis.servo_gains import gains_from_variables, meant_gains, present_settings
from profiles.store import load_machine
from tests.tui.tune_stage import FIRST

PUBLISHED = load_machine("lee-2001-lathe").machine


@pytest.mark.parametrize("settings", [{"I130": 2042.0, "I131": 1656.0, "I132": 1656.0, "I133": 74267.0}, FIRST])
def test_a_machine_with_proposed_gains_states_the_same_twice(settings: dict[str, float], tmp_path: Path) -> None:
    path = tmp_path / "lee-2001-lathe.toml"
    path.write_text(machine_text(settings), encoding="utf-8")
    machine = load_machine(str(path)).machine
    assert present_settings(machine, settings) == pytest.approx(settings)
    stated, there = meant_gains(machine).at_rest, gains_from_variables(machine).at_rest
    assert stated.kp_v_per_m == pytest.approx(there.kp_v_per_m, rel=1e-9)
    assert stated.kd_v_s_per_m == pytest.approx(there.kd_v_s_per_m, rel=1e-9)
    assert machine.spindle == PUBLISHED.spindle


@pytest.mark.long
def test_the_gains_of_the_learning_benchmark_are_those_that_tune_proposes(tmp_path: Path) -> None:
    """By the commands of docs/tuning.md: what they propose for this lathe is stiffer than the published gains."""
    proposed = learning.designed()
    machine = load_machine(learning.machine_file("loop", tmp_path)).machine
    assert present_settings(machine, proposed) == pytest.approx(proposed)
    assert gains_from_variables(machine).kp_v_per_m > 2.0 * gains_from_variables(PUBLISHED).kp_v_per_m
