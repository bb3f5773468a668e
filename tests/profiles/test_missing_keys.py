"""An empty file is one mistake, not fifteen; a few missing keys are each their own."""

import pytest

from profiles.job import JOB_FIELDS, job_from_table
from profiles.problem import Problem, ProfileError

REQUIRED = [field.key for field in JOB_FIELDS if field.required]


def problems(table: dict[str, object]) -> list[Problem]:
    with pytest.raises(ProfileError) as caught:
        job_from_table(table, where="mine.toml")
    return list(caught.value.problems)


def test_an_empty_job_is_one_problem_that_lists_every_key() -> None:
    (problem,) = problems({})
    assert (problem.code, problem.where) == ("key.missing_several", "mine.toml")
    assert problem.key.split(", ") == REQUIRED
    assert problem.value == str(len(REQUIRED))


def test_with_another_mistake_every_key_is_told() -> None:
    found = problems({"name": 3})
    assert [problem.code for problem in found] == ["value.not_text", *["key.missing"] * (len(REQUIRED) - 1)]
