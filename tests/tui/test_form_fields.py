"""The fields of the form: numbers are shown as they are, limits fit their cells, file names can be kept."""

from __future__ import annotations

import pytest

from console.text.catalogue import load
from console.tui.pages.fields import (
    FORM,
    bounds,
    free_name,
    judge,
    name_problem,
    named,
    with_unit,
    written,
)
from console.units import METRIC
from tests.tui.stage import LANGUAGES, experiment

FIELDS = {field.key: field for field in FORM}


@pytest.mark.parametrize(
    ("value", "decimals", "shown"),
    [
        (52.0, 3, "52.000"),
        (0.05, 3, "0.050"),
        (0.0505, 3, "0.0505"),
        (1314.25, 1, "1314.25"),
        (0.00001, 3, "0.00001"),
    ],
)
def test_a_number_is_never_shown_rounded(value: float, decimals: int, shown: str) -> None:
    assert METRIC.exact(value, "N", decimals) == shown


def test_a_value_has_its_mark_and_its_unit() -> None:
    job = experiment().job
    assert with_unit(FIELDS["diameter_mm"], job, METRIC) == "D 52.000 mm"
    assert with_unit(FIELDS["chucking_force_n"], job, METRIC) == "1314.0 N"
    assert with_unit(FIELDS["jaws"], job, METRIC) == "3"


@pytest.mark.parametrize(
    ("key", "shown"),
    [("diameter_mm", ">0 ≤500"), ("chucking_force_n", ">0 ≤100000"), ("jaws", "≥2 ≤12"), ("material", "")],
)
def test_limits_stand_in_ten_cells(key: str, shown: str) -> None:
    assert bounds(FIELDS[key], METRIC) == shown
    assert len(shown) <= 10


@pytest.mark.parametrize("field", FORM, ids=lambda field: field.key)
def test_what_is_shown_can_be_typed_again(field: object) -> None:
    work = experiment()
    assert judge(work, FIELDS[field.key], written(FIELDS[field.key], work.job, METRIC), METRIC).work is work  # type: ignore[attr-defined]


def test_an_empty_entry_keeps_the_value() -> None:
    work = experiment()
    judged = judge(work, FIELDS["chucking_force_n"], "  ", METRIC)
    assert judged.work is work
    assert judged.problems == ()


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_refusal_calls_the_field_as_the_form_does(language: str) -> None:
    text, field = load(language), FIELDS["chucking_force_n"]
    (problem,) = judge(experiment(), field, "200000", METRIC).problems
    words = text.problem(named(problem, text))
    assert text("setup.chucking_force_n") in words
    assert "chucking_force_n" not in words
    assert "100000 N" in words


@pytest.mark.parametrize("name", ["ring", "ring 2", "링 가공", "a.b", "x" * 60])
def test_names_that_can_be_kept(name: str) -> None:
    assert name_problem(name, frozenset()) is None


@pytest.mark.parametrize(
    "name", ["../ring", "a/b", ".ring", "-x", "~", "ring.toml", "ring.TOML", "a\tb", "a\\b", "\udcff"]
)
def test_names_that_are_no_file_names(name: str) -> None:
    problem = name_problem(name, frozenset())
    assert problem is not None
    assert problem.code == "file.name_unfit"


def test_a_name_that_is_too_long_says_how_long_it_may_be() -> None:
    problem = name_problem("x" * 61, frozenset())
    assert problem is not None
    assert (problem.value, problem.limit) == ("61", "<= 60")


def test_a_taken_name_offers_a_free_one() -> None:
    taken = frozenset({"ring", "ring-2"})
    problem = name_problem("ring", taken)
    assert problem is not None
    assert (problem.code, problem.limit) == ("screen.name_taken", "ring-3")
    assert name_problem(free_name("ring", taken), taken) is None
    assert name_problem(free_name("가" * 60, frozenset()), frozenset()) is None
