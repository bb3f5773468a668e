"""A real terminal: a program in a pseudo-terminal of its own, its screen read back as text and cells.

For what no test inside one process can show: signals, closed windows, lines that stall, what really stands on
the screen. Nothing here sleeps; every wait is for a condition and has an end.
"""

from __future__ import annotations

import array
import contextlib
import fcntl
import os
import re
import select
import signal
import termios
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from tests.preloaded import is_preloaded, start
from tests.terminal_screen import Cell, Emulation

KEYS = {
    "space": " ",
    "enter": "\r",
    "tab": "\t",
    "shift+tab": "\x1b[Z",
    "escape": "\x1b",
    "backspace": "\x7f",
    "up": "\x1b[A",
    "down": "\x1b[B",
    "right": "\x1b[C",
    "left": "\x1b[D",
    "home": "\x1b[H",
    "end": "\x1b[F",
    "insert": "\x1b[2~",
    "delete": "\x1b[3~",
    "pageup": "\x1b[5~",
    "pagedown": "\x1b[6~",
    **{f"f{n}": f"\x1bO{letter}" for n, letter in enumerate("PQRS", start=1)},
    **{f"f{n}": f"\x1b[{code}~" for n, code in enumerate((15, 17, 18, 19, 20, 21, 23, 24), start=5)},
    **{f"ctrl+{chr(96 + n)}": chr(n) for n in range(1, 27)},
}

# What another terminal, another test or a developer's shell would bring along.
FOREIGN = re.compile(
    r"NO_COLOR|FORCE_COLOR|LANGUAGE|LC_\w+|LINES|COLUMNS|TMUX\w*|TERM_PROGRAM\w*|SSH_\w+|TEXTUAL\w*|ESCDELAY"
)
DEFAULT_SIGNALS = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGPIPE, signal.SIGWINCH)

# Yes: frames are drawn whole.
FRAME_ANSWER = b"\x1b[?2026;2$y"


@dataclass(frozen=True, slots=True)
class _Process:
    """A process that cannot be mistaken for a later one with the same number."""

    pid: int
    started_ticks: int


class Terminal:
    """A program in a terminal. Use it as a context manager: whatever the program started ends with it.

    Args:
        command: the program and its arguments; a relative name is searched in PATH.
        columns: width, cells.
        rows: height, cells.
        environment: added to the inherited one, from which everything is taken that would change the picture.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        columns: int = 80,
        rows: int = 24,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.bytes_seen = 0
        self._changed = threading.Condition()
        self._emulation = Emulation(columns, rows)
        self._stalled = self._hung_up = self._exited = self._ended = False
        self._exit_code: int | None = None
        self._line_holds: bytes | None = None
        self._relatives: set[_Process] = set()
        self._master, slave = os.openpty()
        self._wake_out, self._wake_in = os.pipe()
        termios.tcsetwinsize(self._master, (rows, columns))
        self.started_s = self._read_s = time.perf_counter()
        self._line = os.ttyname(slave)
        changed = {**_clean_environment(), **(environment or {})}
        preloaded = is_preloaded(command) and not environment
        self.pid = (
            start(command, changed, terminal=self._line) if preloaded else _spawn(command, self._line, changed)
        )
        os.close(slave)
        self._reader = threading.Thread(target=self._read, name="terminal", daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def text(self) -> str:
        """The screen, rows without the blanks at their ends."""
        with self._changed:
            return "\n".join(self._emulation.rows())

    def row(self, n: int) -> str:
        """Row n from the top, from 0; -1 is the last."""
        with self._changed:
            return self._emulation.rows()[n]

    def cells(self) -> list[list[Cell]]:
        """The screen with its colours: rows of cells."""
        with self._changed:
            return self._emulation.cells()

    def press(self, *keys: str) -> None:
        """Press keys by name (`KEYS`) or by their one character.

        An escape must be the last: what follows at once would be read as one sequence with it.

        Raises:
            ValueError: no such key.
        """
        if "escape" in keys[:-1]:
            raise ValueError("wait for the screen after an escape")
        unknown = [key for key in keys if key not in KEYS and len(key) != 1]
        if unknown:
            raise ValueError(f"no such key: {unknown}")
        self.type("".join(KEYS.get(key, key) for key in keys))

    def type(self, text: str) -> None:
        """Send text as it is."""
        with self._changed:
            assert self._master >= 0, self._report("the terminal is closed")
            self._send(text.encode())

    def hold(self) -> None:
        """Deliver nothing any more of what is typed and answered, like a line that stands still."""
        with self._changed:
            self._line_holds = b""

    def let_go(self) -> None:
        """Deliver everything that was held, in its order, at once."""
        with self._changed:
            held, self._line_holds = self._line_holds, None
            os.write(self._master, held or b"")

    def _send(self, data: bytes) -> None:
        if self._line_holds is None:
            os.write(self._master, data)
        else:
            self._line_holds += data

    def wait_until_read(self, timeout_s: float) -> bool:
        """Wait until the program has read all that was typed; return whether there was anything to wait for."""
        deadline_s = time.monotonic() + timeout_s
        waited = False
        while self._unread() and time.monotonic() < deadline_s:
            time.sleep(0.005)
            waited = True
        return waited

    def _unread(self) -> int:
        """Bytes that wait in the terminal for the program, 0 if there is no terminal any more."""
        count = array.array("i", [0])
        try:
            line = os.open(self._line, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            return 0
        try:
            fcntl.ioctl(line, termios.FIONREAD, count)
        except OSError:
            return 0
        finally:
            os.close(line)
        return count[0]

    def wait_for(self, target: str | Callable[[str], bool], timeout_s: float = 10.0) -> float:
        """Wait until a regular expression is found on the screen, or a predicate of its text holds.

        Returns:
            When the bytes arrived that made it so, s after the program was started.

        Raises:
            AssertionError: it did not come in time or the program ended before; with the screen.
        """
        holds = target if callable(target) else lambda text: bool(re.search(target, text, re.MULTILINE))
        held = False

        def is_over() -> bool:
            nonlocal held
            held = holds(self.text)  # once: what a predicate sees beside the screen may be gone again
            return held or self._ended

        with self._changed:
            self._changed.wait_for(is_over, timeout_s)
            if not held:
                why = "the program ended" if self._ended else f"{timeout_s:g} s are over"
                raise AssertionError(self._report(f"{why}, not on the screen: {target}"))
            return self._read_s - self.started_s

    def resize(self, columns: int, rows: int) -> None:
        """Give the window another size."""
        with self._changed:
            self._emulation.resize(columns, rows)
            termios.tcsetwinsize(self._master, (rows, columns))

    def stall(self) -> None:
        """Read nothing any more, like a network that swallows everything; the program may come to block."""
        with self._changed:
            self._stalled = True

    def resume(self) -> None:
        """Read on."""
        with self._changed:
            self._stalled = False
        self._wake()

    def hang_up(self) -> None:
        """Close the window."""
        self._remember_relatives()
        self._hung_up = True
        self._wake()
        self._reader.join()

    def signal(self, number: int) -> None:
        """Send a signal to the program alone."""
        self._remember_relatives()
        if self._exit_code is None:
            os.kill(self.pid, number)

    def wait_exit(self, timeout_s: float = 10.0) -> int:
        """Wait until the program has ended and its last output is on the screen (unless the line is stalled).

        Returns:
            The exit code; minus the signal that ended it.

        Raises:
            AssertionError: it still runs; with the screen.
        """
        self._remember_relatives()
        if self._exit_code is None:
            if not _gone(self.pid, timeout_s):
                raise AssertionError(self._report(f"still running after {timeout_s:g} s"))
            self._exit_code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
            self._exited = True
            self._wake()
        with self._changed:
            self._changed.wait_for(lambda: self._ended or self._stalled, timeout_s)
        return self._exit_code

    def children(self) -> list[int]:
        """The processes that the program started and that still run, theirs too, in order of number."""
        self._remember_relatives()
        return sorted(process.pid for process in self._relatives)

    def wait_alone(self, timeout_s: float = 10.0) -> None:
        """Wait until no process is left that the program started.

        Raises:
            AssertionError: some still run.
        """
        end_s = time.monotonic() + timeout_s
        for pid in self.children():
            if not _gone(pid, max(0.0, end_s - time.monotonic())):
                raise AssertionError(self._report(f"still running: {pid} {_command_line(pid)}"))

    def close(self) -> None:
        """Close the window and end the program and everything that it started, at once."""
        if self._wake_in < 0:
            return
        self.signal(signal.SIGKILL)
        for pid in self.children():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.hang_up()
        self.wait_exit()
        self.wait_alone()
        os.close(self._wake_in)
        os.close(self._wake_out)
        self._wake_in = -1

    def _read(self) -> None:
        while not self._hung_up and self._read_once():
            pass
        with self._changed:
            os.close(self._master)
            self._master = -1
            self._emulation.feed(b"", last=True)
            self._ended = True
            self._changed.notify_all()

    def _read_once(self) -> bool:
        watched = [self._wake_out] if self._stalled else [self._wake_out, self._master]
        # When its leader ends, a session loses the terminal: nothing comes after what is there.
        last = self._exited and not self._stalled
        readable, _, _ = select.select(watched, [], [], 0 if last else None)
        if self._wake_out in readable:
            os.read(self._wake_out, 1024)
        with self._changed:
            if self._stalled or self._hung_up:
                return True
            if self._master not in readable:
                return not last
            try:
                data = os.read(self._master, 65536)
            except OSError:  # Nobody is at the other end any more.
                return False
            self._read_s = time.perf_counter()
            self.bytes_seen += len(data)
            if self._emulation.feed(data):
                self._send(FRAME_ANSWER)
            reports, self._emulation.reports = self._emulation.reports, b""
            if answer := reports + self._answer(data):
                self._send(answer)
            self._changed.notify_all()
        return True

    def _answer(self, data: bytes) -> bytes:
        """Return what a terminal of a certain kind answers to what it is told."""
        return b""

    def _wake(self) -> None:
        os.write(self._wake_in, b".")

    def _remember_relatives(self) -> None:
        """Learn who runs now; a process that has lost its parent is known only from before."""
        running = _processes()
        family = {self.pid}
        grown = True
        while grown:
            new = {p.pid for p, (parent, session) in running.items() if parent in family or session == self.pid}
            grown = not new <= family
            family |= new
        known = self._relatives & running.keys()
        self._relatives = known | {p for p in running if p.pid in family and p.pid != self.pid}

    def _report(self, what: str) -> str:
        with self._changed:
            rows = "\n".join(self._emulation.rows()).rstrip().split("\n")
        rule = "-" * max(40, *(len(row) for row in rows))
        return "\n".join((what, rule, *rows, rule))


def _clean_environment() -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not FOREIGN.fullmatch(name)}
    return kept | {"TERM": "xterm-256color", "COLORTERM": "truecolor", "LANG": "C.UTF-8"}


def _spawn(command: Sequence[str], terminal: str, environment: Mapping[str, str]) -> int:
    """Start a session; the first terminal that a session's leader opens becomes its controlling terminal."""
    return os.posix_spawnp(
        command[0],
        list(command),
        environment,
        setsid=True,
        setsigdef=DEFAULT_SIGNALS,
        file_actions=[
            (os.POSIX_SPAWN_OPEN, 0, terminal, os.O_RDWR, 0),
            (os.POSIX_SPAWN_DUP2, 0, 1),
            (os.POSIX_SPAWN_DUP2, 0, 2),
        ],
    )


def _gone(pid: int, timeout_s: float) -> bool:
    """Wait for the end of any process, not only of a child."""
    try:
        handle = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([handle], [], [], timeout_s)[0])
    finally:
        os.close(handle)


def _processes() -> dict[_Process, tuple[int, int]]:
    """Every running process with its parent and its session."""
    found = {}
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError, NotADirectoryError):
            if entry.name.isdecimal():
                # The name in brackets may contain anything.
                fields = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
                if fields[0] not in "ZX":
                    process = _Process(int(entry.name), int(fields[19]))
                    found[process] = (int(fields[1]), int(fields[3]))
    return found


def _command_line(pid: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    return ""


FLAGS = re.compile(rb"\x1b\[([<>=?])(\d*)(?:;(\d+))?u")
UNFINISHED = re.compile(rb"\x1b(?:\[[<>=?]?[\d;]*)?\Z")


class KittyTerminal(Terminal):
    """`flags`: the stack, the lowest being those of the shell that the program was started from."""

    flags: tuple[int, ...] = (0,)
    _rest = b""

    def _answer(self, data: bytes) -> bytes:
        data = self._rest + data
        tail = UNFINISHED.search(data)
        self._rest = b"" if tail is None else tail[0]
        answers = b""
        for kind, number, _ in FLAGS.findall(data[: len(data) - len(self._rest)]):
            match kind.decode():
                case "?":
                    answers += b"\x1b[?%du" % self.flags[-1]
                case ">":
                    self.flags = (*self.flags, int(number or 0))
                case "<":
                    self.flags = self.flags[: -int(number or 1)] or (0,)
                case _:
                    self.flags = (*self.flags[:-1], int(number or 0))
        return answers
