"""The job in hand: what an entry means, what it changes, and that nothing is lost on the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.work import Work, edited, opened, parsed, saved_as, undone, with_strategy
from profiles.job import SIMULATED_SOURCE
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine


@pytest.fixture
def work() -> Work:
    return opened(load_job("lee-2001-experiment-1"), load_machine("lee-2001-lathe"))


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("1314", 1314.0),
        ("1314.5", 1314.5),
        ("1314,5", 1314.5),
        (" 20 ", 20.0),
        ("0,100", 0.1),
        (".5", 0.5),
        ("7.", 7.0),
    ],
)
def test_a_number_may_have_a_point_or_a_comma(typed: str, meant: float) -> None:
    assert parsed(typed, "chucking_force_n") == meant


@pytest.mark.parametrize(
    ("typed", "code"),
    [
        ("1,314", "value.ambiguous"),
        ("1.314.5", "value.ambiguous"),
        ("1,314.5", "value.ambiguous"),
        ("1_000", "value.not_number"),
        ("1e3", "value.not_number"),
        ("nan", "value.not_number"),
        ("١٢", "value.not_number"),
        ("--5", "value.not_number"),
        ("-5", "value.out_of_range"),
        ("0", "value.out_of_range"),
        ("100001", "value.out_of_range"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_the_limits(typed: str, code: str) -> None:
    with pytest.raises(ProfileError) as raised:
        parsed(typed, "chucking_force_n")
    (problem,) = raised.value.problems
    assert (problem.code, problem.key, problem.limit) == (code, "chucking_force_n", ">= 0.1, <= 100000 N")


@pytest.mark.parametrize(
    "typed", ["1,234.5", "1.234,5", "1 234,5", "1\u00a0234", "1\u202f234", "1'234.5", "1\u2019234"]
)
@pytest.mark.parametrize("sign", ["", "-", "\u2212"])
def test_separated_thousands_are_never_taken_for_another_number(typed: str, sign: str) -> None:
    with pytest.raises(ProfileError) as raised:
        parsed(sign + typed, "chucking_force_n")
    assert raised.value.problems[0].code in ("value.ambiguous", "value.not_number")


@pytest.mark.parametrize("typed", ["3.5", "3,0", "three", ""])
def test_jaws_are_counted(typed: str) -> None:
    with pytest.raises(ProfileError) as raised:
        parsed(typed, "jaws")
    assert raised.value.problems[0].code == "value.not_whole"
    assert parsed("6", "jaws") == 6


def test_an_edit_can_be_undone_step_by_step(work: Work) -> None:
    after = edited(edited(work, "spindle_speed_rpm", "800"), "material", "Steel")
    assert (after.job.spindle_speed_rpm, after.job.material, after.edited) == (800.0, "Steel", True)
    assert undone(after).job.material == "Al"
    assert undone(undone(after)).job == work.job
    assert not undone(undone(after)).edited
    assert undone(work) is work


def test_an_edit_that_changes_nothing_keeps_what_was_computed(work: Work) -> None:
    assert edited(work, "chucking_force_n", "1314") is work


def test_the_error_stays_with_the_force_at_which_it_was_found(work: Work) -> None:
    after = edited(work, "chucking_force_n", "900")
    assert (after.job.chucking_force_n, after.job.error_force_n) == (900.0, 1314.0)


def test_a_value_that_the_operator_gives_is_not_assumed(work: Work) -> None:
    assert "chucking_force_n" in work.job.assumed
    after = edited(work, "chucking_force_n", "900")
    assert "chucking_force_n" not in after.job.assumed
    assert "feed_mm_per_rev" in after.job.assumed
    assert "chucking_force_n" in undone(after).job.assumed


def test_a_job_saved_under_another_name_is_the_one_in_hand(work: Work, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "jobs"
    before = edited(with_strategy(work, "paper"), "feed_mm_per_rev", "0.04")
    after = saved_as(before, "ring", folder)
    assert after.loaded.path == folder / "ring.toml"
    assert (after.job.name, after.job.feed_mm_per_rev, after.strategy) == ("ring", 0.04, "paper")
    assert not after.edited
    assert load_job("ring", folder).job == after.job


def test_saving_never_writes_over_a_file(work: Work, tmp_path: Path) -> None:
    (tmp_path / "ring.toml").write_text("mine")
    with pytest.raises(ProfileError) as raised:
        saved_as(work, "ring", tmp_path)
    assert raised.value.problems[0].code == "file.exists"
    assert (tmp_path / "ring.toml").read_text() == "mine"


def test_a_folder_that_cannot_be_made_is_a_refusal(work: Work, tmp_path: Path) -> None:
    (tmp_path / "jobs").write_text("a file")
    with pytest.raises(ProfileError) as raised:
        saved_as(work, "ring", tmp_path / "jobs")
    assert raised.value.problems[0].code == "file.not_writable"


def test_a_copy_says_what_it_was_copied_from_and_not_the_source_of_that(work: Work, tmp_path: Path) -> None:
    steel = edited(work, "material", "steel")
    assert "Table 6" in steel.job.source
    copied = saved_as(steel, "mine", tmp_path).job
    assert (copied.source, copied.copied_from) == ("", "lee-2001-experiment-1")
    assert (copied.material, copied.lobe_material) == ("steel", "Al")
    again = saved_as(saved_as(steel, "mine-2", tmp_path), "mine-3", tmp_path).job
    assert again.copied_from == "mine-2"


def test_a_copy_keeps_it_that_its_lobe_is_one_of_a_simulated_part(work: Work, tmp_path: Path) -> None:
    practice = replace(work.job, source=f"Table 6; {SIMULATED_SOURCE}")
    copied = saved_as(replace(work, job=practice), "mine", tmp_path).job
    assert copied.source == SIMULATED_SOURCE
