"""A checkpoint of the simulated lathe: a copy of its process that stands still, and of which further copies go on.

A copy (fork) has everything as it was, to the bit: controller, plant, part, faults, the state of chance. The
frozen one only waits. It ends when the one who could ask for a copy is gone.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import traceback
import warnings
from collections.abc import Callable
from typing import NoReturn

from drivers.ending_signals import ENDING_SIGNALS

ASKED = b"!"  # asks a frozen copy for one that goes on; it comes back with the end of a channel to that one
_FIRST = 3  # number of the first file that is none of the standard streams

GoOn = Callable[[socket.socket], None]
"""What a copy does with its channel, until it ends."""


def freeze(go_on: GoOn) -> socket.socket:
    """Set a checkpoint: return the line to a frozen copy of this process, as it is now. Raises OSError."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for copies that have ended
    ours, theirs = socket.socketpair()
    try:
        if not _fork():
            _wait(theirs, go_on)
    except OSError:
        ours.close()
        raise
    finally:
        theirs.close()
    return ours


def _wait(line: socket.socket, go_on: GoOn) -> NoReturn:
    """Be the frozen copy: nothing of the original but its memory is used any more, or unwound."""
    try:
        _let_go_of_files(line)
        signal.set_wakeup_fd(-1)
        for number in ENDING_SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as under `nohup`
                signal.signal(number, signal.SIG_DFL)
        while line.recv(1) == ASKED:
            channel, far = socket.socketpair()
            if not _fork():
                _let_go_of_files(channel)
                go_on(channel)
                break
            channel.close()
            socket.send_fds(line, [ASKED], [far.fileno()])
            far.close()
    except OSError:
        pass  # whoever could ask is gone
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(0)


def _let_go_of_files(kept: socket.socket) -> None:
    """Point every open file at nothing but this one; their numbers stay taken: objects that are left have them."""
    nothing = os.open(os.devnull, os.O_RDWR)
    for name in os.listdir("/proc/self/fd"):
        number = int(name)
        if number >= _FIRST and number not in (kept.fileno(), nothing) and _is_open(number):
            os.dup2(nothing, number, inheritable=False)


def _is_open(number: int) -> bool:
    """Whether it is still open: the list of open files was one itself."""
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def _fork() -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads that only numerics have
        return os.fork()
