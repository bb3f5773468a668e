"""`console roundness`: every problem and warning names its file, and warnings stay off the result."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from profiles.store import load_job
from tests.console.commands import Console, JobFile


def trace(tmp_path: Path, angles_deg: Any, *head: str, eccentric_um: float = 0.0) -> Path:
    tmp_path.mkdir(exist_ok=True)
    path = tmp_path / "part.csv"
    rows = [f"{a},{eccentric_um * np.cos(np.radians(a))}" for a in angles_deg]
    path.write_text("\n".join([*head, "angle_deg,deviation_um", *rows]))
    return path


def test_a_warning_goes_to_stderr_with_its_file(console: Console, tmp_path: Path) -> None:
    path = trace(tmp_path, range(360), "# direction: left")
    said = console("roundness", str(path), "--filter", "15")
    assert said.code == 0
    assert said.err == f"console: warning: {path}: " + said.err.split(": ", 3)[3]
    assert "direction" in said.err and "spindle, cw, ccw" in said.err
    listed = console("roundness", str(path), "--filter", "15", "--json")
    assert said.err == f"console: warning: {listed.json['warnings'][0]}\n"


def test_a_part_far_off_centre_is_told_to_be_taken_about_its_own(console: Console, tmp_path: Path) -> None:
    path = trace(tmp_path, range(360), "# radius_mm: 26", eccentric_um=500.0)
    assert "own centre" in console("roundness", str(path)).out
    assert console("roundness", str(path), "--json").json["recentred"] is True
    refused = console("roundness", str(trace(tmp_path, range(360), "# radius_mm: 26", eccentric_um=3000.0)))
    assert refused.code == 1
    for word in ("part.csv", "3000 um", "2600 um", "centre"):
        assert word in refused.err


def test_a_circle_off_the_axis_says_that_its_radius_is_missing(console: Console, tmp_path: Path) -> None:
    """500 um off a part of 26 mm is 4.8 um of oval; with the radius, or a job that has it, it is round."""
    angle = np.radians(np.arange(360.0))
    seen = 500.0 * np.cos(angle) + np.sqrt(26_000.0**2 - (500.0 * np.sin(angle)) ** 2) - 26_000.0
    path = tmp_path / "part.csv"
    rows = "\n".join(f"{a},{r}" for a, r in enumerate(seen))
    path.write_text(f"# units_checked: yes\nangle_deg,deviation_um\n{rows}")
    said = console("roundness", str(path), "--filter", "15")
    assert said.code == 0 and said.err.count("\n") == 1
    for word in ("warning", "part.csv", "500 um", "0.05 um", "radius_mm"):
        assert word in said.err
    held = console("roundness", str(path), "--filter", "15", "--job", "lee-2001-experiment-1", "--json").json
    assert not any("radius is" in each or "0.05 um" in each for each in held["warnings"])
    assert held["RONt_um"] == pytest.approx(0.0, abs=0.1)


def test_a_radius_that_is_none_is_a_warning_and_half_a_part_is_refused(console: Console, tmp_path: Path) -> None:
    for stated in ("0,026", "inf", "nan", "-26", "26 mm", "0", "26"):
        said = console("roundness", str(trace(tmp_path, range(360), f"# radius_mm: {stated}")), "--filter", "15")
        assert (said.code, said.err.count("\n")) == (0, int(stated != "26"))
        assert stated == "26" or all(w in said.err for w in ("warning", "part.csv", "radius_mm", stated, "> 0 mm"))
    said = console("roundness", str(trace(tmp_path, range(180))))
    assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
    assert all(word in said.err for word in ("part.csv", "181 deg", "60 deg", "all round"))


@pytest.mark.parametrize("language", ["en", "ko"])
def test_no_sentence_has_a_hole(console: Console, tmp_path: Path, language: str) -> None:
    path = tmp_path / "part.csv"
    head = b"angle_deg,deviation_um\n"
    for content in (b"", head + b"1,\xb5\n", b"# : 1\n", b"# a: 1\n# a: 2\n" + head):
        path.write_bytes(content)
        said = console("roundness", str(path), "--lang", language)
        assert said.code == 1
        assert not any(hole in said.err for hole in ("()", "( )", " )", "allowed \n", "허용 \n", "  "))


def test_a_perfect_part_has_no_negative_zero(console: Console, tmp_path: Path) -> None:
    path = trace(tmp_path, range(360))
    assert "-0.0" not in console("roundness", str(path), "--filter", "none").out
    assert "-0.0" not in json.dumps(console("roundness", str(path), "--filter", "none", "--json").json["RONv_um"])


def lobed(tmp_path: Path, *head: str, direction: int = 1, turns: int = 1) -> Path:
    """Three lobes of 55 um with a crest 8 deg past jaw 1, which is at 12 deg; 12 um off centre, 3 um too large."""
    path = tmp_path / "lobed.csv"
    angle = np.arange(360 * turns)
    past = np.radians(direction * (angle - 12) - 8)
    deviation = 3 + 27.5 * np.cos(3 * past) + 12 * np.cos(np.radians(angle)) + 0.5 * (angle // 360)
    rows = [f"{a},{d!r}" for a, d in zip(angle.tolist(), deviation.tolist(), strict=True)]
    path.write_text("\n".join([*head, "angle_deg,deviation_um", *rows]))
    return path


def test_all_four_circles_are_listed_unrounded(console: Console, tmp_path: Path) -> None:
    path = lobed(tmp_path)
    listed = console("roundness", str(path), "--filter", "none", "--json").json
    assert [circle["circle"] for circle in listed["circles"]] == ["LSC", "MZC", "MCC", "MIC"]
    for circle in listed["circles"]:
        assert circle["RONt_um"] == pytest.approx(listed["RONt_um"], abs=0.05)
        assert (circle["centre_x_um"], circle["centre_y_um"]) == pytest.approx((12, 0), abs=0.05)
        assert {"RONp_um", "RONv_um", "RONq_um", "deviation_um"} <= circle.keys()
    sides = [contact["outer"] for contact in listed["circles"][1]["contacts"]]
    assert sides in ([True, False] * 2, [False, True] * 2)
    smallest = console("roundness", str(path), "--filter", "none", "--circle", "MZC", "--json").json
    assert smallest["reference_circle"] == "MZC"
    assert smallest["RONt_um"] == listed["circles"][1]["RONt_um"]
    assert "MZC, filter none" in console("roundness", str(path), "--filter", "none", "--circle", "MZC").out


def test_the_crest_is_told_against_jaw_1_where_mark_and_direction_are_known(
    console: Console, tmp_path: Path
) -> None:
    for direction, word in ((1, "cw"), (-1, "ccw")):
        path = lobed(tmp_path, f"# direction: {word}", "# jaw_1_deg: 12", direction=direction)
        listed = console("roundness", str(path), "--json").json
        assert listed["phase_known"] is True
        assert listed["harmonics"][1]["past_jaw_1_deg"] == pytest.approx(8)
        assert "past jaw 1" in console("roundness", str(path)).out
    for line, missing in (("# direction: cw", "jaw_1_deg"), ("# start_mark: jaw 1", "direction")):
        path = lobed(tmp_path, line)
        said = console("roundness", str(path))
        assert said.code == 0 and f"not state {missing}" in said.out
        listed = console("roundness", str(path), "--json").json
        assert (listed["phase_known"], listed["harmonics"][1]["past_jaw_1_deg"]) == (False, None)
        assert listed["RONt_um"] == pytest.approx(55, abs=0.2)
    path = lobed(tmp_path, "# direction: spindle", "# start_mark: spindle index")
    assert "--job" in console("roundness", str(path)).out
    listed = console("roundness", str(path), "--job", "lee-2001-experiment-1", "--json").json
    assert listed["jaw_1_deg"] == 90
    assert listed["harmonics"][1]["past_jaw_1_deg"] == pytest.approx((20 - 90) % 120)


def test_the_size_says_how_far_the_tool_has_to_go_on(console: Console, tmp_path: Path) -> None:
    """The part is 6 um larger in diameter than twice its radius_mm; the job says what it should be."""
    path = lobed(tmp_path, "# radius_mm: 25.7")
    words = ("roundness", str(path), "--job", "lee-2001-experiment-1")
    job = load_job("lee-2001-experiment-1").job
    listed = console(*words, "--json").json
    assert listed["mean_diameter_mm"] == pytest.approx(51.406)
    too_large_um = 1000 * (51.406 - (job.diameter_mm - 2 * job.depth_of_cut_mm))
    assert listed["tool_offset_um"] == pytest.approx(too_large_um / 2)
    assert "into the part" in console(*words).out
    relative = console(
        "roundness", str(lobed(tmp_path, "# radius_mm: 25.7", "# size: relative")), *words[2:], "--json"
    )
    assert (relative.json["mean_diameter_mm"], relative.json["tool_offset_um"]) == (None, None)
    assert "radius_mm" in relative.err


def test_several_turns_tell_what_repeats(console: Console, tmp_path: Path) -> None:
    path = lobed(tmp_path, "# turns: 3", turns=3)
    listed = console("roundness", str(path), "--json").json
    assert (listed["points"], listed["turns"]["count"]) == (360, 3)
    assert listed["turns"]["random_um"] == pytest.approx(0.5)
    assert "mean of 3 turns" in console("roundness", str(path)).out


def test_readings_over_a_v_block(console: Console, tmp_path: Path) -> None:
    path = lobed(tmp_path, "# method: v_block")
    words = ("roundness", str(path), "--filter", "none")
    listed = console(*words, "--vblock", "60", "--lobes", "3", "--json").json
    assert (listed["factor"], listed["lobe_pp_um"]) == (pytest.approx(3), pytest.approx(55 / 3))
    assert listed["phase_deg"] == pytest.approx(20)
    said = console(*words, "--vblock", "60", "--lobes", "3")
    assert "V-block of 60 deg" in said.out and "18.333" in said.out
    # The default filter takes a quarter per cent of three lobes from the readings, and none from the part.
    filtered = console("roundness", str(path), "--vblock", "60", "--lobes", "3", "--json").json
    assert filtered["reading_pp_um"] == pytest.approx(55 * 2 ** -((3 / 50) ** 2))
    assert filtered["lobe_pp_um"] == pytest.approx(55 / 3)
    banded = console("roundness", str(path), "--vblock", "60", "--lobes", "3", "--band", "2:15", "--json").json
    assert banded["lobe_pp_um"] == pytest.approx(55 / 3)
    for more, told in (
        ((), "--vblock DEG --lobes N"),
        (("--vblock", "90"), "--vblock DEG --lobes N"),
        (("--vblock", "90", "--lobes", "9"), "0.5"),
        (("--vblock", "180", "--lobes", "3"), "hides"),
        (("--vblock", "90", "--lobes", "16"), "2 - 15"),
        (("--vblock", "60", "--lobes", "3", "--filter", "2"), "0 - 2 UPR"),
    ):
        refused = console(*words, *more)
        assert refused.code == 1 and told in refused.err and "lobed.csv" in refused.err
    assert console("roundness", str(lobed(tmp_path, "# method: two_point"))).code == 1


def test_a_band_and_a_robust_fit(console: Console, tmp_path: Path) -> None:
    path = lobed(tmp_path, "# filter_upr: 150")
    said = console("roundness", str(path), "--band", "2:15")
    assert "filter 2 - 15 UPR" in said.out and "already filtered it, at 150 UPR" in said.out
    listed = console("roundness", str(path), "--band", "2:15", "--json").json
    assert (listed["filter_upr"], listed["above_upr"], listed["filter_applied_upr"]) == (15, 2, 150)
    path.write_text(path.read_text().replace("\n100,-", "\n100,-9"))
    assert "excluded: 1" in console("roundness", str(path), "--robust").out
    assert console("roundness", str(path), "--band", "15:2").code == 2
    assert console("roundness", str(path), "--band", "2:15", "--filter", "15").code == 2


def test_a_burr_stays_in_the_verdict_and_is_named(console: Console, tmp_path: Path) -> None:
    """Forty points of 8.5 um: out of a tolerance of 5 um; without them within."""
    path, angle = tmp_path / "burr.csv", np.arange(3600) / 10
    noise = np.random.default_rng(1).normal(0, 0.1, angle.size)
    deviation = np.cos(3 * np.radians(angle)) + noise + np.where((angle >= 100) & (angle < 104), 8.5, 0.0)
    path.write_text(
        "\n".join(["angle_deg,deviation_um", *(f"{a},{d}" for a, d in zip(angle, deviation, strict=True))])
    )
    words = ("roundness", str(path), "--robust", "--job", "lee-2001-experiment-1")
    said, listed = console(*words), console(*words, "--json").json
    limit = f"its tolerance of {load_job('lee-2001-experiment-1').job.roundness_tolerance_um:g} um"
    assert "feature at 100 to 103.9 deg: 40 neighbouring outliers, +" in said.out
    assert f"with features {listed['RONt_um']:.3f} um (outside {limit})" in said.out
    assert f"without features {listed['without_features']['RONt_um']:.3f} um (within {limit})" in said.out
    assert listed["features"][0]["points"] == 40 and listed["left_out"] == 0
    assert console(*words, "--fail-out-of-tolerance").code == 3


def test_a_gap_is_told_or_refused_with_its_file(console: Console, tmp_path: Path) -> None:
    part = trace(tmp_path, np.delete(np.arange(360), range(30, 60)), eccentric_um=9.0)
    told = console("roundness", str(part), "--filter", "15")
    assert (told.code, told.err.count("\n")) == (0, 1) and "no points at 29 - 60 deg" in told.err
    path, rows = tmp_path / "part.csv", [(a, 9 * np.cos(9 * np.radians(a))) for a in range(50, 360)]
    path.write_text("\n".join(["angle_deg,deviation_um", *(f"{a},{d}" for a, d in rows)]))
    refused = console("roundness", str(path), "--filter", "15")
    assert (refused.code, refused.out) == (1, "")
    for word in ("part.csv", "no points at 359 - 50 deg", "20.01 um (allowed <= 0.84 um)", "measure"):
        assert word in refused.err


def test_a_comma_before_three_digits_is_no_small_part(console: Console, tmp_path: Path) -> None:
    """A lobe of 12.3 um p-p in nm, with thousands separated: 6,150 nm, not 6.15."""
    path = tmp_path / "thousands.csv"
    nm = [round(6150.0 * np.cos(3 * np.radians(angle))) for angle in range(360)]
    grouped = [f"{angle};{value:,}" for angle, value in enumerate(nm)]
    path.write_text("\n".join(["# state: free", "angle_deg;deviation_nm", *grouped]))
    refused = console("roundness", str(path))
    assert refused.code == 1 and not refused.out
    for word in ("thousands.csv:3", "6,150", "6.15 (# decimal: comma)", "6150 (# decimal: point)"):
        assert word in refused.err
    path.write_text("\n".join(["# state: free", "# decimal: point", "angle_deg;deviation_nm", *grouped]))
    assert console("roundness", str(path), "--json").json["RONt_um"] == pytest.approx(12.3, rel=0.01)
    grouped[0] = "0;6,150.0"
    path.write_text("\n".join(["# state: free", "angle_deg;deviation_nm", *grouped]))
    settled = console("roundness", str(path), "--json")
    assert settled.json["RONt_um"] == pytest.approx(12.3, rel=0.01)
    assert settled.json["meta"]["numbers_read"] == "6,150.0 = 6150.0" and "6,150.0 = 6150.0" in settled.err


def test_points_in_the_plane_tell_the_centre_and_a_wrong_unit_once(console: Console, tmp_path: Path) -> None:
    angle = np.radians(np.arange(0.0, 360.0, 0.5))
    radius = 25.0 + 0.002 * np.cos(3 * angle)
    x, y = 650.025 + radius * np.cos(angle), -120.5 + radius * np.sin(angle)
    path = tmp_path / "part.csv"
    path.write_text("\n".join(["x_mm,y_mm", *(f"{a:.7f},{b:.7f}" for a, b in zip(x, y, strict=True))]))
    assert re.search(r"part, x +650\.0250 +mm\n.*part, y +-120\.5000 +mm", console("roundness", str(path)).out)
    assert json.loads(console("roundness", str(path), "--json").out)["centre_y_mm"] == pytest.approx(-120.5)
    path.write_text("\n".join(["x_mm,y_mm", *(f"{a:.3f},{b:.3f}" for a, b in zip(1e3 * x, 1e3 * y, strict=True))]))
    refused = console("roundness", str(path))
    assert refused.code == 1 and refused.err.count("\n") == 1
    assert "675027.000" in refused.err and "<= 10000 mm" in refused.err


# A part in several sections: a column of heights, or a file for each.

SECTIONS = (22.0, 24.0, 26.0, 28.0, 30.0)


def sections_file(tmp_path: Path, heights: tuple[float, ...] = SECTIONS) -> Path:
    """Round sections of a cone, 0.5 um/mm on the radius, with a lobe of 2 um p-p at the first one."""
    path, angle = tmp_path / "sections.csv", np.arange(0, 360, 4)
    lines = ["Height [mm];Angle [deg];Deviation [um]"]
    for z in heights:
        lobe = (z == heights[0]) * np.cos(np.radians(3 * angle))
        lines += [f"{z};{a};{0.5 * (z - 26.0) + um:.6f}" for a, um in zip(angle, lobe, strict=True)]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_a_file_with_a_column_of_heights_has_the_form_over_the_length(console: Console, tmp_path: Path) -> None:
    seen = console("roundness", str(sections_file(tmp_path)), "--filter", "none", "--json").json
    assert [each["z_mm"] for each in seen["sections"]] == list(SECTIONS)
    assert [round(each["RONt_um"], 2) for each in seen["sections"]] == [2.0, 0.0, 0.0, 0.0, 0.0]
    assert [round(each["mean_um"], 3) for each in seen["sections"]] == [-2.0, -1.0, 0.0, 1.0, 2.0]
    assert (seen["strategy"], seen["filter_upr"]) == ("sections", None)
    assert seen["taper_um"] == pytest.approx(4.0, abs=1e-6)
    zones = {each["cylinder"]: each["CYLt_um"] for each in seen["cylinders"]}
    assert set(zones) == {"LSCY", "MZCY", "MCCY", "MICY"}
    assert seen["CYLt_um"] == zones["MZCY"] == min(zones.values())
    assert zones["MZCY"] == pytest.approx(5.0, abs=0.01), "2 um of cone to each side, 1 um of lobe below it"


def test_files_of_one_section_each_need_their_heights(console: Console, tmp_path: Path) -> None:
    paths = [trace(tmp_path / str(z), np.arange(0, 360, 4), f"# z_mm: {z}") for z in (22, 26, 30)]
    seen = console("roundness", *map(str, paths), "--json").json
    assert [each["z_mm"] for each in seen["sections"]] == [22.0, 26.0, 30.0]
    bare = trace(tmp_path / "bare", np.arange(0, 360, 4))
    said = console("roundness", str(paths[0]), str(bare))
    assert said.code == 1 and "# z_mm: Z" in said.err
    said = console("roundness", str(paths[0]), str(paths[1]))
    assert said.code == 0 and ">= 3" in said.err
    said = console("roundness", *map(str, paths), "--robust")
    assert said.code == 2 and "--robust" in said.err


def test_the_filter_along_the_part_is_named_and_needs_heights_that_are_near(
    console: Console, tmp_path: Path
) -> None:
    few = console("roundness", str(sections_file(tmp_path)), "--filter-along", "4")
    assert few.code == 1
    for word in ("--filter-along", "<= 1.14 mm", "4 mm"):
        assert word in few.err
    near = str(sections_file(tmp_path, tuple(np.arange(22.0, 30.1, 0.5))))
    seen = console("roundness", near, "--filter-along", "4", "--json").json
    assert (seen["filter_along_mm"], seen["filter_upr"], seen["index"]) == (4.0, 50.0, "assumed")
    said = console("roundness", near, "--filter-along", "4").out
    assert "Gaussian filter round: 50 UPR; along: 4 mm" in said
    assert "17 sections (roundness profiles)" in said and "assumed (no # start_mark)" in said
    assert "along: none" in console("roundness", near).out
    one = str(trace(tmp_path / "one", np.arange(0, 360, 4), "# z_mm: 22"))
    alone = console("roundness", one, "--filter-along", "4")
    assert alone.code == 1 and ">= 3" in alone.err


def test_one_section_says_its_height_or_that_it_is_not_stated(console: Console, tmp_path: Path) -> None:
    at = console("roundness", str(trace(tmp_path / "at", np.arange(0, 360, 4), "# z_mm: 22.5")))
    assert at.out.startswith("section at Z 22.50 mm\n")
    bare = console("roundness", str(trace(tmp_path / "bare", np.arange(0, 360, 4))))
    assert bare.out.startswith("one section, Z not stated\n")


def test_of_a_helix_the_form_is_stated_and_no_roundness(console: Console, tmp_path: Path) -> None:
    path, angle = tmp_path / "helix.csv", np.arange(0.0, 7200.0, 2.0)
    rows = [f"{22 + a / 900:.5f},{a:g},{2 * np.cos(np.radians(3 * a)):.4f}" for a in angle]
    path.write_text("z_mm,angle_deg,deviation_um\n" + "\n".join(rows), encoding="utf-8")
    seen = console("roundness", str(path), "--json").json
    assert (seen["strategy"], seen["sections"], seen["index"]) == ("helix", [], None)
    assert seen["CYLt_um"] == pytest.approx(4.0, abs=0.01)
    assert "no sections: roundness is not stated" in console("roundness", str(path)).out
    judged = console("roundness", str(path), "--job", "lee-2001-experiment-1", "--fail-out-of-tolerance")
    assert judged.code == 1 and "a helix (3600 points)" in judged.err


def test_a_helix_of_few_turns_is_not_judged(console: Console, tmp_path: Path) -> None:
    """What its lobe does along two turns passes for a tilt of the part: CYLt comes out 5 um too small."""
    path, angle = tmp_path / "helix.csv", np.arange(0.0, 720.0, 2.0)
    rows = [f"{22 + a / 90:.5f},{a:g},{(10 - a / 90) * np.cos(np.radians(3 * a)):.4f}" for a in angle]
    path.write_text("z_mm,angle_deg,deviation_um\n" + "\n".join(rows), encoding="utf-8")
    assert console("roundness", str(path)).code == 0
    judged = console("roundness", str(path), "--job", "lee-2001-experiment-1")
    assert judged.code == 1 and "turns of the helix: 2; the form of this part needs >= 7" in judged.err


@pytest.mark.parametrize(("language", "words"), [("en", "Most likely"), ("ko", "가장 유력한")])
@pytest.mark.parametrize(("limit_um", "fails"), [("20.0", False), ("1.0", True)])
def test_only_of_a_part_that_fails_it_is_said_why_it_most_likely_does(
    console: Console, job_file: JobFile, tmp_path: Path, language: str, words: str, limit_um: str, fails: bool
) -> None:
    job = job_file(overhang_mm="30.0", cut_length_mm="8.0", roundness_tolerance_um=limit_um)
    said = console("--lang", language, "roundness", str(sections_file(tmp_path)), "--job", str(job)).out
    assert (words in said) is fails and "Z 22.0" in said


def test_a_spike_in_one_of_several_sections_is_named_with_its_height(console: Console, tmp_path: Path) -> None:
    path = sections_file(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace("28.0;120;1.000000", "28.0;120;41.000000"))
    said = console("roundness", str(path), "--filter", "none")
    assert said.code == 0 and "Z 28 mm" in said.err and "120 deg" in said.err


def test_heights_from_the_free_end_are_said_from_the_jaws_of_their_job(
    console: Console, job_file: JobFile, tmp_path: Path
) -> None:
    path = sections_file(tmp_path, (0.5, 4.0, 7.5))
    path.write_text("# z_from: free end\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    job = job_file(overhang_mm="30.0", cut_length_mm="8.0")
    seen = console("roundness", str(path), "--job", str(job), "--json").json
    assert [each["z_mm"] for each in seen["sections"]] == [22.5, 26.0, 29.5]
    assert seen["taper_um"] == pytest.approx(-3.5, abs=0.01), "0.5 um/mm from the free end on"


def test_another_filter_goes_by_its_name_and_is_named_with_the_result(console: Console, tmp_path: Path) -> None:
    angle = np.arange(0.0, 360.0, 0.5)
    path = tmp_path / "part.csv"
    rows = "\n".join(f"{a},{10.0 * np.cos(15 * np.radians(a))}" for a in angle)
    path.write_text(f"# units_checked: yes\nangle_deg,deviation_um\n{rows}")
    heights = {"15": 10.0, "gauss:15": 10.0, "spline:15": 10.0, "2rc:15": 15.0, "none": 20.0}
    for asked, ront_um in heights.items():
        found = console("roundness", str(path), "--filter", asked, "--json").json
        assert found["RONt_um"] == pytest.approx(ront_um, abs=0.02), asked
        assert (found["filter_kind"], found["filter_upr"]) == (
            asked.split(":")[0] if ":" in asked else "gauss",
            None if asked == "none" else 15.0,
        )
    assert "2RC (75 % at the cut-off) 50 UPR" in console("roundness", str(path), "--filter", "2rc").out
    assert "robust Gaussian (ISO 16610-31) 15 UPR" in console("roundness", str(path), "--filter", "robust:15").out
    assert "filter 15 UPR" in console("roundness", str(path), "--filter", "15").out
    for wrong in ("2cr", "spline:", "spline:0.5", "12:15"):
        refused = console("roundness", str(path), "--filter", wrong)
        assert refused.code == 2 and wrong in refused.err and "gauss, spline, robust, 2rc" in refused.err


def test_a_gauge_that_hides_an_oval_proves_no_part_good(console: Console, tmp_path: Path) -> None:
    """An oval of 6 um and a spindle error against it: what is seen is round."""
    angle = np.radians(np.arange(720.0) / 2.0)
    seen = 3.0 * np.cos(2.0 * angle) - 3.0 * np.cos(2.0 * angle) + 0.5 * np.cos(3.0 * angle)
    path, job = tmp_path / "part.csv", "lee-2001-experiment-1"
    rows = "\n".join(f"{np.degrees(a)},{r:.6f}" for a, r in zip(angle, seen, strict=True))
    path.write_text(f"# units_checked: yes\n# state: free\nangle_deg,deviation_um\n{rows}")

    def judged(*gauge: str) -> dict[str, Any]:
        found = console("roundness", str(path), "--job", job, *gauge, "--json").json
        assert found["within_tolerance"] is found["judged"][0]["passes"]
        return dict(found["judged"][0])

    plain = judged()
    assert (plain["passes"], plain["U_um"], plain["decision_rule"]) == (True, None, None)
    open_ = judged("--gauge", "indicator-on-table")
    assert (open_["passes"], open_["U_um"], open_["guard_um"]) == (None, None, None)
    known = judged("--gauge", "certified-gauge")
    assert (known["passes"], known["U_um"], known["decision_rule"]) == (True, 0.3, "iso-14253-1:2017")
    assert known["guard_um"] == pytest.approx(1.645 * 0.15)
    assert judged("--gauge", "indicator-on-table", "--accept", "simple")["passes"] is True

    said = console("roundness", str(path), "--job", job, "--gauge", "indicator-on-table").out
    assert "not proven either way against 5 um" in said and re.search("gauge spindle +not stated", said)
    own = tmp_path / "own.toml"
    own.write_text(
        'name = "own"\nspindle_error_um = 3\nprobe_noise_um = 0\nprobe_gain_percent = 0\nrepeat_um = 0\n'
    )
    wrong = judged("--gauge", str(own))
    assert wrong["passes"] is None and wrong["U_um"] == pytest.approx(6.0, rel=0.1)
    refused = console("roundness", str(path), "--gauge", "none")
    assert refused.code == 1 and "simulated-gauge" in refused.err
