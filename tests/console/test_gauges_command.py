"""`console gauges`, and the gauge in what `console run` and the screens measure."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from console.session.gauge_in_use import gauge_in_use
from profiles.problem import ProfileError
from tests.console.commands import Console

JOB = "lee-2001-experiment-1"


def test_the_chosen_gauge_is_remembered_in_the_data_folder(console: Console, tmp_path: Path) -> None:
    data = ("--data", str(tmp_path))
    assert gauge_in_use(tmp_path) is None
    assert console("gauges", "use", "certified-gauge", *data).code == 0
    found = gauge_in_use(tmp_path)
    assert found is not None and found.name == "certified-gauge"
    assert "certified-gauge (in use)" in console("gauges", *data).out
    listed = console("gauges", *data, "--json").json
    assert listed["in_use"] == "certified-gauge"
    by_name = {each["name"]: each for each in listed["gauges"]}
    assert by_name["certified-gauge"]["roundness_u_um"] == 0.3
    assert by_name["indicator-on-table"]["spindle_error_um"] is None

    refused = console("gauges", "use", "nix", *data)
    assert refused.code == 1 and "simulated-gauge" in refused.err
    assert console("gauges", "use", "none", *data).code == 0
    assert gauge_in_use(tmp_path) is None


def test_a_damaged_choice_is_told_with_the_remedy(console: Console, tmp_path: Path) -> None:
    (tmp_path / "gauge_in_use.json").write_text('{"schema": 1, "gauge": 7}')
    with pytest.raises(ProfileError) as caught:
        gauge_in_use(tmp_path)
    assert caught.value.problems[0].code == "gauge.choice_damaged"
    said = console("gauges", "--data", str(tmp_path))
    assert said.code == 1 and "console gauges use NAME" in said.err


def test_a_rule_without_a_gauge_is_refused(console: Console, tmp_path: Path) -> None:
    said = console("run", JOB, "--sim", "--accept", "simple", "--data", str(tmp_path))
    assert said.code == 1 and "--gauge NAME" in said.err


def test_a_run_on_a_gauge_has_its_u_in_result_and_record(console: Console, tmp_path: Path) -> None:
    data = ("--data", str(tmp_path))
    found = console("run", JOB, "--sim", "--gauge", "certified-gauge", *data, "--json").json
    said = found["uncertainty"]
    assert (said["gauge"], said["RONt_U_um"], said["CYLt_U_um"]) == ("certified-gauge", 0.3, 0.8)
    assert [(each["kind"], each["U_um"]) for each in found["judged"]] == [("roundness", 0.3), ("diameter", 3.0)]
    (listed,) = console("records", "list", *data, "--json").json["runs"]
    shown = console("records", "show", listed["run"], *data)
    assert "± 0.30" in shown.out and "ISO 14253-1:2017" in shown.out
    open_ = console("run", JOB, "--sim", "--gauge", "indicator-on-table", *data, "--json").json
    assert open_["within_tolerance"] is None
    assert json.dumps(open_)  # no infinity
    assert "not proven either way" in console("records", "list", *data).out
    file = tmp_path / "report.html"
    assert console("report", "--output", str(file), *data).code == 0
    first = file.read_text().partition('id="asked"')[0]
    assert "not proven either way" in first and "not judged" not in first
