"""`console predict`: the same numbers in words and in JSON, and a job that cannot be predicted is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.console.commands import Console, JobFile


def test_json_has_the_error_over_angle_and_z(console: Console) -> None:
    seen = console("predict", "lee-2001-experiment-1", "--json").json
    error = np.array(seen["error_um"])
    assert error.shape == (len(seen["z_mm"]), len(seen["angle_deg"])) == (7, 360)
    assert seen["error_um_pp"] == pytest.approx(np.ptp(error, axis=1).tolist())
    assert seen["angle_deg"][int(error[0].argmax())] % 120 == 90
    assert (seen["cut"]["mechanism"], seen["cut"]["high_at_jaws"]) == ("spring_back", True)
    assert seen["cut"]["measured_um_pp"] == 55.0
    assert 3077 < seen["model"]["matching_force_n"] < 6593
    assert (seen["scaled_to"]["source"], seen["scaled_to"]["found_um_pp"]) == ("measured", 55.0)
    assert seen["cut"]["um_pp"] == pytest.approx(55.0)
    assert seen["model"]["um_pp"] == pytest.approx(12.37, abs=0.01)
    assert seen["clamping"]["minimum_n"] < seen["clamping"]["at_rest_n"] < seen["clamping"]["maximum_n"]
    assert seen["process"]["force"]["main_n"] == pytest.approx(7.40, abs=0.005)
    minded = [finding["code"] for finding in seen["findings"] if finding["severity"] != "ok"]
    assert minded == ["rule.second_pass"]


@pytest.mark.parametrize(("language", "words"), [("en", "springs back"), ("ko", "탄성 복원")])
def test_people_read_the_same_numbers(console: Console, language: str, words: str) -> None:
    seen = console("predict", "lee-2001-experiment-1", "--json").json
    said = console("predict", "lee-2001-experiment-1", "--lang", language)
    assert said.code == 0
    for number in (
        f"{seen['cut']['um_pp']:.2f} um",
        f"{seen['model']['um_pp']:.2f} um",
        f"× {seen['scaled_to']['factor']:.3g}",
        f"{seen['model']['matching_force_n']:.0f} N",
        words,
    ):
        assert number in said.out
    assert "{" not in said.out


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"material": '"cheese"'}, "cheese"),
        ({"chucking_force_n": "344.0"}, "grip margin"),
    ],
)
def test_what_cannot_be_predicted_is_refused(
    console: Console, job_file: JobFile, changes: dict[str, str], said: str
) -> None:
    answer = console("predict", str(job_file(**changes)))
    assert (answer.code, answer.out) == (1, "")
    assert said in answer.err


def test_a_job_that_clamps_too_hard_is_refused_with_the_force_that_passes(
    console: Console, job_file: JobFile
) -> None:
    """49.12 MPa of bending and 1.26 of hoop force at 1314 N: 120 MPa, where plain aluminium yields, at 3129 N."""
    for force_n, code, mark in ((3130, 1, "✗"), (3129, 0, "✓")):
        forces = {"chucking_force_n": f"{force_n}.0", "lobe_force_n": f"{force_n}.0"}
        answer = console("predict", str(job_file(**forces)))
        assert answer.code == code
        (line,) = [line for line in answer.out.splitlines() if "stress under the jaws" in line]
        assert line.startswith(mark) and line.endswith("<= 120 MPa (3129 N)")


def test_limits_beyond_what_the_machine_has_limit_nothing(console: Console) -> None:
    """A bar has hardly any lobe: 6e8 N would change it by the tolerance, and 3e7 rpm would be too fast for it."""
    seen = console("predict", "steel-bar-65", "--json").json
    assert seen["clamping"]["beyond"] == ["scatter", "uncompensated"]
    assert seen["clamping"]["limits_n"]["scatter"] > 6593.0 == seen["clamping"]["limits_n"]["chuck"]
    assert set(seen["envelope"]["beyond"]) == set(seen["envelope"]["at_job"]["rpm"])
    assert (seen["cut"]["crest_deg"], seen["cut"]["high_at_jaws"]) == (None, None)
    said = console("predict", "steel-bar-65").out
    numbers = [float(word) for line in said.splitlines() for word in line.split() if word.isdigit()]
    assert max(numbers) == 6593
    assert "no lobe at the jaws" in said and "high at the jaws" not in said
    assert re.search(r"spindle +3000 +33\.3", said)
