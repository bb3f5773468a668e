"""Start `python -m console ...` without its imports: half of what a program of a test costs is to import it.

A process of its own imports everything once and waits. Each program that is asked for is a copy of it (fork), with
the arguments, environment, folder and streams of its own: a real process with its real signals, as if it had been
started by the caller. What a start-up itself does is for tests that start the program by its name.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import traceback
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any, NoReturn

from tests.remembered import remember

PROGRAM, SIMULATOR = "console", "drivers.simulator"
PACKAGES = ("profiles", "drivers", "console")
STREAMS = {"stdin": "strict", "stdout": "strict", "stderr": "backslashreplace"}
MOST_BYTES, MOST_FILES = 100_000, 1024
PR_SET_CHILD_SUBREAPER, PR_SET_NAME = 36, 15
MOST_OF_A_NAME = 15  # characters that Linux keeps of the name of a process
DEFAULT_SIGNALS = (signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM, signal.SIGWINCH)


def is_preloaded(command: Sequence[str]) -> bool:
    """Whether a command is one that can be started so."""
    return list(command[:3]) == [sys.executable, "-m", PROGRAM]


def is_simulator(pid: int) -> bool:
    """Whether a process is a simulated lathe, however it was started."""
    folder = Path(f"/proc/{pid}")
    named = (folder / "comm").read_text(errors="replace").strip() == SIMULATOR[:MOST_OF_A_NAME]
    return named or SIMULATOR.encode() in (folder / "cmdline").read_bytes()


def start(
    command: Sequence[str],
    environment: Mapping[str, str],
    streams: Sequence[int] = (),
    *,
    terminal: str | None = None,
) -> int:
    """Start a program; return the number of its process, a child of this one.

    `streams` are its standard input, output and error. With `terminal` it leads a session there, and the streams
    are that terminal.
    """
    asked = {
        "words": list(command[2:]),
        "environment": dict(environment),
        "folder": os.getcwd(),
        "terminal": terminal,
    }
    line = _zygote()
    socket.send_fds(line, [json.dumps(asked).encode()], streams)
    return int(line.recv(100))


class Preloaded(subprocess.Popen[str]):
    """A `subprocess.Popen` that starts the program so."""

    def _execute_child(self, args: Any, *others: Any) -> None:
        """Override how the process begins; Popen makes and reads the pipes."""
        environment, pipes = others[5], others[9:15]
        streams = [own if own != -1 else place for place, own in enumerate((pipes[0], pipes[3], pipes[5]))]
        self.pid = start(args, os.environ if environment is None else environment, streams)
        self._child_created = True
        self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]


def completed(words: Sequence[str], timeout_s: float) -> subprocess.CompletedProcess[str]:
    """Run the console with these words to its end, with nothing to read."""
    command = [sys.executable, "-m", PROGRAM, *words]
    with Preloaded(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            out, err = process.communicate(timeout=timeout_s)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, out, err)


@cache
def _zygote() -> socket.socket:
    """Start the process that has everything imported; return the line to it. It ends with this one."""
    # A copy's parent ends at once, so that the copy becomes a child of this process, which can wait for it.
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.preloaded", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
    process.returncode = 0  # nobody waits for it: it ends when the line does
    return ours


def _serve(line: socket.socket) -> list[str] | None:
    """Make copies as long as they are asked for. Return, in a copy, its words; else None at the end.

    What depends only on what is asked is found out by one of all these processes (tests/remembered.py).
    """
    for package in PACKAGES:
        for module in walk_packages(import_module(package).__path__, f"{package}."):
            if module.name != f"{SIMULATOR}.__main__":
                import_module(module.name)
    remember()
    gc.collect()
    gc.freeze()
    while True:
        data, numbers, _, _ = socket.recv_fds(line, MOST_BYTES, 3)
        if not data:
            return None
        ready, begun = os.pipe()
        between = os.fork()
        if between == 0:
            if os.fork():
                os._exit(0)
            return _begin(json.loads(data), numbers, begun)
        for number in (*numbers, begun):
            os.close(number)
        os.waitpid(between, 0)  # from here on the copy is a child of who asked
        line.send(os.read(ready, MOST_BYTES))
        os.close(ready)


def _begin(asked: dict[str, Any], numbers: list[int], begun: int) -> list[str]:
    """Become the program that was asked for, and say so; return its words."""
    for each in DEFAULT_SIGNALS:
        signal.signal(each, signal.SIG_DFL)
    if asked["terminal"] is not None:
        os.setsid()
        # The first terminal that the leader of a session opens becomes its controlling terminal.
        numbers = [os.open(asked["terminal"], os.O_RDWR)] * 3
    for place, number in enumerate(numbers):
        os.dup2(number, place)
    os.write(begun, str(os.getpid()).encode())
    os.closerange(3, MOST_FILES)
    os.chdir(asked["folder"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    _open_streams()
    subprocess.Popen = _WithSimulator  # type: ignore[assignment, misc]
    return list(asked["words"])


def _open_streams() -> None:
    """Open the standard streams as Python does."""
    for place, (name, errors) in enumerate(STREAMS.items()):
        mode, lines = ("w", os.isatty(place)) if place else ("r", False)
        stream = open(place, mode, 1 if lines else -1, encoding="utf-8", errors=errors, closefd=False)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)


class _WithSimulator(subprocess.Popen[bytes]):
    """What the program starts its simulator with: a copy as well, and its own child."""

    def _execute_child(self, args: Any, *others: Any) -> None:
        if SIMULATOR not in args:
            super()._execute_child(args, *others)  # type: ignore[misc]
            return
        kept, pipes = others[3], others[9:15]
        self.pid = os.fork()
        if self.pid == 0:
            _simulate(args[args.index(SIMULATOR) :], (pipes[0], pipes[3], pipes[5]), kept)
        self._child_created = True
        self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]


def _simulate(words: list[str], streams: Sequence[int], kept: Sequence[int]) -> NoReturn:
    """Become the simulator, and end with it: nothing else of this copy goes on."""
    code = 1
    try:
        os.setsid()
        for place, number in enumerate(streams):
            os.dup2(number, place)
        for number in {*range(3, MOST_FILES)} - {*kept}:
            with suppress(OSError):
                os.close(number)
        for each in DEFAULT_SIGNALS:
            signal.signal(each, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _open_streams()
        ctypes.CDLL(None).prctl(PR_SET_NAME, SIMULATOR[:MOST_OF_A_NAME].encode(), 0, 0, 0)
        sys.argv = words
        runpy.run_module(words[0], run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        program = _serve(socket.socket(fileno=int(sys.argv[1])))
    if program is not None:
        sys.argv = program
        del sys.modules[f"{program[0]}.__main__"]  # it is run, not imported
        runpy.run_module(program[0], run_name="__main__", alter_sys=True)
