"""The signature under the safety devices of a machine profile says what was signed for."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

from profiles.machine import machine_from_table, real_machine_problems
from profiles.problem import ProfileError
from profiles.store import list_machines, load_machine

BUNDLED = [entry.name for entry in list_machines()]


def table(**safety: str | None) -> dict[str, Any]:
    """The first bundled machine with other keys in [safety]; None takes a key away."""
    read = tomllib.loads(load_machine(BUNDLED[0]).path.read_text(encoding="utf-8"))
    section = read["safety"] | safety
    return read | {"safety": {key: value for key, value in section.items() if value is not None}}


@pytest.mark.parametrize("name", BUNDLED)
def test_a_bundled_machine_is_signed_for_the_simulator_alone(name: str) -> None:
    (problem,) = real_machine_problems(load_machine(name).machine)
    assert (problem.code, problem.where, problem.value) == ("safety.signed_for_simulator", name, "simulator")


def test_a_machine_that_somebody_has_signed_for_may_be_met() -> None:
    signed = machine_from_table(table(signed_by="Kim, 2026-03-01", signed_for="machine"))
    assert real_machine_problems(signed) == ()
    assert real_machine_problems(machine_from_table(table(signed_by=None, signed_for=None))) == ()


@pytest.mark.parametrize(
    ("signed_for", "code"), [(None, "key.missing"), ("", "value.not_choice"), ("iron", "value.not_choice")]
)
def test_a_signature_says_what_was_signed_for(signed_for: str | None, code: str) -> None:
    with pytest.raises(ProfileError) as refusal:
        machine_from_table(table(signed_by="Kim, 2026-03-01", signed_for=signed_for), where="lathe.toml")
    (problem,) = refusal.value.problems
    assert (problem.code, problem.where, problem.key) == (code, "lathe.toml", "safety.signed_for")
    assert problem.limit == "machine | simulator"


@pytest.mark.parametrize(
    ("signed_by", "code"),
    [
        ("   ", "value.blank"),
        ("\u3000", "value.not_text"),  # an ideographic space
        ("\u3164", "value.blank"),  # a Hangul filler is a letter without ink
        ("\x07", "value.not_text"),
        ("Kim\r2026", "value.not_text"),
        ("-", "safety.nobody_named"),
        ("2026-03-01", "safety.nobody_named"),
    ],
)
def test_blanks_marks_and_dates_are_nobodys_signature(signed_by: str, code: str) -> None:
    with pytest.raises(ProfileError) as refusal:
        machine_from_table(table(signed_by=signed_by, signed_for="machine"), where="lathe.toml")
    (problem,) = refusal.value.problems
    assert (problem.code, problem.where, problem.key) == (code, "lathe.toml", "safety.signed_by")


@pytest.mark.parametrize(
    ("section", "key"),
    [("", "source"), ("", "link"), ("tool", "name"), ("chuck", "name"), ("safety", "signed_by")],
)
def test_a_text_of_blanks_is_refused_wherever_it_counts_as_somebodys_word(section: str, key: str) -> None:
    read = table(signed_by="Kim, 2026-03-01", signed_for="machine")
    read |= {section: read[section] | {key: "  "}} if section else {key: "  "}
    with pytest.raises(ProfileError) as refusal:
        machine_from_table(read)
    assert [problem.code for problem in refusal.value.problems] == ["value.blank"]
