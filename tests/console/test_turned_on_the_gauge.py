"""Inspect's second placement on a simulated gauge that errs: its error found, kept and taken off."""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import pytest

from console.session.station.commands import Measure, MeasureTurned, Start
from profiles.roundness import RoundnessResult
from tests.console.floor import experiment_1, known, open_floor

GAUGE_UM, GAUGE_DEG = 3.0, 20.0
PLANT = f"""[gauge]
spindle_error_um = {GAUGE_UM}
spindle_error_deg = {GAUGE_DEG}
"""


def oval(result: RoundnessResult) -> complex:
    """Return the oval, um, as a vector towards twice the angle of its maximum."""
    two = result.harmonics[0]
    return cmath.rect(two.amplitude_um, math.radians(2.0 * two.phase_deg))


def test_the_error_of_the_gauge_is_found_kept_and_taken_off_what_it_reads_later(tmp_path: Path) -> None:
    plant = tmp_path / "plant.toml"
    plant.write_text(PLANT)
    floor = open_floor(tmp_path, 1, str(plant))
    assert [each.code for each in floor.do(MeasureTurned()).refusals] == ["gauge.no_reading"]
    floor.set_up(experiment_1())
    floor.arm(experiment_1())
    floor.do(Start())
    alone = known(floor.do(Measure()).measured)
    assert alone.result.ront_um == pytest.approx(2.0 * GAUGE_UM, abs=0.5)
    passed_um = GAUGE_UM * 0.5 ** (2.0 / 50.0) ** 2  # of 2 UPR by the filter of 50
    own_um = oval(alone.result) - cmath.rect(passed_um, math.radians(2.0 * GAUGE_DEG))
    both = known(floor.do(MeasureTurned()).measured)
    assert both.run_id == alone.run_id
    assert both.result.ront_um < 0.5
    assert abs(oval(both.result) - own_um) < 0.002
    told = {each.code: each.value for each in both.result.warnings}
    assert (
        "2 UPR 3.000 um at 20.0 deg" in told["gauge.error_off"]
        and "blind at 4, 8, 12 UPR" in told["gauge.error_off"]
    )
    assert max(each.ront_um for each in known(both.whole).sections) < 0.5
    # Whatever this gauge measures next is free of its error, and says so.
    floor.context.tell(cut_done=True)
    later = known(floor.do(Measure()).measured)
    assert later.result.ront_um < 0.5
    assert [each.code for each in later.result.warnings] == ["gauge.error_off"]
