"""A `console simulator` of its own, as other programs meet it: a real process with real sockets."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

import pytest

from tests.preloaded import Preloaded

ANYWHERE = "127.0.0.1:0"
LISTENERS = ("--tcp", "--ethernet", "--pty", "--control")
END_TIMEOUT_S = 10.0


@dataclass(frozen=True, kw_only=True)
class Served:
    """The process, and what it said of each of its listeners."""

    process: subprocess.Popen[str]
    said: tuple[dict[str, object], ...]

    @property
    def device(self) -> str:
        return self._where("serial")

    @property
    def tcp(self) -> tuple[str, int]:
        return self._socket("tcp")

    @property
    def ethernet(self) -> tuple[str, int]:
        return self._socket("ethernet")

    @property
    def control(self) -> str:
        return self._where("control")

    def end(self, number: int = signal.SIGTERM) -> tuple[int, str, str]:
        """Send a signal; return the exit code and what was said since."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=END_TIMEOUT_S)
        return self.process.returncode, out, err

    def _socket(self, kind: str) -> tuple[str, int]:
        host, _, port = self._where(kind).rpartition(":")
        return host, int(port)

    def _where(self, kind: str) -> str:
        return next(at for at in self._addresses if at.startswith(f"{kind}:")).removeprefix(f"{kind}:")

    @property
    def _addresses(self) -> list[str]:
        return [str(line["listening"]) for line in self.said]


Serve = Callable[..., AbstractContextManager[Served]]


@contextmanager
def _served(*options: str) -> Iterator[Served]:
    with Preloaded(
        [sys.executable, "-m", "console", "simulator", *options, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        listeners = sum(option in LISTENERS for option in options)
        try:
            said = tuple(json.loads(process.stdout.readline()) for _ in range(listeners))
            yield Served(process=process, said=said)
        finally:
            if process.poll() is None:
                process.kill()


@pytest.fixture(scope="session")
def serve() -> Serve:
    """Start a simulator with these options; it is gone at the end of the block."""
    return _served
