"""Gauge files: bundled ones, own ones, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from profiles.gauge import gauge_from_table
from profiles.metrology.conformity import DecisionRule
from profiles.problem import ProfileError
from profiles.store import list_gauges, load_gauge

BUNDLED = ("bench-roundness-tester", "certified-gauge", "indicator-on-table", "simulated-gauge")


def test_bundled_gauges_load_by_name_and_are_judged_by_the_present_edition() -> None:
    assert tuple(each.name for each in list_gauges()) == BUNDLED
    gauges = {each: load_gauge(each) for each in BUNDLED}
    assert {each.rule for each in gauges.values()} == {DecisionRule.ISO_2017}
    assert gauges["certified-gauge"].roundness_u_um == 0.3
    assert gauges["indicator-on-table"].spindle_error_um is None  # not stated is not 0
    assert gauges["simulated-gauge"].spindle_error_um == 0.0


def test_own_gauge_hides_the_bundled_one_and_must_have_the_name_of_its_file(tmp_path: Path) -> None:
    own = tmp_path / "simulated-gauge.toml"
    own.write_text('name = "simulated-gauge"\ndecision_rule = "simple"\n[spindle]\nspindle_error_um = 3\n')
    gauge = load_gauge("simulated-gauge", tmp_path)
    assert (gauge.spindle_error_um, gauge.rule) == (3.0, DecisionRule.SIMPLE)
    own.rename(tmp_path / "other.toml")
    with pytest.raises(ProfileError) as caught:
        load_gauge("other", tmp_path)
    assert caught.value.problems[0].code == "gauge.name_differs"


@pytest.mark.parametrize(
    ("more", "code", "key"),
    [
        ({"spindle_error_um": -1}, "value.out_of_range", "spindle_error_um"),
        ({"calibrated": "31.3.2026"}, "gauge.no_date", "calibrated"),
        ({"valid_until": "20260331"}, "gauge.no_date", "valid_until"),
        ({"decision_rule": "generous"}, "value.not_choice", "decision_rule"),
        ({"spindle_eror_um": 1.0}, "key.unknown", "spindle_eror_um"),
        ({"schema": 2}, "schema.unsupported", "schema"),
    ],
)
def test_what_no_gauge_states_is_refused_by_its_key(more: dict[str, object], code: str, key: str) -> None:
    with pytest.raises(ProfileError) as caught:
        gauge_from_table({"name": "a", **more}, where="a.toml")
    (problem,) = caught.value.problems
    assert (problem.code, problem.key, problem.where) == (code, key, "a.toml")
