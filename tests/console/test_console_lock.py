"""The lock of a machine on one computer: taken, held by another console, left by one that is gone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.errors import SessionError
from console.session.station.owning import FOREIGN, ConsoleLock, take_lock
from profiles.files import NOT_REGULAR
from tests.console.consoles import ADDRESS

HOLDS_AND_DIES = """
import os, signal, sys
from pathlib import Path
from console.session.station.owning import take_lock
lock = take_lock(Path(sys.argv[1]), sys.argv[2])
lock.keep(4711)
print("held", flush=True)
sys.stdin.read()
"""


def taken(data: Path, address: str = ADDRESS) -> ConsoleLock:
    lock = take_lock(data, address)
    assert lock is not None
    return lock


def lock_file(data: Path) -> Path:
    (path,) = (data / "locks").iterdir()
    return path


def test_a_second_console_does_not_get_it_before_the_first_lets_go(tmp_path: Path) -> None:
    first = taken(tmp_path)
    assert first.last_number == 0
    assert take_lock(tmp_path, ADDRESS) is None
    first.close()
    taken(tmp_path).close()


def test_a_console_that_was_killed_has_let_go_and_left_its_number(tmp_path: Path) -> None:
    words = [sys.executable, "-c", HOLDS_AND_DIES, str(tmp_path), ADDRESS]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert take_lock(tmp_path, ADDRESS) is None
        process.kill()
        process.wait()
        assert taken(tmp_path).last_number == 4711


def test_machines_at_other_addresses_and_other_users_have_locks_of_their_own(tmp_path: Path) -> None:
    locks = [
        taken(tmp_path / "one"),
        taken(tmp_path / "two"),
        *(taken(tmp_path, at) for at in ("serial:/dev/ttyUSB0", "tcp:[::1]:1025", "serial:../../x")),
    ]
    assert {path.parent for path in (tmp_path / "locks").rglob("*")} == {tmp_path / "locks"}
    for lock in locks:
        lock.close()


def test_how_a_machine_is_spoken_to_makes_no_other_machine_of_it(tmp_path: Path) -> None:
    lock = taken(tmp_path, "ethernet:lathe?stop=reserved")
    assert take_lock(tmp_path, "ethernet:lathe") is None
    lock.close()


def test_a_shorter_number_leaves_nothing_of_a_longer_one(tmp_path: Path) -> None:
    lock = taken(tmp_path)
    for number in (2**31 - 1, 7):
        lock.keep(number)
    lock.close()
    assert taken(tmp_path).last_number == 7


@given(content=st.binary(max_size=40))
def test_whatever_is_in_the_file_is_a_number_or_nothing(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    data = tmp_path_factory.mktemp("data")
    taken(data).close()
    lock_file(data).write_bytes(content)
    lock = taken(data)
    lock.close()
    assert lock.last_number >= 0
    assert lock.last_number == 0 or str(lock.last_number) in content.decode("latin-1")


def test_the_file_is_the_users_alone(tmp_path: Path) -> None:
    taken(tmp_path).close()
    assert lock_file(tmp_path).stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("in_the_way", ["locks", f"locks/{ADDRESS.replace(':', '_')}.lock"])
def test_a_lock_that_cannot_be_written_is_told(tmp_path: Path, in_the_way: str) -> None:
    blocked = tmp_path / in_the_way
    blocked.parent.mkdir(exist_ok=True)
    if in_the_way == "locks":
        blocked.write_text("", encoding="ascii")
    else:
        blocked.mkdir()
    with pytest.raises(SessionError) as refusal:
        take_lock(tmp_path, ADDRESS)
    (problem,) = refusal.value.problems
    assert problem.code == "lock.unwritable"
    assert os.fspath(tmp_path) in str(problem.where)


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_whatever_the_umask_the_lock_and_its_folders_are_the_users_alone(tmp_path: Path, umask: int) -> None:
    data = tmp_path / "share" / "trilobe"
    before = os.umask(umask)
    try:
        taken(data).close()
    finally:
        os.umask(before)
    assert {path.stat().st_mode & 0o777 for path in (data.parent, data, data / "locks")} == {0o700}
    assert lock_file(data).stat().st_mode & 0o777 == 0o600


def test_the_file_of_another_user_is_refused_and_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lock = taken(tmp_path)
    lock.keep(4711)
    lock.close()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    with pytest.raises(SessionError):
        take_lock(tmp_path, ADDRESS)
    assert lock_file(tmp_path).read_text(encoding="ascii") == "4711\n"


@pytest.mark.parametrize("kind", ["symbolic link", "dangling link", "hard link", "pipe", "linked folder"])
def test_what_somebody_has_put_in_its_place_is_refused_and_stays_as_it_is(tmp_path: Path, kind: str) -> None:
    victim, data = tmp_path / "victim", tmp_path / "data"
    place = data / "locks" / f"{ADDRESS.replace(':', '_')}.lock"
    victim.write_text("what matters\n", encoding="ascii")
    (data if kind == "linked folder" else place.parent).mkdir(parents=True)
    match kind:
        case "symbolic link":
            place.symlink_to(victim)
        case "dangling link":
            place.symlink_to(tmp_path / "made by the lock")
        case "hard link":
            os.link(victim, place)
        case "pipe":
            os.mkfifo(place)
        case _:
            (tmp_path / "elsewhere").mkdir()
            place.parent.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(SessionError) as refusal:
        take_lock(data, ADDRESS)
    (problem,) = refusal.value.problems
    assert (problem.code, problem.value) == ("lock.unwritable", NOT_REGULAR if kind == "pipe" else FOREIGN)
    assert victim.read_text(encoding="ascii") == "what matters\n"
    assert not (tmp_path / "made by the lock").exists()
    assert not (tmp_path / "elsewhere").exists() or list((tmp_path / "elsewhere").iterdir()) == []
