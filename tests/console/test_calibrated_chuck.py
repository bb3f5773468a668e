"""Kept calibrations of a chuck: they give what a profile leaves open or assumes, and overrule nothing else."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.data.calibrated_chuck import CalibratedMachine, calibrated, calibrated_or_stated, warnings_of
from console.session.data.stop_records import record_path
from console.text.catalogue import load as catalogue
from console.tui.lines import plain
from console.tui.pages.setup_lines import finding_lines
from drivers.commissioning.fingerprint import ours, read_fingerprint
from drivers.commissioning.stop_record import stop_key
from drivers.cutting.planning import Strategy, first_spindle_counts, plan_cut
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.true_parameters import ideal
from profiles.calibration.deflection import bending_um, contact_um
from profiles.chucking.advice import clamping_advice
from profiles.findings import Severity
from profiles.job import Job
from profiles.least_squares import student
from profiles.machine import MachineProfile, real_machine_problems
from profiles.problem import ProfileError
from profiles.rules import check, lobe_as_found
from profiles.store import BUNDLED_MACHINES, load_job, load_machine
from tests.console.commands import Console

JOB = load_job("lee-2001-experiment-1").job
LOADED = load_machine("lee-2001-lathe")
LATHE = LOADED.machine
STATED = replace(LATHE, assumed=())
OPEN = replace(
    STATED,
    chuck=replace(
        LATHE.chuck,
        force_per_torque_n_per_n_m=None,
        force_sd_percent=None,
        jaw_stiffness_n_per_um=None,
        jaw_contact_exponent=None,
    ),
)
TORQUE = np.repeat([10.0, 20.0, 30.0, 40.0], 3)


@pytest.fixture
def data(data_folder: Path) -> Path:
    return data_folder / "trilobe"


def wrench(folder: Path, slope: float, offset_n: float, sd_n: float) -> str:
    force = offset_n + slope * TORQUE + np.random.default_rng(4).normal(0.0, sd_n, TORQUE.size)
    rows = [f"{t:g},{f:.3f}" for t, f in zip(TORQUE, force, strict=True)]
    path = folder / "wrench.csv"
    path.write_text("\n".join(["torque_n_m,force_n", *rows]))
    return str(path)


def jaws(folder: Path) -> str:
    """Three jaws of 60 N/um at 1000 N, alpha 0.4, length 30 mm, on a steel bar, with noise of 0.01 um."""
    rows, rng = (
        ["# youngs_modulus_gpa: 206", "chucking_force_n,load_n,angle_deg,diameter_mm,overhang_mm,deflection_um"],
        (np.random.default_rng(5)),
    )
    for total in (1500.0, 3000.0, 6000.0):
        for load in (150.0, 400.0):
            for angle in (0.0, 30.0, 60.0):
                for overhang in (40.0, 125.0):
                    k = 60.0 * (total / 3 / 1000.0) ** 0.4
                    um = contact_um(
                        k,
                        0.4,
                        30.0,
                        jaws=3,
                        force_per_jaw_n=total / 3,
                        load_n=load,
                        past_jaw_deg=angle,
                        overhang_mm=overhang,
                    ) + bending_um(load, overhang, 65.0, 206.0)
                    rows.append(f"{total},{load},{angle},65,{overhang},{float(um) + rng.normal(0.0, 0.01):.5f}")
    path = folder / "jaws.csv"
    path.write_text("\n".join(rows))
    return str(path)


def with_calibrations(machine: MachineProfile, data: Path) -> CalibratedMachine:
    return calibrated(replace(LOADED, machine=machine), data)


def warned(job: Job, machine: MachineProfile) -> set[str]:
    return {f.problem.key for f in lobe_as_found(job, machine) if f.severity is Severity.WARNING}


def test_what_a_profile_leaves_open_comes_from_the_newest_calibrations(
    console: Console, tmp_path: Path, data: Path
) -> None:
    assert with_calibrations(OPEN, data).machine == OPEN
    for words in ((wrench(tmp_path, 280.0, 0.0, 50.0),), (wrench(tmp_path, 300.0, 400.0, 60.0), "--affine")):
        said = console("calibrate", "chuck", *words, "--keep", "--json")
        assert said.code == 0
    assert set(said.json["found"]["profile"]) == {
        "force_per_torque_n_per_n_m",
        "force_offset_n",
        "force_sd_percent",
    }
    assert console("calibrate", "chuck", jaws(tmp_path), "--keep").code == 0
    found = with_calibrations(OPEN, data)
    chuck = found.machine.chuck
    assert chuck.force_per_torque_n_per_n_m == pytest.approx(300.0, rel=0.02)
    assert chuck.force_offset_n == pytest.approx(400.0, abs=120.0)
    # 60 N of 400 + 300 x 25 N.
    assert chuck.force_sd_percent == pytest.approx(100 * 60 / 7900, rel=0.5)
    assert chuck.jaw_stiffness_n_per_um == pytest.approx(60.0, rel=0.02)
    assert chuck.jaw_contact_exponent == pytest.approx(0.4, abs=0.02)
    assert found.sources["force_offset_n"] == found.sources["force_sd_percent"] == said.json["date"]
    assert found.sources["jaw_stiffness_n_per_um"] > said.json["date"]
    assert found.sources["jaw_length_mm"] == "", "that one is the profile's own"
    # The profile says 40 mm of jaws; the deflections say 30.
    assert [(p.code, p.key) for p in found.warnings] == [("calibration.differs", "chuck.jaw_length_mm")]
    torque = clamping_advice(JOB, found.machine).torque_n_m
    assert torque == pytest.approx((1314.0 - 400.0) / 300.0, rel=0.15)
    assert clamping_advice(JOB, OPEN).torque_n_m is None


def test_a_prediction_says_where_what_it_knows_of_the_chuck_is_from(console: Console, tmp_path: Path) -> None:
    text = (BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if "force_per_torque" not in line]
    machine = tmp_path / "open.toml"
    machine.write_text("\n".join(kept), encoding="utf-8")
    words = ("predict", JOB.name, "--machine", str(machine), "--json")
    assert console(*words).json["clamping"]["torque_n_m"] is None
    wrench_words = (wrench(tmp_path, 300.0, 0.0, 50.0), "--machine", str(machine), "--keep", "--json")
    date = console("calibrate", "chuck", *wrench_words).json["date"]
    said = console(*words).json
    assert said["clamping"]["torque_n_m"] == pytest.approx(1314 / 300, rel=0.02)
    assert said["sources"]["chuck.force_per_torque_n_per_n_m"] == date
    assert said["sources"]["chuck.jaw_length_mm"] == "profile"
    told = console(*words[:-1])
    assert f"from the calibration of {date}: chuck.force_per_torque_n_per_n_m" in told.out


@pytest.mark.parametrize(("slope", "told"), [(377.0, []), (300.0, ["calibration.differs"])])
def test_what_a_profile_says_it_says_and_a_contradiction_is_told(
    console: Console, tmp_path: Path, data: Path, slope: float, told: list[str]
) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, slope, 0.0, 50.0), "--keep").code == 0
    found = with_calibrations(STATED, data)
    assert found.machine == STATED
    assert found.used == {}
    assert set(found.sources.values()) == {""}
    assert [problem.code for problem in found.warnings] == told


def test_half_a_line_of_the_profile_is_not_completed(console: Console, tmp_path: Path, data: Path) -> None:
    """With a slope of its own the profile has no offset: that of another line would be of no line at all."""
    assert console("calibrate", "chuck", wrench(tmp_path, 300.0, 400.0, 60.0), "--affine", "--keep").code == 0
    only_slope: MachineProfile = replace(OPEN, chuck=replace(OPEN.chuck, force_per_torque_n_per_n_m=310.0))
    found = with_calibrations(only_slope, data)
    assert found.machine.chuck.force_offset_n is None
    assert found.machine.chuck.force_sd_percent is not None


def test_a_value_that_nobody_has_measured_gives_way_to_one_that_was(
    console: Console, tmp_path: Path, data: Path
) -> None:
    """The bundled lathe assumes 377 N/(N m) and 5 %; a line is one thing, and takes its offset along."""
    assert "chuck.force_per_torque_n_per_n_m" in LATHE.assumed
    told = console("calibrate", "chuck", wrench(tmp_path, 300.0, 400.0, 60.0), "--affine", "--keep", "--json")
    found = calibrated(LOADED, data)
    chuck, profile = found.machine.chuck, told.json["found"]["profile"]
    assert {key: getattr(chuck, key) for key in profile} == profile
    assert chuck.force_offset_n == pytest.approx(400.0, abs=120.0)
    measured = {f"chuck.{key}" for key in profile}
    assert set(LATHE.assumed) - set(found.machine.assumed) == measured & set(LATHE.assumed)
    assert found.used == dict.fromkeys(profile, told.json["date"])
    assert found.warnings == ()
    assert (found.path, found.sha256) == (LOADED.path, LOADED.sha256)
    # The slope as it is stated: then neither of the two is the calibration's, and it is told.
    half = replace(LATHE, assumed=tuple(name for name in LATHE.assumed if "torque" not in name))
    stays = with_calibrations(half, data)
    assert (stays.machine.chuck.force_per_torque_n_per_n_m, stays.machine.chuck.force_offset_n) == (377.0, None)
    assert [problem.code for problem in stays.warnings] == ["calibration.differs"]
    assert set(stays.used) == {"force_sd_percent"}


def test_without_calibrations_a_machine_is_what_its_file_says(data: Path) -> None:
    for name in ("lee-2001-lathe", "turbo-ethernet-lathe"):
        loaded = load_machine(name)
        found = calibrated(loaded, data)
        assert (found.machine, found.path, found.sha256) == (loaded.machine, loaded.path, loaded.sha256)
        assert (found.used, found.warnings) == ({}, ())


def test_what_is_proven_of_a_machine_does_not_look_at_its_calibrations(
    console: Console, tmp_path: Path, data: Path
) -> None:
    """Stop record, what is ours on the card, and why a response is another one's: as without."""
    for table in (wrench(tmp_path, 300.0, 0.0, 50.0), jaws(tmp_path)):
        assert console("calibrate", "chuck", table, "--keep").code == 0
    found = calibrated(LOADED, data)
    assert found.machine.chuck != LATHE.chuck
    own, other = (replace(machine, chuck=LATHE.chuck, assumed=()) for machine in (LATHE, found.machine))
    assert own == other, "nothing but the chuck and what is assumed of it"
    sim = SimulatedLathe(LATHE)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    before, after = (
        (
            stop_key(client, machine, client.dialect),
            ours(machine, client.dialect),
            read_fingerprint(client, machine, client.dialect).configuration,
            real_machine_problems(machine),
            record_path(data, machine),
            first_spindle_counts(JOB, machine, Strategy.PVT),
            plan_cut(JOB, machine, Strategy.PVT).text,
        )
        for machine in (LATHE, found.machine)
    )
    assert before == after
    assert ideal(LATHE) == ideal(found.machine)


@pytest.mark.parametrize("broken", ["not json", "without", "wild", "of another"])
def test_a_broken_calibration_is_refused_and_the_screen_opens_without(
    console: Console, tmp_path: Path, data: Path, broken: str
) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, 300.0, 0.0, 50.0), "--keep").code == 0
    (file,) = data.rglob("wrench-*.json")
    record = json.loads(file.read_text())
    match broken:
        case "without":
            del record["found"]["profile"]
        case "wild":
            record["found"]["profile"]["force_sd_percent"] = 400.0
        case "of another":
            record["subject"] = "another lathe"
    file.write_text("{" if broken == "not json" else json.dumps(record))
    code = "calibration.unusable" if broken == "wild" else "calibration.record"
    with pytest.raises(ProfileError, match=code):
        calibrated(LOADED, data)
    for words in (("predict", JOB.name), ("preview", JOB.name), ("run", JOB.name, "--sim"), ("program", JOB.name)):
        said = console(*words)
        assert (said.code, said.out) == (1, "")
        assert str(file) in said.err and "remove the file" in said.err
    opened = calibrated_or_stated(LOADED, data)
    assert opened.machine == LATHE
    assert [problem.code for problem in opened.warnings] == ["calibration.not_used", code]
    assert opened.warnings[1].where == str(file)
    told = plain(finding_lines(check(JOB, opened.machine), catalogue("en"), 60, 30, warnings_of(opened)))
    assert "remove the file" in " ".join(told.split())
    assert "NO chuck calibration is used" in " ".join(told.split())


def test_a_fit_that_contradicts_has_to_be_a_whole_one(console: Console, tmp_path: Path, data: Path) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 50.0), "--keep").code == 0
    (file,) = data.rglob("wrench-*.json")
    record = json.loads(file.read_text())
    del record["found"]["slope_n_per_n_m"]
    file.write_text(json.dumps(record))
    with pytest.raises(ProfileError, match=r"calibration\.record"):
        with_calibrations(STATED, data)


def test_a_scatter_that_no_profile_may_have_is_not_kept(console: Console, tmp_path: Path, data: Path) -> None:
    torque = np.repeat(np.linspace(10.0, 40.0, 4), 15)
    force = torque * 300.0 * np.where(np.arange(torque.size) % 2, 1.9, 0.1)
    path = tmp_path / "wild.csv"
    path.write_text(
        "\n".join(["torque_n_m,force_n", *(f"{t:g},{f:g}" for t, f in zip(torque, force, strict=True))])
    )
    said = console("calibrate", "chuck", str(path), "--keep")
    assert said.code == 1
    assert "chuck.force_sd_percent" in said.err
    assert list(data.rglob("wrench-*.json")) == []
    assert console("calibrate", "chuck", str(path)).code == 0


def test_a_slope_that_is_hardly_known_is_told(console: Console, tmp_path: Path) -> None:
    sure = console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 300.0))
    unsure = console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 3000.0))
    assert (sure.code, unsure.code) == (0, 0)
    assert "slope" not in sure.err
    assert "slope" in unsure.err and "<= 10 %" in unsure.err
    assert "force_sd_percent = " in sure.out


def test_a_lobe_is_kept_with_the_chuck_and_the_tool_that_it_was_found_with(
    console: Console, tmp_path: Path, data: Path
) -> None:
    angle = np.arange(360.0)
    rng = np.random.default_rng(1)
    deviation = 27.5 * np.cos(3 * np.radians(angle - 92.0)) + rng.normal(0.0, 0.3, 360)
    rows = [f"{a:g},{d:.4f}" for a, d in zip(angle, deviation, strict=True)]
    head = ("# state: free", "# direction: spindle", "# start_mark: spindle index", "angle_deg,deviation_um")
    path = tmp_path / "trace.csv"
    path.write_text("\n".join([*head, *rows]))
    assert console("calibrate", "lobe", str(path), "--job", JOB.name, "--keep").code == 0
    kept = load_job(f"{JOB.name}-2", data / "jobs").job
    assert (kept.lobe_chuck, kept.lobe_tool) == (LATHE.chuck.name, LATHE.tool.name)
    chuck, tool = replace(LATHE.chuck, name="collet"), replace(LATHE.tool, name="CCMT")
    other = replace(LATHE, chuck=chuck, tool=tool)
    judged = {name: warned(kept, machine) for name, machine in (("own", LATHE), ("other", other))}
    assert judged == {"own": set(), "other": {"chuck.name", "tool.name"}}


def test_a_calibration_of_another_chuck_is_not_used_and_that_is_told(
    console: Console, tmp_path: Path, data: Path
) -> None:
    """The newest of the chuck that is on counts; where there is none, what is known of another one is not it."""
    for slope in (300.0, 280.0):
        assert console("calibrate", "chuck", wrench(tmp_path, slope, 0.0, 50.0), "--keep").code == 0
    older, newer = sorted(data.rglob("wrench-*.json"))
    record = json.loads(newer.read_text())
    assert record["chuck"] == LATHE.chuck.name
    newer.write_text(json.dumps({**record, "chuck": "collet"}))
    found = calibrated(LOADED, data)
    assert found.machine.chuck.force_per_torque_n_per_n_m == pytest.approx(300.0, rel=0.02)
    assert found.warnings == ()
    older.unlink()
    other = calibrated(LOADED, data)
    assert other.machine == LATHE and other.used == {}
    (told,) = other.warnings
    assert (told.code, told.value, told.limit) == ("calibration.other_chuck", '"collet"', f'"{LATHE.chuck.name}"')
    assert "NOT used" in catalogue("en").problem(told) and "collet" in catalogue("ko").problem(told)
    no_name = {key: value for key, value in record.items() if key != "chuck"}
    newer.write_text(json.dumps(no_name))
    assert calibrated(LOADED, data).used, "kept before the name was: nobody says that it is of another"


@pytest.mark.parametrize(
    "change",
    [
        {"covariance": [1.0]},
        {"covariance": [-1.0, 0.0, 1.0]},
        {"sd_n": "much"},
        {"sd_n": "11.5"},
        {"sd_n": True},
    ],
)
def test_a_line_that_does_not_say_how_sure_it_is_is_none_of_ours(
    console: Console, tmp_path: Path, data: Path, change: dict[str, Any]
) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, 300.0, 0.0, 50.0), "--keep").code == 0
    (file,) = data.rglob("wrench-*.json")
    record = json.loads(file.read_text())
    file.write_text(json.dumps({**record, "found": {**record["found"], **change}}))
    with pytest.raises(ProfileError) as refused:
        calibrated(LOADED, data)
    assert [problem.code for problem in refused.value.problems] == ["calibration.record"]


def test_the_force_of_a_clamping_is_as_sure_as_the_fit_says(console: Console, tmp_path: Path, data: Path) -> None:
    """By the 95 % band of one clamping of `calibrate chuck`, at the middle torque, over Student's t.

    The band is the widest of the kinds of scatter that the table does not rule out, the advice of the likeliest.
    """
    table = wrench(tmp_path, 300.0, 400.0, 60.0)
    kept = console("calibrate", "chuck", table, "--affine", "--torque", "25", "--keep", "--json").json
    band = kept["asked"]["torque 25"]
    job = replace(JOB, chucking_force_n=band["value"])
    advice = clamping_advice(job, calibrated(LOADED, data).machine)
    sd_n = (band["high"] - band["value"]) / student(10)
    assert 0.9 * sd_n < advice.at_rest_sd_n <= sd_n * (1.0 + 1e-6)
    assert advice.at_rest_sd_n == pytest.approx(math.hypot(advice.scatter_sd_n, advice.line_sd_n))
    assert 0.0 < advice.line_sd_n < advice.scatter_sd_n
    assert clamping_advice(job, LATHE).line_sd_n == 0.0, "a line that is only stated"
