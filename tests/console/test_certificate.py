"""The first page of the report, which a quality engineer signs, and the names that a part has on it."""

from __future__ import annotations

import re
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.__main__ import main
from console.session.data.record_file import FILE_NAME
from console.session.data.records import add_to_run
from console.session.data.run_reader import story
from console.session.part_identity import IDENTIFIED, PartIdentity, identity_of, next_identity
from console.session.stages import Stage
from console.session.station.commands import Measure, Start
from console.text.catalogue import LANGUAGES, load
from profiles.metrology.cylindricity import CylinderResult, PartSection, evaluate_cylinder
from profiles.metrology.unrolled import unroll
from tests.console.floor import LOCAL_TIME, Floor, experiment_1, in_turn
from tests.console.reported_runs import JAW_1_DEG, job_named, lobed, recorded
from tests.console.test_report import PASSED_3, PRINTS, check, page_of, printed_pages, said, words
from tests.console.test_station import hold

NAMES: dict[str, Any] = {"part_name": "Ring", "drawing": "DR-100", "order": "45012", "batch": "B7"}
HEIGHTS_MM = (22.8, 24.4, 26.0, 27.6, 29.2)
GROWS_PER_MM = 0.02


def identified(folder: Path, parts: int = 1, stated: int = 1, serial: str = "S-099", **changes: Any) -> str:
    """A run of some products, with the names stated of one of them. Return its id."""
    made = {f"part {number}": lobed(1.0) for number in range(1, parts + 1)}
    run = recorded(folder, made, **changes)
    identity = PartIdentity(**NAMES, serial_number=serial, temperature_c=20.4)
    add_to_run(folder, run, IDENTIFIED, identity.event(stated))
    return run


def whole() -> CylinderResult:
    """A part that is less round from section to section."""
    return evaluate_cylinder(sections())


def sections() -> list[PartSection]:
    part = lobed(4.0)
    grown = {z: 1.0 + GROWS_PER_MM * (z - HEIGHTS_MM[0]) for z in HEIGHTS_MM}
    return [
        PartSection(z_mm=z, angle_deg=part.angle_deg, deviation_um=part.deviation_um * by)
        for z, by in grown.items()
    ]


@pytest.mark.parametrize(
    ("serial", "parts", "stated", "of_last", "of_next"),
    [
        ("S-099", 1, 1, "S-099", "S-100"),
        ("0007", 3, 1, "0009", "0010"),
        ("K9", 3, 3, "K9", "K10"),
        ("left-hand", 1, 1, "left-hand", ""),
        ("", 2, 1, "", ""),
    ],
)
def test_the_next_part_keeps_all_but_the_serial_number_which_counts_up(
    tmp_path: Path, serial: str, parts: int, stated: int, of_last: str, of_next: str
) -> None:
    run = identified(tmp_path, parts, stated, serial)
    last, following = identity_of(story(tmp_path, run)), next_identity(tmp_path, "ring", simulated=True)
    assert last is not None and last.serial_number == of_last
    assert following == PartIdentity(**NAMES, serial_number=of_next), "nobody has measured its temperature"


def test_only_a_part_that_was_cut_uses_its_number_and_only_its_own_job_goes_on(tmp_path: Path) -> None:
    identified(tmp_path)
    assert next_identity(tmp_path, "another", simulated=True) is None
    assert next_identity(tmp_path, "ring", simulated=False) is None
    run = recorded(tmp_path, {}, stage=Stage.AIR)
    add_to_run(tmp_path, run, IDENTIFIED, PartIdentity(serial_number="S-5").event())
    following = next_identity(tmp_path, "ring", simulated=True)
    assert following is not None and following.serial_number == "S-5"


def test_a_cut_that_is_held_and_finished_in_a_second_run_is_one_part(aligned: Floor) -> None:
    folder, job = aligned.context.records, experiment_1()
    identified(folder, serial="S-098", job=job)
    aligned.arm(job)
    aligned.when(lambda _: in_turn(aligned, 20.0), lambda: hold(aligned))
    assert not aligned.do(Start()).cut_done
    aligned.arm(job)
    assert aligned.do(Start()).cut_done
    aligned.do(Measure())
    with closing(sqlite3.connect(folder / FILE_NAME)) as database:
        numbers = "SELECT json_extract(data, '$.serial_number') FROM events WHERE kind = ? ORDER BY rowid"
        assert [number for (number,) in database.execute(numbers, (IDENTIFIED,))] == ["S-098", "S-099", "S-099"]
    following = next_identity(folder, job.name, simulated=True, clamped_at=LOCAL_TIME)
    assert following is not None and following.serial_number == "S-100", "the measured part is out of the chuck"


def test_what_the_command_is_told_is_on_the_certificate_and_in_the_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = identified(tmp_path, 2)
    output = tmp_path / "report.html"
    command = ("report", run, "--data", str(tmp_path), "--output", str(output), "--overwrite")
    assert main((*command, "--serial-number", "S-7", "--temperature-c", "19,9")) == 0
    shown = words(output.read_text(encoding="utf-8"))
    assert "drawing DR-100 order 45012 batch B7 serial number S-7" in shown and "19.9 °C" in shown
    before = output.read_bytes()
    assert main(command) == 0 and output.read_bytes() == before
    assert main((*command, "--temperature-c", "200")) == 1
    assert "--temperature-c = 200 is out of range; allowed >= -20, <= 80 °C" in capsys.readouterr().err
    assert main((*command, "--batch", "x" * 33)) == 1 and output.read_bytes() == before


def test_each_figure_has_its_tolerance_result_section_and_rule(tmp_path: Path) -> None:
    job = job_named(diameter_tolerance_um=4.0, cylindricity_tolerance_um=9.5)
    run = recorded(tmp_path, {"after": lobed(4.0)}, job=job, whole=whole())
    page = page_of(tmp_path, run)
    first = page.partition('id="asked"')[0]
    check(page, "en")
    shown = words(first + "</section></main></div></body></html>")
    worst_um = 8.0 * PASSED_3 * (1.0 + GROWS_PER_MM * (HEIGHTS_MM[-1] - HEIGHTS_MM[0]))
    # Lobes that share their angles lie between two cylinders as far apart as those of the worst section.
    row = "0.005 = 5 µm {um} µm U not stated 29.2 simple acceptance ✗ outside"
    assert row.format(um=f"{worst_um:.3f}") in shown
    assert f"0.0095 = 9.5 µm {worst_um:.3f} µm U not stated – simple acceptance ✓ within" in shown
    assert "51.8 ± 0.004 mm 51.8000 mm (+0.0 µm) U not stated" in shown
    for named in ("ISO 12181-1, -2", "ISO 12180-1", "ISO 16610-21", "5 sections, Z 22.8 to 29.2 mm", "2" * 64):
        assert named in shown


def test_the_plot_is_of_the_section_that_is_judged(tmp_path: Path) -> None:
    form = whole()
    event = {**form.event(), **unroll(sections(), form.filter_upr).event()}
    page = page_of(tmp_path, recorded(tmp_path, {"after": lobed(4.0)}, more=event))
    assert "The judged section at Z 29.2 mm" in words(page)
    drawn = page.partition("roundness-judged-title")[2].partition("</svg>")[0]
    corners = drawn.partition('stroke="#0b3d91"')[0].rpartition('d="M')[2].partition("Z")[0].split("L")
    points = np.array([[float(each) for each in corner.split()] for corner in corners]) - 170.0
    radius = np.hypot(*points.T)
    angle = np.degrees(np.arctan2(-points[radius.argmax(), 1], points[radius.argmax(), 0]))
    assert abs((angle - JAW_1_DEG + 60.0) % 120.0 - 60.0) < 1.0
    worst_um = 8.0 * PASSED_3 * (1.0 + GROWS_PER_MM * (HEIGHTS_MM[-1] - HEIGHTS_MM[0]))
    assert np.ptp(radius) == pytest.approx(27.0 * worst_um / 5.0, abs=0.1), "27 units a ring of 5 um"
    surface = page.partition("surface-title")[2].partition("</svg>")[0]
    cells = re.findall(r'<line x1="([\d.]+)" y1="([\d.]+)" x2="([\d.]+)"[^>]* stroke="rgb\((\d+),', surface)
    assert len({y for _, y, _, _ in cells}) == len(HEIGHTS_MM), "a row for each section"
    darkest = min(int(grey) for *_, grey in cells)
    places = [(float(x) + float(end)) / 2.0 - 52.0 for x, _, end, grey in cells if int(grey) == darkest]
    middle_deg = np.array(places) * 360.0 / 276.0
    assert (np.abs((middle_deg - JAW_1_DEG + 60.0) % 120.0 - 60.0) < 2.0).all()


@pytest.mark.system
@pytest.mark.long
@PRINTS
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_real_browser_prints_the_certificate_on_one_page(tmp_path: Path, language: str) -> None:
    """With everything that takes room: long names, three figures that fail, the tool's error, a gap."""
    name = "bearing-ring-outer-6205-thin-walled-left-hand-prototype-kim"
    job = job_named(
        name, diameter_tolerance_um=4.0, cylindricity_tolerance_um=5.0, material="EN AW-6061-T6, lot 44"
    )
    form = whole()
    surface = {**form.event(), **unroll(sections(), form.filter_upr).event()}
    of: dict[str, Any] = {"job": job, "more": surface, "end": said("tool_error"), "operator": None}
    run = recorded(tmp_path, {"after": lobed(4.0, 3.0)}, machine="m" * 40, **of)
    long = {key: f"{key} {'WORD-' * 8}"[:32] for key in (*NAMES, "serial_number")}
    add_to_run(tmp_path, run, IDENTIFIED, PartIdentity(**long, temperature_c=20.35).event())
    text = load(language)
    first, second, *_ = printed_pages(page_of(tmp_path, run, language), tmp_path)
    assert text("report.heading") in first and text("report.certificate.released_by") in first
    assert text("report.surface_scale", step="2").split()[0] in first.split()
    assert text("report.certificate.process") in second and text("report.certificate.process") not in first
    assert text("report.certificate.released_by") not in second
