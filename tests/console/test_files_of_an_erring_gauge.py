"""Files of a gauge whose spindle errs: two of one part find that, and it is taken off what the gauge reads."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.data.run_reader import story
from console.session.gauge_in_use import use_gauge
from console.session.learning.evaluated_part import evaluate_part
from console.session.station.commands import MeasureTurned
from console.session.station.state import MeasuredPart, StationState
from profiles.metrology.conformity import ToleranceKind, figure_of
from profiles.traces import Trace, read_trace, write_trace
from tests.console.commands import Console
from tests.console.floor import known
from tests.console.test_report import page_of, words
from tests.console.test_traces_from_a_gauge import STATED, Outside
from tests.console.test_traces_from_a_gauge import outside as outside

GAUGE_UM, GAUGE_DEG = 3.0, 20.0
OWN = """schema = 1
name = "own"
calibrated = "2026-03-01"
[probe]
probe_noise_um = 0.05
probe_gain_percent = 0.0
[set_up]
repeat_um = 0.0
set_up_angle_deg = {angle}
"""


def erring(path: Path, name: str, turned_deg: float, drift_um: float = 0.0) -> Path:
    """Write what such a gauge reads of the part of a file, when it is turned by so much in its own angles."""
    part = read_trace(path)
    angle_deg = np.mod(part.angle_deg + turned_deg, 360.0)
    order = np.argsort(angle_deg)
    error_um = (GAUGE_UM + drift_um) * np.cos(2.0 * np.radians(angle_deg - GAUGE_DEG))
    read = replace(part, angle_deg=angle_deg[order], deviation_um=(part.deviation_um + error_um)[order])
    target = path.with_name(name)
    write_trace(target, read, overwrite=True)
    return target


def oval_um(trace: Trace) -> float:
    """Return the amplitude at 2 UPR, by the Fourier sum."""
    return float(abs(2.0 * np.mean(trace.deviation_um * np.exp(-2j * np.radians(trace.angle_deg)))))


def state_spindle(data: Path, name: str, um: float, upr: str = "") -> None:
    """Write a gauge that states its spindle, too: at the orders at which two placements are blind it counts."""
    text = OWN.format(angle=0.05).replace("own", name)
    (data / "gauges" / f"{name}.toml").write_text(f"{text}[spindle]\nspindle_error_um = {um}\n{upr}\n")


def measured(outside: Outside, drift_um: float = 0.0) -> tuple[MeasuredPart, StationState]:
    """Import a part from that gauge, then the file of it turned by 90 deg."""
    true = outside.gauge("true.csv", **STATED)
    first = outside.taken(erring(true, "first.csv", 0.0, drift_um))
    second = outside.order(erring(true, "second.csv", 90.0, drift_um))
    return first, outside.floor.do(MeasureTurned(second=second))


@pytest.fixture
def own(outside: Outside) -> Outside:
    folder = outside.data / "gauges"
    folder.mkdir(parents=True)
    (folder / "own.toml").write_text(OWN.format(angle=0.05))
    use_gauge(outside.data, "own")
    return outside


def test_two_files_of_one_part_find_the_error_of_their_gauge(own: Outside) -> None:
    own.cut()
    first, state = measured(own)
    assert oval_um(first.trace) == pytest.approx(GAUGE_UM, abs=0.3)
    judged = known(figure_of(ToleranceKind.ROUNDNESS, first.judged))
    assert judged.passes is None  # nobody knows how this spindle errs
    both = known(state.measured)
    assert both.run_id == first.run_id
    true = read_trace(own.data / "traces" / "true.csv")
    assert oval_um(both.trace) == pytest.approx(oval_um(true), abs=0.02)
    (told,) = [each for each in both.result.warnings if each.code == "gauge.error_off"]
    assert told.key == "own" and "2 UPR 3.0" in told.value
    # The record gives the same figures from the file as it was filed.
    kept = known(known(story(own.data, known(both.run_id)).product))
    again = known(evaluate_part(kept, {}))
    assert again.result.ront_um == pytest.approx(both.result.ront_um, abs=1e-9) and again.differing == ()
    assert known(kept.trace) == (own.data / "traces" / "first.csv").read_bytes()
    # The next part is read without it, too.
    own.cut()
    state_spindle(own.data, "own", 0.02)
    later = own.taken(erring(own.gauge("later.csv", **STATED), "next.csv", 0.0))
    true = read_trace(own.data / "traces" / "later.csv")
    assert oval_um(later.trace) == pytest.approx(oval_um(true), abs=0.02)
    assert 0.05 < known(known(later.budget).expanded.roundness_um) < 1.0
    assert [each.code for each in later.result.warnings][:1] == ["gauge.error_off"]


def test_the_report_of_such_a_part_names_what_was_taken_off_when_the_gauge_was_calibrated_and_every_limit(
    own: Outside,
) -> None:
    own.cut()
    _, state = measured(own)
    page = words(page_of(own.data, known(known(state.measured).run_id)))
    assert "error of the gauge, taken off own" in page and "2 UPR 3.0" in page
    assert "gauge calibrated 2026-03-01" in page
    assert "tolerance ± 60 µm" in page and "no tolerance to judge it by" not in page  # not proven is judged


def test_a_second_placement_needs_another_file_and_a_gauge_with_a_name(outside: Outside) -> None:
    outside.cut()
    first = erring(outside.gauge("true.csv", **STATED), "first.csv", 0.0)
    turned = MeasureTurned(second=outside.order(first))
    assert [each.code for each in outside.floor.do(turned).refusals] == ["gauge.no_first"]
    outside.taken(first)
    assert [each.code for each in outside.floor.do(turned).refusals] == ["gauge.none_chosen"]
    use_gauge(outside.data, "indicator-on-table", outside.floor.state.machine)
    assert [each.code for each in outside.floor.do(turned).refusals] == ["separation.same_file"]


def test_a_gauge_that_has_changed_is_told_by_how_much(own: Outside) -> None:
    own.cut()
    measured(own)
    own.cut()
    _, state = measured(own, drift_um=0.8)
    (told,) = [each for each in known(state.measured).result.warnings if each.code == "gauge.error_drifted"]
    assert told.value == "2 UPR 0.800 um"


def test_an_outdated_error_is_not_taken_off_and_nothing_is_learned_with_it(own: Outside, console: Console) -> None:
    own.cut()
    first, _ = measured(own)
    (kept,) = (own.data / "calibrations").rglob("gauge-error-*.json")
    table = json.loads(kept.read_text())
    table["found"]["valid_until"] = "2020-01-31"
    kept.write_text(json.dumps(table))
    own.cut()
    later = own.taken(erring(own.gauge("later.csv", **STATED), "next.csv", 0.0))
    assert oval_um(later.trace) == pytest.approx(oval_um(first.trace), abs=0.3)
    assert [each.code for each in later.result.warnings][:1] == ["gauge.error_expired"]
    next_file = str(own.data / "traces" / "next.csv")
    job, machine = str(own.job.path), str(own.machine.path)
    learn = ("learn", next_file, "--job", job, "--machine", machine, "--strategy", "cam", "--data", str(own.data))
    said = console(*learn, "--gauge", "own")
    assert said.code == 1 and "2020-01-31" in said.err and "--separate 0,90" in said.err


def test_learning_on_a_gauge_takes_its_error_off_and_is_as_unsure_as_the_gauge(
    own: Outside, console: Console
) -> None:
    own.cut()
    measured(own)
    own.cut()
    state_spindle(own.data, "own", 0.02)
    state_spindle(own.data, "poor", 2.0, "spindle_error_upr = 3")
    erring(own.gauge("later.csv", **STATED), "next.csv", 0.0)
    job, machine = str(own.job.path), str(own.machine.path)

    def learn(name: str, *more: str) -> Any:
        of = ("--job", job, "--machine", machine, "--strategy", "cam", "--data", str(own.data), "--json")
        return console("learn", str(own.data / "traces" / name), *of, *more).json

    true, plain, with_gauge = learn("later.csv"), learn("next.csv"), learn("next.csv", "--gauge", "own")
    ront_um = [each["measured"]["RONt_um"] for each in (true, plain, with_gauge)]
    assert ront_um[2] == pytest.approx(ront_um[0], abs=0.05) and ront_um[1] > ront_um[0] + 1.0
    assert "uncertainty" not in plain and with_gauge["uncertainty"]["RONt_U_um"] > 0.0
    assert any("2 UPR 3.0" in each for each in with_gauge["warnings"])
    sure, unsure = (each["expected"]["half_width_um_pp"] for each in (true, learn("later.csv", "--gauge", "poor")))
    # 95 % of a phasor off in any direction, peak to peak, beside the scatter of clamping
    assert unsure == pytest.approx(math.hypot(sure, 2.0 * 2.448 * 2.0 / math.sqrt(2.0)), rel=0.02)
    (own.data / "gauges" / "silent.toml").write_text(OWN.format(angle=0.05).replace("own", "silent"))
    told = [str(learn("later.csv", "--gauge", name)["warnings"]) for name in ("silent", "poor", "own")]
    assert ["does not state the error of its spindle" in each for each in told] == [True, False, False]
