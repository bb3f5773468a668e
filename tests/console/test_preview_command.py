"""`console preview`: what is refused is marked so and decides the exit code; like is compared with like."""

from __future__ import annotations

import math

import pytest

from tests.console.commands import Console, JobFile


def test_strategies_are_marked_like_the_rules(console: Console) -> None:
    lines = console("preview", "lee-2001-experiment-1").out.splitlines()
    assert [line[:9] for line in lines if "paper: " in line] == ["!  paper:"] * 3
    assert [line[:7] for line in lines if "pvt: " in line] == ["✓  pvt:"]


def test_a_job_that_the_default_strategy_cannot_cut_is_refused(console: Console, job_file: JobFile) -> None:
    """A lobe of 350 um p-p at 50 Hz lags by more than the 150 um at which I111 trips; no rule refuses it."""
    path = str(job_file(lobe_error_um_pp="350.0", depth_of_cut_mm="0.5", cut_length_mm="1.0"))
    said = console("preview", path)
    assert said.code == 1
    assert "✗  pvt: the command would run" in said.out
    seen = console("preview", path, "--json")
    assert seen.code == 1
    assert "refusal" not in {finding["severity"] for finding in seen.json["findings"]}
    assert [finding["severity"] for finding in seen.json["strategies"]["pvt"]["findings"]] == ["refusal"]


def test_a_lobe_that_was_measured_in_aluminium_is_not_called_measured_in_steel(
    console: Console, job_file: JobFile
) -> None:
    words = "measured, but on another cut"
    assert words not in console("preview", str(job_file())).out
    path = str(job_file(material='"steel"'))
    said = console("preview", path)
    assert words in said.out
    (line,) = [line for line in said.out.splitlines() if "cutting conditions as calibrated" in line]
    assert line.startswith("!") and line.split()[-2:] == ["steel", "Al"]
    assert console("preview", path, "--json").json["lobe_error_source"] == "other_cut"
    refused = console("run", path, "--sim")
    assert refused.code == 1 and "material = steel" in refused.err and "with Al" in refused.err


def test_findings_are_told_in_words_and_not_in_rounded_numbers(console: Console) -> None:
    seen = console("preview", "lee-2001-experiment-1", "--json").json
    for finding in [*seen["findings"], *seen["strategies"]["paper"]["findings"]]:
        assert set(finding) == {"severity", "code", "text"}
        assert finding["text"]
    grip = next(finding for finding in seen["findings"] if finding["code"] == "rule.grip_margin")
    assert grip["text"] == "grip margin: 645.709 N (>= 0 N)"


def test_the_drive_is_compared_like_with_like(console: Console) -> None:
    """I116 is 500 counts/ms at 5000 counts/mm, 100 mm/s; 2000 N are peak and 400 N continuous (Table 2)."""
    drive = console("preview", "lee-2001-experiment-1", "--json").json["drive"]
    assert drive["velocity_mm_per_s_limit"] == pytest.approx(100)
    assert drive["velocity_mm_per_s_percent"] == pytest.approx(drive["velocity_mm_per_s"])
    assert drive["force_n_percent"] == pytest.approx(drive["force_n"] / 20)
    assert drive["force_rms_n"] == pytest.approx(drive["force_n"] / math.sqrt(2))
    assert drive["force_rms_n_percent"] == pytest.approx(drive["force_rms_n"] / 4)
    shown = console("preview", "lee-2001-experiment-1").out
    for row in ("peak velocity", "peak thrust", "rms thrust", "peak current"):
        assert row in shown
