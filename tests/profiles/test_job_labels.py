"""Note and tags of a job: kept in its file, of which nothing else changes, and no part of its hash."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import pytest

from profiles.problem import ProfileError
from profiles.store import BUNDLED_JOBS, load_job, relabel_job, rename_job, save_job

SOURCE = BUNDLED_JOBS / "lee-2001-experiment-1.toml"


@pytest.fixture
def own(tmp_path: Path) -> Path:
    return Path(shutil.copy(SOURCE, tmp_path / "ring.toml"))


def test_a_label_changes_neither_the_hash_nor_any_other_byte(own: Path) -> None:
    bytes_before = own.read_bytes()
    labelled = relabel_job(own, note='soft jaws, "bored" to 52', tags=("urgent", "고객"))
    assert (labelled.job.note, labelled.job.tags) == ('soft jaws, "bored" to 52', ("urgent", "고객"))
    assert labelled.sha256 == hashlib.sha256(bytes_before).hexdigest() == load_job(str(SOURCE)).sha256
    assert own.read_bytes().endswith(bytes_before)
    again = relabel_job(own, note="other", tags=())
    assert (again.job.note, again.job.tags, again.sha256) == ("other", (), labelled.sha256)
    relabel_job(own, note="", tags=())
    assert own.read_bytes() == bytes_before


def test_any_other_changed_byte_changes_the_hash(own: Path) -> None:
    before = relabel_job(own, note="n", tags=("t",)).sha256
    own.write_bytes(own.read_bytes().replace(b"1000", b"1001", 1))
    assert load_job(str(own)).sha256 != before


@pytest.mark.parametrize(
    "spelling", ["note = 'by hand'\n", 'note = """by hand"""\n', "tags = [\n  'by', 'hand',\n]\n", "\ufeff"]
)
def test_labels_written_by_hand_are_replaced(own: Path, spelling: str) -> None:
    own.write_text(spelling + SOURCE.read_text(encoding="utf-8"), encoding="utf-8")
    labelled = relabel_job(own, note="new", tags=("a",))
    assert (labelled.job.note, labelled.job.tags) == ("new", ("a",))
    assert labelled.job == load_job(str(SOURCE)).job


@pytest.mark.parametrize("note", ["two\nlines", "x" * 81, "\x1b[2J", "  "])
def test_a_note_that_is_no_line_of_eighty_characters_is_refused_and_nothing_is_written(
    own: Path, note: str
) -> None:
    before = own.read_bytes()
    with pytest.raises(ProfileError) as refused:
        relabel_job(own, note=note, tags=())
    assert refused.value.problems[0].key == "note"
    assert own.read_bytes() == before


def test_a_bundled_job_takes_no_label_and_no_name() -> None:
    for change in (lambda: relabel_job(SOURCE, note="x", tags=()), lambda: rename_job(SOURCE, "x")):
        with pytest.raises(ProfileError, match="bundled"):
            change()
    assert not SOURCE.with_name("x.toml").exists()


def test_a_renamed_job_keeps_comments_and_comes_back_with_its_hash(own: Path) -> None:
    own.write_text("# ours\n" + SOURCE.read_text(encoding="utf-8").replace("lee-2001-experiment-1", "ring", 1))
    before = own.read_bytes()
    path = rename_job(own, "disc")
    assert not own.exists() and path.read_text(encoding="utf-8").startswith("# ours\n")
    assert load_job(str(path)).job.name == "disc"
    rename_job(path, "ring")
    assert own.read_bytes() == before


def test_a_name_that_is_taken_is_not_overwritten(own: Path, tmp_path: Path) -> None:
    (tmp_path / "disc.toml").write_text("mine")
    with pytest.raises(ProfileError) as refused:
        rename_job(own, "disc")
    assert refused.value.problems[0].code == "file.exists"
    assert own.exists() and (tmp_path / "disc.toml").read_text() == "mine"


def test_a_job_without_labels_is_written_as_before(tmp_path: Path) -> None:
    save_job(load_job(str(SOURCE)).job, tmp_path / "new.toml")
    assert "note" not in (tmp_path / "new.toml").read_text() and "tags" not in (tmp_path / "new.toml").read_text()
