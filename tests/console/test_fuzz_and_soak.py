"""The fuzzer and the soak find what is planted, shorten it, and find nothing in the tree for a moment."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from console.session.data.record_file import FILE_NAME, open_records
from console.session.data.run_reader import runs
from console.session.errors import SessionError
from tests.console.reported_runs import lobed, recorded
from tests.fuzz.all_targets import TARGETS
from tests.fuzz.mutating import mutate
from tests.fuzz.target import Target, pure
from tests.soak.shift import BrokenError, Count, Event, Shift, as_text, drawn, from_text, shrunk


@pytest.mark.first(6)
@pytest.mark.parametrize("name", TARGETS)
def test_a_reader_takes_what_it_is_given_for_a_moment(name: str) -> None:
    """Its sound inputs are accepted, and those that once broke it break it no more."""
    outcome = mutate(TARGETS[name], inputs=40, seconds=1.0, seed=7)
    assert outcome.broken_by is None, outcome.error
    assert outcome.accepted


def test_a_planted_fault_of_a_reader_is_found() -> None:
    """A reader that counts on a closing bracket, as somebody may write it."""

    def read(data: bytes) -> object:
        return data.index(b"]") if b"[" in data else 0

    target = Target(name="planted", what="", seeds=lambda: [b"a[b]c"], errors=(), opened=pure(read))
    outcome = mutate(target, inputs=10_000, seconds=20.0, seed=1)
    assert outcome.broken_by is not None and b"]" not in outcome.broken_by


def tried_with(seed: int) -> list[bytes]:
    tried: list[bytes] = []
    target = Target(name="kept", what="", seeds=lambda: [b"12,34"], errors=(), opened=pure(tried.append))
    mutate(target, inputs=50, seconds=20.0, seed=seed)
    return tried


def test_the_same_seed_tries_the_same() -> None:
    assert tried_with(3) == tried_with(3) != tried_with(4)
    assert len(set(tried_with(3))) > 25


def test_a_script_is_shortened_to_what_it_takes() -> None:
    """Of a hundred events three are to blame, in this order."""
    script = tuple(Event(do=f"{place}") for place in range(100))
    blamed = [script[17], script[40], script[99]]
    short = shrunk(script, lambda part: all(each in part for each in blamed))
    assert list(short) == blamed
    assert from_text(as_text(short)) == short


def test_a_motion_that_nobody_asked_for_breaks_a_shift(tmp_path: Path) -> None:
    shift = Shift(tmp_path, 1, Count())
    shift.happen(Event(do="work"))
    assert shift.count.cuts == 1
    with pytest.raises(BrokenError, match="in motion"):
        shift._floor.sim.connect().receive(b"#3J:4000\r#2J+\r")
        shift._floor.sim.wait(0.1)
        shift._check_rest()


def test_a_run_that_is_missing_in_the_record_breaks_a_shift(tmp_path: Path) -> None:
    shift = Shift(tmp_path, 1, Count())
    shift._started = 1
    with pytest.raises(BrokenError, match="1 cuts"):
        shift.close()


def test_a_shift_draws_the_same_again() -> None:
    from random import Random

    first, second = Random(5), Random(5)
    assert [drawn(first) for _ in range(50)] == [drawn(second) for _ in range(50)]


def test_a_record_whose_schema_is_no_text_is_called_damaged(tmp_path: Path) -> None:
    """SQLite names the table in its error, and Python cannot read the name."""
    recorded(tmp_path, {"after": lobed(5.0)})
    path = tmp_path / FILE_NAME
    content = path.read_bytes()
    assert content.count(b"tabletextstexts") == 1
    path.write_bytes(content.replace(b"tabletextstexts", b"tablet\xacxtstexts"))
    with pytest.raises(SessionError) as read:
        runs(tmp_path)
    with pytest.raises(SessionError) as written:
        open_records(tmp_path, time.monotonic())
    assert {error.value.problems[0].code for error in (read, written)} == {"record.damaged"}
