"""What a killed writer has left is taken away; what somebody alive writes, or is nobody's of ours, never."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from profiles.files import made_locked, remove_all_left, write_atomically

WRITES = """
import signal, sys
from pathlib import Path
from profiles import files
def wait(*_, **__):
    print("in the middle", flush=True)
    signal.pause()
files._move = wait
files.write_atomically(Path(sys.argv[1]), b"new", overwrite=True)
"""


@contextmanager
def in_the_middle(path: Path) -> Iterator[None]:
    """A process that has written its temporary file, and has not moved it yet; it is killed at the end."""
    command = [sys.executable, "-c", WRITES, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == b"in the middle\n"
            yield
        finally:
            process.kill()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_writer_that_was_killed_leaves_nothing_behind_the_next(tmp_path: Path) -> None:
    path = tmp_path / "job.toml"
    path.write_bytes(b"old")
    with in_the_middle(path):
        (left,) = set(names(tmp_path)) - {"job.toml"}
        remove_all_left(tmp_path)
        write_atomically(tmp_path / "job.toml", b"newer", overwrite=True)
        assert left in names(tmp_path), "that one is alive"
    write_atomically(tmp_path / "another.toml", b"", overwrite=False)
    assert left in names(tmp_path), "the folder may be anybody's"
    write_atomically(path, b"newest", overwrite=True)
    assert (names(tmp_path), path.read_bytes()) == (["another.toml", "job.toml"], b"newest")


def test_in_a_folder_of_ours_all_that_was_left_goes_and_nothing_else(tmp_path: Path) -> None:
    inner = tmp_path / "learned" / "machine"
    inner.mkdir(parents=True)
    stays = [
        tmp_path / "notes.tmp",
        tmp_path / ".part.csv.tmp",
        inner / "version.0123abcd.tmp",
        inner / ".x.0123ABCD.tmp",
    ]
    for path in (*stays, tmp_path / ".job.toml.0123abcd.tmp", inner / ".version-000001.json.89abcdef.tmp"):
        path.write_bytes(b"")
    os.symlink(stays[0], inner / ".link.01234567.tmp")
    os.mkfifo(inner / ".pipe.01234567.tmp")
    remove_all_left(tmp_path)
    kept = [path for path in tmp_path.rglob("*") if not path.is_dir()]
    assert sorted(kept) == sorted([*stays, inner / ".link.01234567.tmp", inner / ".pipe.01234567.tmp"])
    remove_all_left(tmp_path / "nowhere")


@pytest.mark.timeout(60)
def test_somebody_who_clears_up_takes_no_file_from_a_writer(tmp_path: Path) -> None:
    over = threading.Event()

    def clear_up() -> None:
        while not over.is_set():
            remove_all_left(tmp_path)

    clearing = threading.Thread(target=clear_up)
    clearing.start()
    try:
        for number in range(150):
            path = tmp_path / f".{number}.0123abcd.tmp"
            descriptor = made_locked(path, 0o600)
            assert os.path.samestat(os.fstat(descriptor), os.stat(path))
            os.close(descriptor)
    finally:
        over.set()
        clearing.join()
