"""Machine and job are those of the recording: the saved ones where they are the same, else made from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.school.practising import machine_recorded, work_recorded
from profiles.store import load_machine, save_job
from tests.school.practice.test_recorded_events import OWN, fails_in_a_cut
from tests.tui.stage import lathe


def test_a_saved_machine_is_used_as_long_as_it_is_the_same(tmp_path: Path) -> None:
    recording = fails_in_a_cut(tmp_path / "data")
    assert machine_recorded(recording, tmp_path).path == lathe().path


@pytest.mark.parametrize("change", [{"machine_sha256": "0" * 64}, {"machine_path": Path("/nowhere/lathe.toml")}])
def test_another_machine_of_the_name_is_not_taken_for_it(change: dict[str, object], tmp_path: Path) -> None:
    recording = fails_in_a_cut(tmp_path / "data")
    tool = replace(recording.header.machine.tool, moving_mass_kg=3.21)
    header = replace(recording.header, machine=replace(recording.header.machine, tool=tool), **change)  # type: ignore[arg-type]
    loaded = machine_recorded(replace(recording, header=header), tmp_path)
    assert loaded.machine == header.machine
    # The simulator reads the file of the profile: it has to say the same.
    assert load_machine(str(loaded.path)).machine == header.machine


def test_a_job_that_is_not_saved_is_opened_from_the_recording_and_one_that_is_from_its_file(
    tmp_path: Path,
) -> None:
    data = tmp_path / "data"
    recorded = fails_in_a_cut(data).moments[-1].work
    assert recorded is not None
    edited = replace(recorded, job=replace(recorded.job, depth_of_cut_mm=0.07), strategy="cam", stage="partial")
    work, saved = work_recorded(edited, lathe(), data, tmp_path)
    assert not saved and work.loaded.job == OWN
    assert (work.job.depth_of_cut_mm, work.strategy, work.stage, work.edited) == (0.07, "cam", "partial", True)
    (data / "jobs").mkdir()
    save_job(OWN, data / "jobs" / "other-name.toml")
    again = replace(recorded, sha256=work.loaded.sha256)
    work, saved = work_recorded(again, lathe(), data, tmp_path)
    assert saved and work.loaded.path.name == "other-name.toml" and not work.edited
