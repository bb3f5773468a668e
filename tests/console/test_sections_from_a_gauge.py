"""A part in several sections, by files of a gauge elsewhere: which is judged, its form, and what is refused."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.session.data.history import last_results
from console.session.data.run_reader import runs, story
from console.session.learning.evaluated_part import EvaluatedPart, read_gauge_file
from profiles.arrays import Floats, floats
from profiles.job import Job
from profiles.store import load_job
from tests.console.commands import Console, JobFile
from tests.console.test_traces_from_a_gauge import Outside, outside

__all__ = ["outside"]

STATED = "# state: free\n# direction: ccw\n# start_mark: jaw 1\n"
JAWS, END = {"z_from": "jaw faces"}, {"z_from": "free end"}
TURN_DEG = np.arange(0.0, 360.0, 1.0)


@pytest.fixture
def job() -> Job:
    """A cut from Z 22 to 30 mm from the jaw faces."""
    return replace(load_job("lee-2001-experiment-1").job, overhang_mm=30.0, cut_length_mm=8.0)


def lobed_um(z_mm: float) -> Floats:
    """A lobe of 8 um p-p at Z 26, of 12 at 22 and of 4 at 30, on a cone of 0.5 um/mm."""
    return floats((4.0 - 0.5 * (z_mm - 26.0)) * np.cos(np.radians(3 * TURN_DEG)) + 0.5 * (z_mm - 26.0))


def table(path: Path, heights: dict[float, float], header: str = STATED) -> Path:
    """Write sections: the height in the file, and the Z where that is on the part."""
    rows = [
        f"{z:g};{a:g};{um:.5f}" for z, at in heights.items() for a, um in zip(TURN_DEG, lobed_um(at), strict=True)
    ]
    path.write_text(header + "Z [mm];Angle [deg];Deviation [um]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


FIVE = (22.5, 24.0, 26.5, 28.0, 29.5)
FROM_JAWS = {z: z for z in FIVE}


def read(path: Path, job: Job, answers: dict[str, str], *others: Path) -> EvaluatedPart:
    return read_gauge_file(path, job, answers, simulated=False, others=others)


@pytest.mark.parametrize(
    ("heights", "answers"),
    [
        (FROM_JAWS, JAWS),
        ({30.0 - z: z for z in FIVE}, END),
        ({z - 30.0: z for z in FIVE}, END),
    ],
)
def test_the_section_nearest_to_the_middle_is_judged_and_the_whole_has_its_form(
    heights: dict[float, float], answers: dict[str, str], tmp_path: Path, job: Job
) -> None:
    path = table(tmp_path / "part.csv", heights)
    asked = read(path, job, {})
    assert (asked.open, asked.ready) == (("z_from",), False)
    found = read(path, job, answers)
    assert found.ready and found.judged is not None and found.whole is not None
    assert found.section_z_mm == pytest.approx(26.5)
    assert found.judged.ront_um == pytest.approx(7.5, abs=0.02)
    assert [each.z_mm for each in found.sections] == pytest.approx(FIVE)
    event = found.whole.event()
    rows = event["sections"]
    assert isinstance(rows, list)
    assert [row["RONt_um"] for row in rows] == pytest.approx([11.5, 10.0, 7.5, 6.0, 4.5], abs=0.05)
    assert [row["mean_um"] for row in rows] == pytest.approx([-1.75, -1.0, 0.25, 1.0, 1.75], abs=0.001)
    assert (event["extraction"], event["filter_along_mm"]) == ("sections", None)
    # All are turned to the spindle alike, so that the form does not depend on where angle 0 is.
    crests = [each.trace.angle_deg[np.argmax(each.trace.deviation_um)] % 120.0 for each in found.sections]
    assert crests == pytest.approx([crests[0]] * 5)


@pytest.mark.parametrize(
    ("heights", "answers", "value"),
    [
        ({**FROM_JAWS, 31.0: 26.0}, JAWS, "31 mm"),
        ({z - 30.0: z for z in FIVE}, JAWS, "-7.5 mm"),
        (FROM_JAWS, END, "7.5 mm"),
        ({-1.0: 29.0, 1.0: 29.0, 2.0: 28.0}, END, "31 mm"),
    ],
)
def test_a_height_off_the_cut_is_refused_with_where_the_cut_is(
    heights: dict[float, float], answers: dict[str, str], value: str, tmp_path: Path, job: Job
) -> None:
    found = read(table(tmp_path / "part.csv", heights), job, answers)
    assert not found.ready
    assert [(each.code, each.value, each.limit) for each in found.problems] == [
        ("trace.off_cut", value, "22 … 30 mm")
    ]


def test_of_two_sections_one_is_judged_and_no_form_is_stated(tmp_path: Path, job: Job) -> None:
    found = read(table(tmp_path / "part.csv", {23.0: 23.0, 27.0: 27.0}), job, JAWS)
    assert (found.ready, found.section_z_mm, found.whole) == (True, 27.0, None)
    assert [(each.code, each.value) for each in found.warnings] == [("trace.few_sections", "2")]


def test_three_sections_next_to_each_other_say_nothing_about_the_length(tmp_path: Path, job: Job) -> None:
    found = read(table(tmp_path / "part.csv", {z: z for z in (25.0, 25.5, 26.0)}), job, JAWS)
    assert (found.ready, found.whole) == (True, None)
    assert [(each.code, each.value, each.limit) for each in found.warnings] == [
        ("trace.short_length", "1 mm", ">= 4 mm")
    ]


def test_what_is_wrong_with_another_section_is_said_with_its_height(tmp_path: Path, job: Job) -> None:
    path = table(tmp_path / "part.csv", FROM_JAWS)
    path.write_text(path.read_text(encoding="utf-8").replace("28;100;", "28;100;9"), encoding="utf-8")
    (warning,) = read(path, job, JAWS).warnings
    assert (warning.code, warning.where) == ("trace.spike", "Z 28 mm")


def test_a_helix_has_a_form_and_is_no_verdict_on_roundness(tmp_path: Path, job: Job) -> None:
    path, angle = tmp_path / "helix.csv", np.arange(0.0, 7200.0, 2.0)
    rows = [f"{22 + a / 900:.5f};{a:g};{2 * np.cos(np.radians(3 * a)):.4f}" for a in angle]
    path.write_text(STATED + "Z [mm];Angle [deg];Deviation [um]\n" + "\n".join(rows), encoding="utf-8")
    assert read(path, job, {}).open == ("z_from",)
    found = read(path, job, JAWS)
    assert found.whole is not None and found.whole.event()["extraction"] == "helix"
    assert found.whole.event()["CYLt_um"] == pytest.approx(4.0, abs=0.01)
    assert (found.ready, found.judged, [each.code for each in found.warnings]) == (True, None, ["trace.helix"])
    assert [each.code for each in read(path, replace(job, cut_length_mm=5.0), JAWS).problems] == ["trace.off_cut"]


@pytest.mark.parametrize(("lowest", "most"), [(20, False), (21, True)])
def test_scattered_points_are_as_many_in_each_third_of_the_length(
    tmp_path: Path, job: Job, lowest: int, most: bool
) -> None:
    """Seven points to each of three lobes, wherever the others are."""
    chance = np.random.default_rng(3)
    z_mm = np.concatenate([chance.uniform(22.0, 24.3, lowest), chance.uniform(24.4, 29.0, 80)])
    z_mm[:2] = 22.0, 22.001  # the thirds are those of the heights that were measured
    z_mm[-1] = 29.0
    angle = chance.uniform(0.0, 360.0, z_mm.size)
    rows = [f"{z:.4f};{a:.3f};{15 * np.sin(np.radians(3 * a)):.4f}" for a, z in zip(angle, z_mm, strict=True)]
    path = tmp_path / "points.csv"
    path.write_text(STATED + "Z [mm];Angle [deg];Deviation [um]\n" + "\n".join(rows), encoding="utf-8")
    found = read(path, job, JAWS)
    refused = [(each.code, each.value, each.limit) for each in found.problems]
    assert refused == ([] if most else [("trace.few_scattered", str(lowest), ">= 21")])


@pytest.mark.parametrize("lines", [6, 20, 21])
def test_a_bird_cage_that_may_miss_the_lobe_is_no_verdict(tmp_path: Path, job: Job, lines: int) -> None:
    """Six generatrices on the nodes of a lobe of 30 um p-p show a perfect cylinder."""
    angle = np.repeat(np.arange(lines) * 360.0 / lines, 40)
    z_mm = np.tile(np.linspace(22.0, 29.0, 40), lines)
    rows = [f"{z:.3f};{a:.3f};{15 * np.sin(np.radians(3 * a)):.4f}" for a, z in zip(angle, z_mm, strict=True)]
    path = tmp_path / "cage.csv"
    path.write_text(STATED + "Z [mm];Angle [deg];Deviation [um]\n" + "\n".join(rows), encoding="utf-8")
    found = read(path, job, JAWS)
    refused = [(each.code, each.value, each.limit) for each in found.problems]
    assert refused == ([] if lines >= 21 else [("trace.few_generatrices", str(lines), ">= 21")])
    assert found.ready is (lines >= 21)


def test_learning_takes_the_section_at_mid_cut_of_a_file_of_several(
    console: Console, job_file: JobFile, tmp_path: Path
) -> None:
    words = ("--strategy", "cam", "--stage", "full", "--compensation", "none")
    job = str(job_file(overhang_mm="30.0", cut_length_mm="8.0"))
    refused = console("learn", str(table(tmp_path / "a.csv", FROM_JAWS)), "--job", job, *words)
    assert refused.code == 1 and "# z_from: jaw faces | free end" in refused.err
    stated = table(tmp_path / "b.csv", FROM_JAWS, STATED + "# z_from: jaw faces\n")
    seen = console("learn", str(stated), "--job", job, *words, "--json").json
    assert seen["section_z_mm"] == 26.5
    assert seen["measured"]["RONt_um"] == pytest.approx(7.5, abs=0.05)
    rows = [(row["z_mm"], row["RONt_um"]) for row in seen["sections"]]
    worst_mm, worst_um = max(rows, key=lambda row: row[1])
    assert len(rows) == len(FROM_JAWS) and worst_um > 7.5
    said = console("learn", str(stated), "--job", job, *words).out
    assert "section at Z 26.50 mm" in said
    assert (
        f"worst at Z {worst_mm:.1f} mm: RONt {worst_um:.2f} um" in said
        and f"CYLt {seen['CYLt_um']:.2f} um" in said
    )
    stated.write_text(stated.read_text(encoding="utf-8").replace("28;100;", "28;100;9"), encoding="utf-8")
    assert "Z 28 mm: a single point stands apart" in console("learn", str(stated), "--job", job, *words).err


@pytest.mark.long
def test_the_record_of_a_part_has_its_sections_as_those_of_the_simulated_gauge(outside: Outside) -> None:
    outside.cut()
    job = outside.job.job
    past = job.overhang_mm - np.array([0.45, 0.25, 0.1])
    files = []
    for number, z in enumerate(past):
        points = "".join(f"{a:g},{um:.5f}\n" for a, um in zip(TURN_DEG, lobed_um(26.0 + number), strict=True))
        files.append(outside.data / f"{number}.csv")
        files[-1].write_text(f"{STATED}# z_mm: {z}\nangle_deg,deviation_um\n{points}", encoding="utf-8")
    path, *others = files
    found = read_gauge_file(path, job, JAWS, simulated=False, others=tuple(others))
    order = replace(outside.order(path, **JAWS), sha256=found.sha256, others=tuple(others))
    state = outside.floor.do(order)
    assert state.measured is not None, state.refusals
    assert state.measured.section_z_mm == pytest.approx(past[1])
    (run,) = runs(outside.data)
    (part,) = story(outside.data, run.run_id).parts
    assert part.trace_name == "0.csv + 2"
    assert [row["z_mm"] for row in part.data["sections"]] == pytest.approx(sorted(past))
    assert part.data["CYLt_um"] == pytest.approx(found.whole.event()["CYLt_um"] if found.whole else 0.0)
    trace = part.read_trace()
    assert trace is not None
    assert float(np.ptp(trace.deviation_um)) == pytest.approx(7.0, abs=0.01), "that of the middle of the three"


@pytest.mark.parametrize(("limit_um", "passed"), [(6.0, None), (3.0, False)])
def test_a_helix_judges_the_form_of_its_part_in_the_record_the_report_and_the_commands(
    outside: Outside, console: Console, tmp_path: Path, limit_um: float, passed: bool | None
) -> None:
    job = replace(outside.job.job, cylindricity_tolerance_um=limit_um)
    outside.job = replace(outside.job, job=job)
    outside.cut()
    with closing(sqlite3.connect(outside.data / "records.sqlite3")) as earlier:  # its schema demanded a RONt
        earlier.execute("PRAGMA writable_schema = ON")
        earlier.execute("UPDATE sqlite_schema SET sql = replace(sql, 'ront_um REAL,', 'ront_um REAL NOT NULL,')")
        earlier.commit()
    path, angle = tmp_path / "a helix.csv", np.arange(0.0, 7200.0, 2.0)
    rows = [f"{job.overhang_mm - 0.45 * a / 7200:.6f};{a:g};{2 * np.cos(np.radians(3 * a)):.4f}" for a in angle]
    path.write_text("# state: free\nZ [mm];Angle [deg];Deviation [um]\n" + "\n".join(rows), encoding="utf-8")
    state = outside.take(path, **JAWS)
    assert (state.measured, state.cut_done) == (None, False)
    assert state.form is not None and state.form.whole.cylt_um == pytest.approx(4.0, abs=0.01)
    assert [(each.kind, each.passes) for each in state.form.judged][:2] == [
        ("roundness", None),
        ("cylindricity", passed is None),
    ]
    assert replace(state.form, proven=True).passes is passed
    (run,) = runs(outside.data)
    (part,) = story(outside.data, run.run_id).parts
    assert (run.passed, run.ront_um, part.trace, part.trace_name) == (
        state.form.passes,
        None,
        path.read_bytes(),
        path.name,
    )
    last = last_results(outside.data, simulated=False)[job.name]
    assert last.ront_um is None and last.cylt_um == pytest.approx(4.0, abs=0.01)
    data = ("--data", str(outside.data))
    shown = console("records", "show", run.run_id, *data).out
    assert "CYLt 4.00 um" in shown and "RONt not" in shown and "helix, 3600 points" in shown
    for words in (("records", "list"), ("records", "debrief", run.run_id)):
        assert console(*words, *data).code == 0
    report = tmp_path / "report.html"
    assert console("report", run.run_id, "--output", str(report), *data).code == 0
    html = report.read_text(encoding="utf-8")
    assert "helix, 3600 points" in html and ("not known" in html or "not judged" in html)
    again = outside.take(path, **JAWS)
    assert again.refusals == () and again.form is not None, "the same part may be measured again"
