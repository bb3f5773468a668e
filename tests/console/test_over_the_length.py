"""A part that is round in its middle only fails, wherever it is judged, and it is said why."""

from __future__ import annotations

import csv
from dataclasses import replace
from datetime import UTC
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.cells import cell_len

from console.report.verdict import Judgement, judge_run
from console.session.data.run_reader import RunFilters, measured_parts, runs, story
from console.session.learning.opened_run import OpenedRun, open_for_report
from console.text.catalogue import load
from console.tui.lines import plain_text
from console.tui.records.list_lines import RunList, run_lines
from console.tui.records.reading import ListQuery, RunListing
from console.tui.records.run_lines import verdict_lines
from profiles.metrology.cylindricity import CylinderResult, PartSection, evaluate_cylinder
from profiles.store import load_job, save_job
from tests.console.commands import Console
from tests.console.reported_runs import job_named, lobed, recorded

HEIGHTS_MM = (22.0, 24.0, 26.0, 28.0, 30.0)
LANGUAGES = ("en", "ko")


def growing(at_the_jaws_um: float, cone_um: float = 0.0) -> CylinderResult:
    """A part whose lobe of 3/rev is 1 um p-p in its middle and so much more at its jaws, less at its free end."""
    angle = np.arange(0.0, 360.0)
    sections = []
    for z_mm in HEIGHTS_MM:
        along = (26.0 - z_mm) / 4.0
        lobe = 0.5 * (1.0 + at_the_jaws_um * along) * np.cos(3.0 * np.radians(angle - 90.0))
        sections.append(PartSection(z_mm=z_mm, angle_deg=angle, deviation_um=lobe - 0.5 * cone_um * (along - 0.1)))
    return evaluate_cylinder(sections, filter_upr=None)


def opened(folder: Path, run_id: str) -> OpenedRun:
    found = story(folder, run_id)
    points = measured_parts(folder, found.row.job, found.row.machine, found.row.simulated)
    return open_for_report(found, points, UTC)


@pytest.mark.parametrize(
    ("whole", "limits", "reason"),
    [
        (growing(12.0), {}, "RONt (LSC) 13.000 µm at Z 22.0 mm is outside its tolerance of 5.000 µm"),
        (growing(3.0), {"cylindricity_tolerance_um": 3.0}, "CYLt (MZCY) "),
        (
            growing(0.0, 12.0),
            {"diameter_tolerance_um": 10.0},
            "at Z 30.0 mm is off by 13.200 µm, outside ± 10.000 µm",
        ),
    ],
)
def test_a_record_and_its_report_fail_a_part_that_is_good_in_its_middle_only(
    tmp_path: Path, whole: CylinderResult, limits: dict[str, Any], reason: str
) -> None:
    run = opened(tmp_path, recorded(tmp_path, {"": lobed(0.5)}, job=replace(job_named(), **limits), whole=whole))
    assert run.product is not None and run.product.passed is False
    verdict = judge_run(run, load("en"))
    assert verdict.judgement is Judgement.BAD
    assert any(reason in each and "outside" in each for each in verdict.reasons), verdict.reasons
    assert "✗" in plain_text(verdict_lines(run, load("en"), 100))


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_tolerance_over_the_length_is_not_judged_by_one_section(tmp_path: Path, language: str) -> None:
    job, text = job_named(cylindricity_tolerance_um=8.0), load(language)
    run = opened(tmp_path, recorded(tmp_path, {"": lobed(0.5)}, job=job))
    assert run.product is not None and run.product.passed is None
    verdict = judge_run(run, text)
    assert (verdict.judgement, verdict.reasons) == (Judgement.OPEN, (text("report.why.no_length"),))
    assert text("inspect_page.cylindricity_open") in plain_text(verdict_lines(run, text, 100))
    whole = opened(tmp_path, recorded(tmp_path, {"": lobed(0.5)}, job=job, whole=growing(1.0)))
    assert whole.product is not None and whole.product.passed is True


def test_records_say_what_a_part_fails_by_and_why(console: Console, tmp_path: Path) -> None:
    run = recorded(tmp_path, {"": lobed(0.5)}, whole=growing(12.0))
    data = ("--data", str(tmp_path))
    shown = console("records", "show", run[:8], *data).out
    assert "RONt 13.00 um at Z 22.0 mm, NOT within 5" in " ".join(shown.split())
    assert "RONt 13.00 um at Z 22.0 mm: outside its tolerance of 5 um" in shown
    told = " ".join(console("records", "debrief", run[:8], *data).out.split())
    assert "RONt 13.00 um at Z 22.0 mm, allowed 5: 8.00 um too much." in told
    assert "3/rev changes along Z: +12.0 um p-p at Z 22.0, -12.0 um p-p at Z 30.0 mm" in told


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_lists_and_the_table_of_runs_have_the_form_and_the_worst_section(
    console: Console, tmp_path: Path, language: str
) -> None:
    recorded(tmp_path, {"": lobed(0.5)}, whole=growing(12.0))
    data, text = ("--data", str(tmp_path)), load(language)
    listed = " ".join(console("--lang", language, "records", "list", *data).out.split())
    assert "CYLt 13.00 um" in listed and "RONt 13.00 um" in listed and "Z 22.0" in listed
    assert console("records", "export", str(tmp_path / "out"), *data).code == 0
    with open(tmp_path / "out" / "runs.csv", encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    figures = [float(row[name]) for name in ("CYLt_um", "worst_RONt_um", "worst_z_mm")]
    assert figures == pytest.approx([13.0, 13.0, 22.0], abs=0.01)
    shown = RunList(
        listing=RunListing(wanted=ListQuery(filters=RunFilters()), rows=runs(tmp_path), more=False), selected=-1
    )
    rows = plain_text(run_lines(shown, text, 78, 5, everywhere=False)).splitlines()
    assert rows[1].count("13.00") == 2 and "CYLt" in rows[0]
    assert all(cell_len(each) <= 78 and "…" not in each for each in rows)


def sections_file(folder: Path, whole_um: float, heights: tuple[float, ...] = HEIGHTS_MM) -> str:
    """Sections of experiment 1 after its cut, 51.8 mm, with a lobe that grows by so much towards the jaws."""
    lines = ["# radius_mm: 25.9", "z_mm,angle_deg,deviation_um"]
    for z_mm in heights:
        for angle in range(0, 360, 2):
            um = 0.5 * (1.0 + whole_um * (26.0 - z_mm) / 4.0) * np.cos(3.0 * np.radians(angle))
            lines.append(f"{z_mm},{angle},{um:.6f}")
    path = folder / "sections.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    return str(path)


def job_with(folder: Path, cylindricity_um: float) -> str:
    path = folder / "ring.toml"
    save_job(replace(load_job("lee-2001-experiment-1").job, cylindricity_tolerance_um=cylindricity_um), path)
    return str(path)


@pytest.mark.parametrize(("grows_um", "limit_um", "code"), [(12.0, 50.0, 3), (2.0, 8.0, 0), (3.0, 2.0, 3)])
def test_sections_of_a_file_are_judged_by_exit_code_and_in_words(
    console: Console, tmp_path: Path, grows_um: float, limit_um: float, code: int
) -> None:
    measured = ("roundness", sections_file(tmp_path, grows_um), "--job", job_with(tmp_path, limit_um))
    assert console(*measured, "--fail-out-of-tolerance").code == code
    found = console(*measured, "--json").json
    assert found["within_tolerance"] is (code == 0)
    judged = {each["kind"]: each for each in found["judged"]}
    assert judged["roundness"]["value_um"] == pytest.approx(1.0 + grows_um, rel=0.01)
    assert judged["roundness"]["z_mm"] == 22.0
    assert judged["cylindricity"]["value_um"] == found["CYLt_um"]
    assert judged["diameter"]["value_um"] == pytest.approx(0.0, abs=0.01)
    said = console(*measured).out
    assert f"CYLt {found['CYLt_um']:.2f} um: {'within' if judged['cylindricity']['passes'] else 'outside'}" in said
    assert ("3/rev changes along Z" in said) == bool(found["length_causes"]) is True


@pytest.mark.parametrize("heights", [(60.0, 65.0, 70.0), (-29.0, -26.0, -23.0)])
def test_sections_off_the_cut_are_not_judged_by_the_limits_of_its_job(
    console: Console, tmp_path: Path, heights: tuple[float, ...]
) -> None:
    path = sections_file(tmp_path, 0.0, heights)
    assert console("roundness", path).code == 0
    found = console("roundness", path, "--job", job_with(tmp_path, 8.0), "--fail-out-of-tolerance")
    assert (found.code, "is off the cut" in found.err) == (1, True)


def test_a_sliver_of_the_length_does_not_pass_for_all_of_it(console: Console, tmp_path: Path) -> None:
    path = sections_file(tmp_path, 0.0, (24.0, 24.5, 25.0))
    found = console("roundness", path, "--job", job_with(tmp_path, 8.0), "--json").json
    assert found["within_tolerance"] is None
    assert next(each for each in found["judged"] if each["kind"] == "cylindricity")["value_um"] is None


def test_one_section_says_where_it_is_and_that_the_length_was_not_measured(
    console: Console, tmp_path: Path
) -> None:
    measured = ("roundness", sections_file(tmp_path, 1.0, (26.0,)), "--job", job_with(tmp_path, 8.0))
    said = console(*measured).out
    assert "section at Z 26.0 mm; length not measured" in said
    assert "CYLt not judged against 8 um" in said
    found = console(*measured, "--json").json
    assert found["within_tolerance"] is None
    assert [each["passes"] for each in found["judged"]] == [True, None, True]


def test_two_sections_have_their_roundness_and_say_why_there_is_no_cylindricity(
    console: Console, tmp_path: Path
) -> None:
    measured = ("roundness", sections_file(tmp_path, 12.0, (24.0, 28.0)))
    found = console(*measured, "--json").json
    assert found["CYLt_um"] is None
    rows = [(each["z_mm"], each["RONt_um"]) for each in found["sections"]]
    assert rows == [(24.0, pytest.approx(7.0, rel=0.01)), (28.0, pytest.approx(5.0, rel=0.01))]
    told = console(*measured)
    assert told.code == 0 and "needs >= 3" in told.err and "24.000 mm" in told.out
    judged = (*measured, "--job", job_with(tmp_path, 8.0), "--fail-out-of-tolerance")
    assert console(*judged).code == 3 and "at Z 24.0 mm: outside" in console(*judged).out
    one = console("roundness", sections_file(tmp_path, 12.0, (26.0,)))
    assert one.code == 0 and "needs >= 3" in one.out


def test_a_run_whose_part_is_good_in_its_middle_only_is_told_by_the_exit_code(
    console: Console, close: tuple[str, str], tmp_path: Path
) -> None:
    """A plain cut: the lobe of the job, 33 um p-p, in its middle, and more at the jaws (a shell)."""
    plant, job = tmp_path / "shell.toml", tmp_path / "ring.toml"
    plant.write_text("[chuck]\njaw_stiffness = 300.0\n", encoding="utf-8")
    ring = replace(load_job("lee-2001-experiment-2").job, cut_length_mm=4.0, feed_mm_per_rev=0.2)
    save_job(replace(ring, roundness_tolerance_um=36.0, cylindricity_tolerance_um=100.0), job)
    words = ("run", str(job), *close, "--sim", "--plant", str(plant), "--strategy", "none")
    ran = console(*words, "--json", "--fail-out-of-tolerance")
    found = ran.json
    assert found["after"]["RONt_um"] < 36.0
    assert (ran.code, found["within_tolerance"]) == (3, False)
    judged = {each["kind"]: each for each in found["judged"]}
    worst = max(found["sections"], key=lambda each: each["RONt_um"])
    assert (judged["roundness"]["value_um"], judged["roundness"]["z_mm"]) == (worst["RONt_um"], worst["z_mm"])
    assert judged["cylindricity"] == {
        "kind": "cylindricity",
        "value_um": found["CYLt_um"],
        "limit_um": 100.0,
        "z_mm": None,
        "passes": True,
        "guard_um": None,
        "U_um": None,
        "decision_rule": None,
    }
    assert [each["order"] for each in found["length_causes"] if each["kind"] == "lobe"][:1] == [3]
