"""A calibration scaled by a unit mistake, or of a wrong clock, is not used in silence.

The factors are those of the units (NIST SP 811), the limits those of the profile alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pytest import MonkeyPatch

from console.session.cut.alignment import Alignment, MountedEquipment, TouchOff
from console.session.data.calibrated_chuck import apply_calibrations
from console.session.data.calibrations import FOLDER
from console.session.data.history import last_results
from console.session.data.kept_files import is_ahead
from console.session.data.learned_store import asked_for
from console.session.data.measured_part import cuts_of, date_problems, parts_made
from console.session.data.records import RunRecord
from console.session.errors import SessionError
from console.session.learning.calibrating import lobe_step
from console.session.station.commands import CorrectTouchOff
from console.session.station.measuring import correct_touch_off
from console.text.catalogue import load
from profiles.calibration.deflection import bending_um, contact_um
from profiles.calibration.lobe import find_lobe
from profiles.calibration.plausible import MOST_STEP, QUANTITIES, step_of
from profiles.chucking.advice import force_span
from profiles.chucking.grip import needed_grip_n
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.rules import check
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.console.commands import Console, JobFile
from tests.record_clock import set_dates

LOADED = load_machine("lee-2001-lathe")
CHUCK = LOADED.machine.chuck
JOB = load_job("lee-2001-experiment-1").job
THIN = load_job("thin-ring-3-jaws").job
UNITS = (10.0, 100.0, 1000.0, 4.4482216, 9.80665, 25.4)
FACTORS = [way for factor in UNITS for way in (factor, 1.0 / factor)]
USABLE = [factor for factor in FACTORS if factor < 1000.0]  # beyond that it is none that a profile may have
TORQUE = np.repeat([1.0, 2.0, 3.0, 4.0, 5.0], 2)


@pytest.fixture
def data(data_folder: Path) -> Path:
    return data_folder / "trilobe"


def wrench(folder: Path, slope: float = 377.0, sd: float = 0.02, offset_n: float = 0.0) -> str:
    scatter = np.where(np.arange(TORQUE.size) % 2, 1.0 + sd, 1.0 - sd)
    rows = [f"{t:.17g};{f:.17g}" for t, f in zip(TORQUE, offset_n + slope * TORQUE * scatter, strict=True)]
    path = folder / "wrench.csv"
    path.write_text("\n".join(["torque_n_m;force_n", *rows]), encoding="utf-8")
    return str(path)


def jaws(
    folder: Path,
    *,
    length_mm: float = 40.0,
    modulus_gpa: float = 206.0,
    n_per_um: float = 50.0,
    alpha: float = 0.5,
    **scaled: float,
) -> str:
    """A table of three jaws as the profile has them, on a steel bar; columns `scaled` by their factor."""
    names = ("chucking_force_n", "load_n", "angle_deg", "diameter_mm", "overhang_mm", "deflection_um")
    rows, rng = [f"# youngs_modulus_gpa: {modulus_gpa:.17g}", ";".join(names)], np.random.default_rng(5)
    for total in (1500.0, 3000.0, 6000.0):
        for load_n in (150.0, 400.0):
            for angle in (0.0, 30.0, 60.0):
                for overhang in (40.0, 125.0):
                    loaded = {"load_n": load_n, "past_jaw_deg": angle, "overhang_mm": overhang}
                    k = n_per_um * (total / 3 / 1000.0) ** alpha
                    contact = contact_um(k, alpha, length_mm, jaws=3, force_per_jaw_n=total / 3, **loaded)
                    um = float(contact + bending_um(load_n, overhang, 65.0, 206.0)) + rng.normal(0.0, 0.01)
                    values = dict(zip(names, (total, load_n, angle, 65.0, overhang, um), strict=True))
                    rows.append(";".join(f"{value * scaled.get(key, 1.0):.17g}" for key, value in values.items()))
    path = folder / "jaws.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    return str(path)


def kept(data: Path) -> list[str]:
    return sorted(path.name for path in (data / FOLDER).rglob("*.json"))


def chuck_used(data: Path) -> tuple[float | None, ...]:
    chuck = apply_calibrations(LOADED, data).machine.chuck
    return (chuck.force_per_torque_n_per_n_m, chuck.jaw_stiffness_n_per_um, chuck.jaw_length_mm)


@pytest.mark.parametrize("factor", USABLE)
def test_a_wrench_in_another_unit_is_not_kept(console: Console, tmp_path: Path, data: Path, factor: float) -> None:
    table = wrench(tmp_path, 377.0 * factor)
    said = console("calibrate", "chuck", table, "--keep")
    assert (said.code, kept(data)) == (1, [])
    for word in (f"{377.0 * factor:.4g} N/(N m)", "377 N/(N m)", f"x {factor:.3g}", "--confirm"):
        assert word in said.err, word
    assert console("calibrate", "chuck", table, "--keep", "--confirm", "1.5").code == 1
    assert kept(data) == []
    assert console("calibrate", "chuck", table, "--keep", "--confirm", f"{factor:.3g}").code == 0
    assert chuck_used(data)[0] == pytest.approx(377.0 * factor, rel=1e-3), "whoever typed it out meant it"


def test_the_unit_mistake_is_named_and_one_beyond_every_profile_is_never_kept(
    console: Console, tmp_path: Path, data: Path
) -> None:
    mistakes = {0.001: "kN <> N", 1 / 9.80665: "kgf <> N", 1 / 4.4482216: "lbf <> N", 1 / 3: "F/3 <> F"}
    for factor, mistake in mistakes.items():
        assert mistake in console("calibrate", "chuck", wrench(tmp_path, 377.0 * factor), "--keep").err
    said = console("calibrate", "chuck", wrench(tmp_path, 150e3), "--keep", "--confirm", "150000")
    assert (said.code, kept(data)) == (1, []) and "100000 N/(N m)" in said.err


COLUMNS = ("chucking_force_n", "load_n", "deflection_um")


@pytest.mark.first(16)
@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("columns", [*((each,) for each in COLUMNS), ("chucking_force_n", "load_n")])
def test_deflections_in_another_unit_change_nothing_in_silence(
    console: Console, tmp_path: Path, data: Path, columns: tuple[str, ...], factor: float
) -> None:
    said = console("calibrate", "chuck", jaws(tmp_path, **dict.fromkeys(columns, factor)), "--keep")
    assert (said.code, kept(data)) == (1, []), said.err


def test_lengths_in_another_unit_and_a_modulus_of_no_metal_change_nothing(
    console: Console, tmp_path: Path, data: Path
) -> None:
    tables: list[dict[str, float]] = [{"modulus_gpa": gpa} for gpa in (20.6, 29.9, 700.0)]
    tables += [{"overhang_mm": by, "diameter_mm": by} for by in (25.4, 1 / 25.4, 10.0, 0.1)]
    for table in tables:
        said = console("calibrate", "chuck", jaws(tmp_path, **table), "--keep")
        assert (said.code, kept(data)) == (1, []), said.err


def test_what_agrees_is_kept_without_a_question(console: Console, tmp_path: Path, data: Path) -> None:
    for table in (wrench(tmp_path), wrench(tmp_path, 320.0), jaws(tmp_path)):
        assert console("calibrate", "chuck", table, "--keep").code == 0
    assert chuck_used(data) == pytest.approx((320.0, 50.0, 40.0), rel=0.02)


def test_small_steps_do_not_add_up_to_a_large_one(console: Console, tmp_path: Path, data: Path) -> None:
    slopes, codes = (377.0, 500.0, 700.0), []
    for slope in slopes:
        codes.append(console("calibrate", "chuck", wrench(tmp_path, slope), "--keep").code)
    assert codes == [0, 0, 1] and slopes[2] / slopes[1] < MOST_STEP < slopes[2] / slopes[0]
    # What was typed out is what the next ones are compared with, in place of the profile.
    for slope, words in ((700.0, ("--confirm", "700")), (720.0, ())):
        assert console("calibrate", "chuck", wrench(tmp_path, slope), "--keep", *words).code == 0
    assert chuck_used(data)[0] == pytest.approx(720.0, rel=1e-6)


def scaled_record(file: Path, factor: float) -> None:
    """What an older console has kept of a table in another unit."""
    record = json.loads(file.read_text())
    found = record["found"]
    for values in (found, found["profile"]):
        for key in (
            "slope_n_per_n_m",
            "force_per_torque_n_per_n_m",
            "stiffness_n_per_um",
            "jaw_stiffness_n_per_um",
        ):
            if key in values:
                values[key] *= factor
    file.write_text(json.dumps(record))


@pytest.mark.first(8)
@pytest.mark.parametrize("kind", ["wrench", "deflection"])
@pytest.mark.parametrize("factor", USABLE)
def test_an_older_record_is_not_used(
    console: Console, tmp_path: Path, data: Path, kind: str, factor: float
) -> None:
    table = wrench(tmp_path) if kind == "wrench" else jaws(tmp_path)
    assert console("calibrate", "chuck", table, "--keep").code == 0
    (first,) = (data / FOLDER).rglob("*.json")
    good, (source,) = (
        chuck_used(data),
        {each for each in apply_calibrations(LOADED, data).sources.values() if each},
    )
    second = first.with_name(first.name.replace("000001", "000002"))
    second.write_text(first.read_text())
    scaled_record(second, factor)
    found = apply_calibrations(LOADED, data)
    assert [each.code for each in found.warnings] == ["calibration.step_kept"]
    assert chuck_used(data) == good and {each for each in found.sources.values() if each} == {source}
    first.unlink()
    assert apply_calibrations(LOADED, data).machine == LOADED.machine, "without another one, the profile"
    said = console("predict", JOB.name)
    assert "NOT used" in said.out + said.err


def test_what_was_typed_out_holds_for_its_own_value(console: Console, tmp_path: Path, data: Path) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, 800.0), "--keep", "--confirm", "800").code == 0
    (file,) = (data / FOLDER).rglob("*.json")
    assert chuck_used(data)[0] == pytest.approx(800.0, rel=1e-3)
    for typed in (True, "800", 377.0, None):
        record = json.loads(file.read_text())
        file.write_text(json.dumps({**record, "found": {**record["found"], "typed": typed}}))
        assert chuck_used(data)[0] == 377.0, typed


def limits(job: Job, machine: MachineProfile) -> tuple[float, float, float]:
    span = force_span(job, machine)
    return -span.least_n, span.most_n, -needed_grip_n(job, machine)


@pytest.mark.first(6)
@pytest.mark.parametrize("job", [JOB, THIN], ids=lambda job: str(job.name))
@pytest.mark.parametrize("sd", [0.0005, 0.02, 0.08])
@pytest.mark.parametrize("length_mm", [28.0, 40.0, 58.0])
def test_no_calibration_widens_a_limit(
    console: Console, tmp_path: Path, data: Path, job: Job, sd: float, length_mm: float
) -> None:
    machine = replace(LOADED.machine, assumed=tuple(each for each in LOADED.machine.assumed if "chuck" in each))
    loaded = replace(LOADED, machine=machine)
    for table in (wrench(tmp_path, 420.0, sd), jaws(tmp_path, length_mm=length_mm)):
        assert console("calibrate", "chuck", table, "--keep").code == 0
    found = apply_calibrations(loaded, data).machine
    assert found.chuck.jaw_length_mm == pytest.approx(length_mm, rel=0.05)
    assert found.chuck.force_sd_percent != CHUCK.force_sd_percent
    for now, before in zip(limits(job, found), limits(job, machine), strict=True):
        assert now <= before * (1.0 + 1e-12) if before > 0 else now <= before
    refused = {each.problem.code for each in check(job, machine) if each.severity.rank}
    assert refused <= {each.problem.code for each in check(job, found) if each.severity.rank}
    if sd == 0.08:
        assert limits(JOB, found)[1] < limits(JOB, machine)[1], "a larger scatter narrows them"


def trace(error_um_pp: float) -> Trace:
    angle = np.arange(720.0) / 2.0
    noise = np.random.default_rng(1).normal(0.0, 0.002 * error_um_pp, angle.size)
    meta = {"state": "free", "direction": "spindle", "start_mark": "spindle index"}
    return Trace(
        angle_deg=angle, deviation_um=error_um_pp / 2 * np.cos(3 * np.radians(angle - 92.0)) + noise, meta=meta
    )


@pytest.mark.parametrize("factor", FACTORS)
def test_a_lobe_in_another_unit_is_a_large_step(factor: float) -> None:
    found = find_lobe(trace(55.0 * factor), JOB)
    step = lobe_step(JOB, found)
    assert step is not None and step.ratio == pytest.approx(factor, rel=0.02)
    assert lobe_step(JOB, find_lobe(trace(60.0), JOB)) is None


def test_a_lobe_is_compared_at_the_force_with_which_it_is_cut() -> None:
    double = replace(JOB, lobe_force_n=JOB.chucking_force_n, chucking_force_n=2 * JOB.chucking_force_n)
    assert lobe_step(double, find_lobe(trace(110.0), double)) is None


def test_a_lobe_that_is_a_large_step_is_kept_only_typed_out(console: Console, tmp_path: Path, data: Path) -> None:
    path, seen = tmp_path / "trace.csv", trace(110.0)
    head = [f"# {key}: {value}" for key, value in seen.meta.items()]
    rows = [f"{a:g},{d:.4f}" for a, d in zip(seen.angle_deg, seen.deviation_um, strict=True)]
    path.write_text("\n".join([*head, "angle_deg,deviation_um", *rows]), encoding="utf-8")
    words = ("calibrate", "lobe", str(path), "--job", JOB.name)
    assert "R <> D" in console(*words).err, "told before anybody keeps it"
    said = console(*words, "--keep")
    assert (said.code, kept(data), list(data.rglob("*.toml"))) == (1, [], [])
    assert console(*words, "--keep", "--confirm", "2").code == 0
    assert kept(data) == ["lobe-000001.json"]


@pytest.mark.parametrize("key", sorted(QUANTITIES))
@pytest.mark.parametrize("factor", FACTORS)
def test_every_quantity_sees_every_factor(key: str, factor: float) -> None:
    quantity = QUANTITIES[key]
    value = math.sqrt(quantity.least * quantity.most)
    step = step_of(key, value * factor, (value,))
    assert step is not None and step.is_typed(factor) and step.is_typed(value * factor) and not step.is_typed(1.0)
    assert step_of(key, value * 1.3, (value,)) is None and step_of(key, value, ()) is None
    assert f"x {factor:.3g}" in step.problem().limit


@dataclass(frozen=True)
class SizeOfPart:
    tool_offset_um: float = 150.0
    offset_taken: bool = False


def test_corrections_of_the_touch_off_do_not_add_up_to_one_that_is_refused() -> None:
    """Each is small; a touch-off 1.5 mm from the profile would be refused, and so is what they come to."""
    machine = LOADED.machine
    on = MountedEquipment(machine=machine.name, chuck=machine.chuck.name, tool=machine.tool.name)
    measured = SizeOfPart()
    for off_mm, refused in ((1.2, False), (1.4, True)):
        touched = TouchOff(zero_radius_mm=machine.tool.home_radius_mm + off_mm, diameter_mm=52.0, at="", on=on)
        aligned, told = replace(Alignment(), touch_off=touched), list[dict[str, Any]]()
        context: Any = SimpleNamespace(
            state=SimpleNamespace(measured=measured, alignment=aligned),
            started=SimpleNamespace(alignment=aligned),
            loaded_machine=LOADED,
            local_time=str,
            tell=lambda told=told, **changes: told.append(changes),
        )
        try:
            correct_touch_off(context, CorrectTouchOff())
        except SessionError as error:
            assert [each.code for each in error.problems] == ["alignment.touch_off_far"]
        assert bool(told) is not refused


NEXT_YEAR, LAST_YEAR, LATE, EARLY = "2099-11-22T10:00:00Z", "2001-11-22T10:00:00Z", "12:00", "10:00"
KEY = "chuck.force_per_torque_n_per_n_m"
SLOPES = {"soft": 300.0, "stiff": 377.0}


@pytest.fixture
def calibrate(console: Console, tmp_path: Path, monkeypatch: MonkeyPatch) -> Callable[[str, str], Any]:
    """Keep a calibration of the wrench on a day."""

    def keep(slope: str, date: str) -> Any:
        rows = [f"{t},{SLOPES[slope] * t + off:.1f}" for t in (10, 20, 30, 40) for off in (-20.0, 20.0)]
        path = tmp_path / f"{slope}.csv"
        path.write_text("\n".join(["torque_n_m,force_n", *rows]), encoding="utf-8")
        monkeypatch.setattr("console.session.learning.chuck_calibrating.utc_now", lambda: date)
        said = console("calibrate", "chuck", str(path), "--keep", "--json")
        assert said.code == 0, said.err
        return said

    return keep


def predicted(console: Console) -> Any:
    return console("predict", JOB.name, "--json")


def test_the_calibration_kept_last_counts_and_a_date_to_come_is_told(
    console: Console, calibrate: Callable[[str, str], Any]
) -> None:
    first = Path(calibrate("stiff", NEXT_YEAR).json["kept"])
    for command in ("predict", "preview", "program"):
        said = console(command, JOB.name, "--json")
        assert said.err.count(NEXT_YEAR) == 1 and "wrong" in said.err
        assert any(NEXT_YEAR in warning for warning in said.json["warnings"])
    first.rename(first.with_name("wrench-20991122T100000Z.json"))  # as it was named before it had a number
    assert predicted(console).json["sources"][KEY] == NEXT_YEAR
    said = calibrate("soft", LAST_YEAR)
    assert NEXT_YEAR in said.err and "wrong" in said.err
    found = predicted(console)
    assert found.json["clamping"]["torque_n_m"] == pytest.approx(JOB.chucking_force_n / 300.0, rel=0.02)
    assert found.json["sources"][KEY] == LAST_YEAR
    assert NEXT_YEAR not in found.err


def record_cut(data: Path, monkeypatch: MonkeyPatch, at: str, compensation: int | None) -> None:
    """Add a run of the job to the record, at that time of 30 November 2001."""
    set_dates(monkeypatch, lambda: f"2001-11-30T{at}:00.000+00:00")
    run = RunRecord(
        data,
        {
            "software": "x",
            "job": JOB.name,
            "job_sha256": load_job("lee-2001-experiment-1").sha256,
            "machine": LOADED.machine.name,
            "machine_sha256": LOADED.sha256,
            "simulated": 1,
            "strategy": "cam",
            "program": "",
        },
    )
    made = {"strategy": "cam", "stage": "full", "inverted": "model", "compensation": compensation}
    run.add("result", made)
    run.add("measured", {"job": JOB.name, "ront_um": 9.0 if compensation is None else 2.0})
    run.close()


def test_a_part_is_of_the_cut_that_was_recorded_last(data: Path, monkeypatch: MonkeyPatch) -> None:
    record_cut(data, monkeypatch, LATE, None)
    record_cut(data, monkeypatch, EARLY, 3)
    asked = asked_for(load_job("lee-2001-experiment-1"), LOADED, "", simulated=True)
    assert [made and made.compensation for made in parts_made(cuts_of(data, asked))] == ["3", "none"]
    assert last_results(data, simulated=True)[JOB.name].ront_um == 2.0
    assert date_problems(cuts_of(data, asked), asked.job) == ()


def test_a_cut_of_a_day_to_come_is_told(data: Path, monkeypatch: MonkeyPatch) -> None:
    record_cut(data, monkeypatch, EARLY, None)
    record_cut(data, monkeypatch, EARLY, 3)
    asked = asked_for(load_job("lee-2001-experiment-1"), LOADED, "", simulated=True)
    monkeypatch.setattr("console.session.data.kept_files.utc_now", lambda: "2001-11-29T10:00:00Z")
    (told,) = date_problems(cuts_of(data, asked), asked.job)
    assert (told.code, told.value) == ("record.date_ahead", "2001-11-30T10:00:00.000+00:00")
    assert "2001-11-30T10:00" in load("en").problem(told)


@pytest.mark.long
def test_a_version_of_a_day_to_come_is_told_when_it_is_learned_from_listed_and_cut_with(
    console: Console, data: Path, tmp_path: Path, close: tuple[str, str], job_file: JobFile
) -> None:
    job, part = str(job_file(cut_length_mm="1.5", feed_mm_per_rev="0.1")), str(tmp_path / "part.csv")
    plant = tmp_path / "larger-lobe.toml"
    plant.write_text('schema = 1\nsource = "a wrench that pulls harder"\n[chuck]\nlobe_factor = 1.2\n')
    run = ("run", job, "--sim", "--plant", str(plant), *close, "--strategy", "cam", "--json")
    learn = ("learn", "--job", job, *close, "--json")
    assert console(*run, "--part", part).code == 0
    kept = Path(console(*learn, part, "--gain", "0.5", "--keep").json["kept"])
    kept.write_text(json.dumps({**json.loads(kept.read_text()), "date": NEXT_YEAR}))
    said = console("learn", "--job", job, *close, "--list", "--sim")
    assert f"{NEXT_YEAR} (in the future)" in said.out
    again = str(tmp_path / "again.csv")
    cut = console(*run, "--compensation", "newest", "--part", again)
    assert cut.code == 0 and cut.err.count(NEXT_YEAR) == 1
    assert NEXT_YEAR in console(*learn, again).err


@pytest.mark.parametrize(
    ("date", "ahead"),
    [
        ("2001-11-30T10:11:00Z", True),
        ("2001-11-30T10:09:00Z", False),
        ("2001-11-30T12:09:00+02:00", False),
        ("2001-11-30T10:11:00", True),
        ("9999-12-31T23:59:59-23:59", True),
        ("tomorrow", False),
        ("", False),
    ],
)
def test_a_date_is_ahead_by_more_than_two_clocks_differ(date: str, ahead: bool) -> None:
    assert is_ahead(date, "2001-11-30T10:00:00Z") is ahead
