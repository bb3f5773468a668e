"""One file of a gauge is the trace of one part: not of the next one too, and hardly of one that was cut later."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from console.session.cut.recording import part_record
from console.session.data.measured_part import MadeWith
from console.session.data.records import RunRecord
from console.session.learning.imported import ImportedTrace, examined
from console.session.learning.provenance import of_this_part, taken_before
from console.session.stages import Stage
from console.text.catalogue import load
from profiles.store import load_job
from profiles.traces import Trace, trace_content
from tests.console.commands import Console, JobFile
from tests.record_clock import set_dates
from tests.tui.records_stage import described

JOB = load_job("lee-2001-experiment-1").job


def gauge_file(
    folder: Path, name: str = "good.csv", lobe_um: float = 3.0, stated: dict[str, str] | None = None
) -> Path:
    angle_deg = np.arange(720) / 2.0
    deviation_um = lobe_um * np.cos(3.0 * np.radians(angle_deg - 20.0))
    path = folder / name
    meta = {"state": "free", "direction": "cw", "start_mark": "jaw 1", **(stated or {})}
    path.write_bytes(trace_content(Trace(angle_deg=angle_deg, deviation_um=deviation_um, meta=meta)))
    return path


def cut(folder: Path, compensation: int | None = None, of: ImportedTrace | None = None) -> str:
    """Record a part that was cut, and measured by a file."""
    written = RunRecord(folder, described(JOB))
    written.add("cut", {"strategy": "cam", "stage": "full", "inverted": "model", "compensation": compensation})
    if of is not None:
        assert of.result is not None
        file = (of.path.name, of.content)
        written.add("measured", {}, part_record(JOB, of.result, of.trace, Stage.FULL, file=file))
    written.close()
    return written.run_id


def seen(path: Path) -> ImportedTrace:
    return examined(path, JOB, {}, simulated=False)


def test_a_file_that_was_taken_for_a_part_is_not_that_of_the_next(tmp_path: Path) -> None:
    path, data = gauge_file(tmp_path), tmp_path / "data"
    assert of_this_part(seen(path), data, None).ready, "nothing is recorded yet"
    first = cut(data, of=seen(path))
    second = cut(data, compensation=1)
    assert of_this_part(seen(path), data, first).ready, "the same part may be looked at again"
    for run_id in (second, None):
        refused = of_this_part(seen(path), data, run_id)
        assert not refused.ready
        (problem,) = refused.problems
        assert problem.code == "trace.taken"
        for language in ("en", "ko"):
            assert problem.value in load(language).problem(problem)
    copied = gauge_file(tmp_path, "copy.csv")
    assert not of_this_part(seen(copied), data, second).ready, "another name does not make another part"
    assert of_this_part(seen(gauge_file(tmp_path, "new.csv", stated={"note": "of part 2"})), data, second).ready


def test_the_part_that_has_the_file_is_named_by_the_end_of_its_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, data = gauge_file(tmp_path), tmp_path / "data"
    at = datetime(2026, 3, 2, 16, 44, 12, tzinfo=UTC)
    set_dates(monkeypatch, lambda: at.isoformat().replace("+00:00", "Z"))
    cut(data, of=seen(path))
    (problem,) = of_this_part(seen(path), data, None).problems
    assert problem.value == at.astimezone().strftime("%Y-%m-%d %H:%M:%S")


@pytest.mark.parametrize(
    ("minutes", "stated", "told"),
    [(-2, None, True), (2, None, False), (2, -3, True), (None, None, False)],
    ids=["file before", "file after", "its own date before", "just copied"],
)
def test_a_file_from_before_the_end_of_the_cut_is_told_with_both_times(
    minutes: float | None, stated: float | None, told: bool, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    run_id, now = cut(data), datetime.now(UTC)

    def moved(by: float) -> datetime:
        return now + timedelta(minutes=by)

    path = gauge_file(tmp_path, stated={} if stated is None else {"date": moved(stated).isoformat()})
    if minutes is not None:
        os.utime(path, (moved(minutes).timestamp(),) * 2)
    found = of_this_part(seen(path), data, run_id)
    assert found.ready, "clocks differ: it is not refused"
    assert ["trace.older"] * told == [each.code for each in found.warnings]
    if told:
        (problem,) = found.warnings
        earlier = moved(stated if stated is not None else minutes or 0.0)
        assert problem.value == earlier.astimezone().strftime("%Y-%m-%d %H:%M:%S")
        for language in ("en", "ko"):
            words = load(language).problem(problem)
            assert problem.value in words and problem.limit in words


@pytest.mark.parametrize("date", ["yesterday", "", "0001-01-01", "9999-12-31T23:59:59-12:00"])
def test_a_date_that_is_none_says_nothing(date: str, tmp_path: Path) -> None:
    data = tmp_path / "data"
    run_id = cut(data)
    found = of_this_part(seen(gauge_file(tmp_path, stated={"date": date} if date else {})), data, run_id)
    assert found.ready and all(each.code == "trace.older" for each in found.warnings)


def test_learning_takes_a_file_only_for_a_part_that_was_cut_so(tmp_path: Path) -> None:
    path, data = gauge_file(tmp_path), tmp_path / "data"
    cut(data, of=seen(path))
    cut(data, compensation=1)
    plain = MadeWith(compensation="none", strategy="cam", stage="full", inverted="model")
    assert taken_before(data, seen(path).sha256, None, plain) == ()
    (problem,) = taken_before(data, seen(path).sha256, None, replace(plain, compensation="1"))
    assert problem.code == "trace.taken"


def test_a_file_that_has_taught_a_version_does_not_teach_as_a_part_of_it(
    console: Console, job_file: JobFile, tmp_path: Path
) -> None:
    """Nothing is measured on Inspect here: what was learned is all that is kept of the first part."""
    index = {"start_mark": "spindle index"}
    path, job = gauge_file(tmp_path, stated=index), str(job_file(cut_length_mm="0.8", feed_mm_per_rev="0.1"))
    words = ("--job", job, "--strategy", "cam", "--stage", "full", "--keep")
    first = console("learn", str(path), *words, "--compensation", "none")
    assert first.code == 0 and "version 1" in first.out
    again = console("learn", str(path), *words, "--compensation", "1")
    assert again.code == 1 and "already taught version 1" in again.err
    other = gauge_file(tmp_path, "other.csv", 1.2, index)
    taken = console("learn", str(other), *words, "--compensation", "1")
    assert taken.code == 0 and "version 2" in taken.out
