"""The workers of a study: processes of this computer, or a Dask cluster, used alike."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from typing import Any

from console.session.errors import SessionError, require_extra
from drivers.ending_signals import ENDING_SIGNALS
from profiles.files import printable
from profiles.problem import Problem

CONNECT_S = 10
ENDED_S = 5.0
PR_SET_PDEATHSIG = 1


@dataclass(frozen=True, slots=True)
class Workers:
    """An executor, and how many cells are made at once."""

    executor: Executor
    count: int


@contextmanager
def processes(count: int) -> Iterator[Workers]:
    """Yield processes of this computer. They end with this one, however it ends."""
    # Each process has a core; more threads in each would only disturb the others. Read when numpy is imported.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    before = active_children()
    pool = ProcessPoolExecutor(
        count, mp_context=get_context("spawn"), initializer=_ends_with, initargs=(os.getpid(),)
    )
    try:
        yield Workers(pool, count)
    finally:
        begun = [each for each in active_children() if each not in before]
        pool.shutdown(wait=False, cancel_futures=True)
        for process in begun:  # a cell takes seconds, and whoever pressed Ctrl-C does not wait for it
            process.terminate()
            process.join(ENDED_S)


def _ends_with(parent: int) -> None:
    """End this process with its parent, and leave Ctrl-C to that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING_SIGNALS)  # held back while it began
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """Yield the workers of a Dask cluster.

    Raises SessionError: `extra.missing`; `study.no_scheduler`, nobody answers there; `study.no_workers`.
    """
    require_extra("distributed", "dask")
    import distributed

    where = printable(address)
    try:
        # Its annotations say less than it takes.
        connect: Any = distributed.Client
        client = connect(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, ImportError) as error:
        value = printable(" ".join(str(error).split()))
        raise SessionError(Problem(code="study.no_scheduler", where=where, value=value)) from error
    try:
        threads = sum(client.nthreads().values())
        if not threads:
            raise SessionError(Problem(code="study.no_workers", where=where))
        yield Workers(client.get_executor(pure=False), threads)
    finally:
        client.close(timeout=CONNECT_S)
