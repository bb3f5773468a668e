"""Two accounts of one computer, for tests: copies of this process with another user number, in one group."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.branching import in_a_copy

A, B, STRANGER = 61001, 61002, 61003
GROUP = 61100
ROOT = Path(__file__).parents[2]

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="other accounts can only be taken by root")


@contextmanager
def lathe_folder() -> Iterator[Path]:
    """Yield the shared data folder of a lathe, which both accounts can reach."""
    if not ROOT.stat().st_mode & stat.S_IXOTH:
        pytest.skip("other accounts cannot read this checkout")
    place = Path(tempfile.mkdtemp(prefix="lathe-"))
    try:
        place.chmod(0o711)
        data = place / "trilobe"
        data.mkdir()
        os.chown(data, 0, GROUP)
        data.chmod(0o2770)
        yield data
    finally:
        shutil.rmtree(place)


def as_account(account: int, act: Callable[[], None], umask: int = 0o022) -> None:
    """Do something as an account; the stranger is not in the group. AssertionError with what it raises."""

    def acts() -> None:
        become(account, umask)
        act()

    in_a_copy(acts)


def become(account: int, umask: int) -> None:
    """Take the numbers of an account, for good."""
    os.setgroups([] if account == STRANGER else [GROUP])
    os.setgid(account)
    os.setuid(account)
    os.umask(umask)
