"""The predicted band of a machine that nobody has measured: what is assumed is said, and holds a lathe in use."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.cutting.planning import Strategy
from drivers.preview.band import Band, predicted_band
from drivers.preview.outlook import outlook
from drivers.preview.preview import Asked, program_of, underway
from drivers.simulator.plant.presets import plant_named
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import evaluate
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.drivers.conftest import connected

MACHINE: MachineProfile = load_machine("lee-2001-lathe").machine


def short(name: str) -> Job:
    return replace(load_job(name).job, cut_length_mm=1.0)


def band_of(job: Job, strategy: Strategy = Strategy.CAM) -> Band:
    asked = Asked(job=job, machine=MACHINE, strategy=strategy)
    band = predicted_band(underway(outlook(job, MACHINE, strategy), None, {strategy: program_of(asked)}), strategy)
    assert band is not None
    return band


@pytest.mark.long
def test_the_first_part_of_a_lathe_with_dry_guides_is_within_the_band_of_the_model() -> None:
    """3 N of the plant `realistic` hold a thin ring's tool so that 23 of 28 um are left."""
    job = short("thin-ring-3-jaws")
    bench = connected(MACHINE, true=plant_named("steady", MACHINE, 3))
    bench.homed(job)
    asked = program_of(Asked(job=job, machine=MACHINE, strategy=Strategy.CAM)).plan
    bench.cut(asked)  # type: ignore[arg-type]
    trace = bench.sim.measure()
    left_um = evaluate(trace.angle_deg, trace.deviation_um, 50.0, state="free").ront_um
    band = band_of(job)
    assert left_um > 20.0
    assert band.low_um <= left_um <= band.high_um < 1.2 * job.lobe_error_um_pp


def test_a_round_part_keeps_what_the_spindle_wanders() -> None:
    """A perfect tool on an axis that wanders by 1.2 um leaves 1.1 to 1.5 um."""
    band = band_of(short("steel-bar-65"))
    assert band.low_um < 1.1
    assert 1.5 < band.high_um < 2.5


def test_friction_is_that_of_the_describing_function_with_its_overtones() -> None:
    """8 x 5 N / pi on 1.755 um/N at 50 Hz, and a third and a fifth of it on 0.307 and 0.107 um/N."""
    job = short("lee-2001-experiment-1")
    band = band_of(job)
    assert band.friction_um == pytest.approx(8 * 5.0 / 3.14159 * (1.755 + 0.3071 / 3 + 0.1069 / 5), rel=1e-3)
    assert band.assumed_friction_n == 5.0
    assert band_of(job, Strategy.NONE).friction_um == pytest.approx(0.0, abs=1e-6)


def test_what_is_assumed_is_said_to_people_and_programs(console: Console, job_file: JobFile) -> None:
    words = ("preview", str(job_file(cut_length_mm="1.0")), "--strategy", "cam")
    band = console(*words, "--json").json["predicted"]["band"]
    said = {reason["code"]: reason for reason in band["because"]}
    shown = console(*words, "--lang", "ko").out
    assert f"{band['high_um']:.1f} um)" in shown
    for code, amount in (("band.friction.assumed", "5 N"), ("band.spindle", "2 um")):
        assert said[code]["text"].startswith("assumed: ")
        assert amount in said[code]["text"]
        (line,) = (line for line in shown.splitlines() if line.startswith("가정: ") and amount in line)
        assert line.endswith(f"{said[code]['um']:.2f}")
