"""Signals that ask this process to end: which came, and what a command does that has no machine to stop.

A process has one disposition for each signal, and so this module has one value.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from console.session.errors import Interrupted
from drivers.ending_signals import ENDING_SIGNALS

_UNHANDLED = (signal.SIG_DFL, signal.default_int_handler)

_came: str | None = None


def has_come(number: int) -> str:
    """Keep a signal that asks this process to end, the first one; return the name of this one."""
    global _came
    name = signal.Signals(number).name
    _came = _came or name
    return name


def that_came() -> str | None:
    """Return the name of the signal that asked this process to end, None: no signal has."""
    return _came


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Raise Interrupted on a signal, unless the command installs handlers of its own.

    A signal that is ignored, as under `nohup`, stays ignored. Python handles signals in its main thread only.
    """
    global _came
    _came = None
    ours = [
        (number, before)
        for number in ENDING_SIGNALS
        if threading.current_thread() is threading.main_thread()
        and (before := signal.getsignal(number)) in _UNHANDLED
    ]
    for number, _ in ours:
        signal.signal(number, _raise)
    try:
        yield
    finally:
        for number, before in ours:
            if signal.getsignal(number) is _raise:
                signal.signal(number, before)


@contextmanager
def held_back() -> Iterator[None]:
    """Hold back signals that ask this process to end, for what takes no time and has to be whole.

    It holds in this thread and in those that it starts. Python handles a signal that another thread takes, too.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _raise(number: int, _: FrameType | None) -> None:
    """Raise Interrupted for the first signal and for every SIGINT: a terminal that closes sends several."""
    is_first = that_came() is None
    name = has_come(number)
    if is_first or number == signal.SIGINT:
        raise Interrupted(name)
