"""Run tests side by side: `-n 6` copies this process (fork) when it has collected, and each copy takes tests.

To import everything and to collect takes seconds, which other workers would each need again. What is next is a
number in a pipe: whoever is free takes it, so that nobody waits for a test behind a long one.
"""

from __future__ import annotations

import os
import pickle
import selectors
import signal
import struct
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fcntl import F_SETPIPE_SZ, fcntl
from pathlib import Path
from typing import Any, NoReturn

import pytest
from _pytest.config import create_terminal_writer
from _pytest.nodes import Node
from _pytest.pathlib import import_path

NUMBER = struct.Struct("=i")
PIPE_BYTES = 1 << 20
"""Room for the numbers of all tests, and for what a worker says while nobody listens."""


def add_option(parser: pytest.Parser) -> None:
    group = parser.getgroup("side by side")
    group._addoption("-n", dest="workers", type=int, default=0, help="run the tests in so many processes")


def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Run the tests in copies of this process, where they are asked for."""
    workers, config = session.config.getoption("workers"), session.config
    if not workers or not session.items or config.option.collectonly or config.option.usepdb:
        return None
    if session.testsfailed and not config.option.continue_on_collection_errors:
        return None  # the usual loop says so
    config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
    Workers(session, min(workers, len(session.items))).run()
    return True


def pytest_collectstart(collector: pytest.Collector) -> None:
    """In a new clone, let another process compile the tests from the last one on while this one collects."""
    if not isinstance(collector, pytest.Session) or not collector.config.getoption("workers"):
        return
    files = sorted(path for folder in collector.config.args for path in Path(folder).rglob("test_*.py"))
    if len(files) < 2 or (files[-1].parent / "__pycache__").exists() or _fork():
        return
    for path in reversed(files):
        with suppress(BaseException):
            import_path(path, mode="importlib", root=collector.config.rootpath, consider_namespace_packages=False)
    os._exit(0)


def _fork() -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # from Python 3.12 on, for threads of numpy
        return os.fork()


@dataclass
class _Worker:
    """What the first process knows of a worker: where it speaks, what it has said, and the test that it is at."""

    pid: int
    says: int
    data: bytearray = field(default_factory=bytearray)
    test: int | None = None

    def messages(self) -> Iterator[Any]:
        """Return what is complete of what it has said."""
        while len(self.data) >= NUMBER.size:
            end = NUMBER.size + NUMBER.unpack_from(self.data)[0]
            if len(self.data) < end:
                return
            yield pickle.loads(self.data[NUMBER.size : end])
            del self.data[:end]


class Workers:
    """Copies of this process that run the tests of a session, whose reports are told here."""

    def __init__(self, session: pytest.Session, count: int) -> None:
        self._session = session
        self._left = {number: item.nodeid for number, item in enumerate(session.items)}
        units = _units(session.items)
        self._tokens, write = os.pipe()
        fcntl(write, F_SETPIPE_SZ, PIPE_BYTES)
        os.write(write, b"".join(NUMBER.pack(number) for number in range(len(units))))
        os.close(write)
        self._workers: list[_Worker] = []
        for place in range(count):
            self._start(place, units)

    def run(self) -> None:
        """Tell of all tests, or of those up to the failure after which no more are wanted."""
        try:
            self._listen()
        finally:
            for worker in self._workers:
                os.kill(worker.pid, signal.SIGKILL)
                os.waitpid(worker.pid, 0)
        if self._session.shouldfail:
            raise self._session.Failed(self._session.shouldfail)
        if self._session.shouldstop:
            raise self._session.Interrupted(self._session.shouldstop)
        for nodeid in self._left.values():
            self._fail(nodeid, "not run: there was no process left to run it")

    def _start(self, place: int, units: Sequence[Sequence[int]]) -> None:
        hears, says = os.pipe()
        fcntl(says, F_SETPIPE_SZ, PIPE_BYTES)
        sys.stdout.flush()
        sys.stderr.flush()
        pid = _fork()
        if not pid:
            for other in (hears, *(worker.says for worker in self._workers)):
                os.close(other)
            _work(self._session, place, units, self._tokens, says)
        os.close(says)
        self._workers.append(_Worker(pid, hears))

    def _listen(self) -> None:
        with selectors.DefaultSelector() as selector:
            for worker in self._workers:
                selector.register(worker.says, selectors.EVENT_READ, worker)
            while selector.get_map():
                for key, _ in selector.select():
                    data = os.read(key.fd, PIPE_BYTES)
                    key.data.data += data
                    for message in key.data.messages():
                        self._take(key.data, message)
                    if not data:
                        selector.unregister(key.fd)
                        self._end(key.data)

    def _take(self, worker: _Worker, message: Any) -> None:
        """Tell of a test what its worker says: that it begins, or its reports."""
        number, reports = message
        if reports is None:
            worker.test = number
            return
        worker.test = None
        nodeid, hook = self._left.pop(number), self._session.config.hook
        for report in reports:
            hook.pytest_runtest_logreport(
                report=hook.pytest_report_from_serializable(config=self._session.config, data=report)
            )
        hook.pytest_runtest_logfinish(nodeid=nodeid, location=self._session.items[number].location)
        if self._session.shouldfail or self._session.shouldstop:
            os.read(self._tokens, PIPE_BYTES)  # nobody takes another

    def _end(self, worker: _Worker) -> None:
        """A worker has ended: it has nothing left to do, or its test has ended it."""
        self._workers.remove(worker)
        os.close(worker.says)
        _, status = os.waitpid(worker.pid, 0)
        if worker.test is not None:
            self._fail(self._left.pop(worker.test), f"the test has ended its process, with status {status}")

    def _fail(self, nodeid: str, why: str) -> None:
        place = (nodeid.partition("::")[0], None, nodeid)
        report = pytest.TestReport(nodeid, place, {}, "failed", why, "call")
        self._session.config.hook.pytest_runtest_logreport(report=report)


def _units(items: Sequence[pytest.Item]) -> list[list[int]]:
    """Return the tests that are run one after another by the same worker: what a fixture of their file makes is
    made once."""
    units: list[list[int]] = []
    by_file: dict[object, list[int]] = {}
    for number, item in enumerate(items):
        if not shares(item):
            units.append([number])
        elif item.path in by_file:
            by_file[item.path].append(number)
        else:
            units.append(by_file.setdefault(item.path, [number]))
    return units


def shares(item: pytest.Item) -> bool:
    """Whether a test uses something that lives as long as its file."""
    info = getattr(item, "_fixtureinfo", None)
    return info is not None and any(found[-1].scope == "module" for found in info.name2fixturedefs.values())


class _Next:
    """The next test of a worker, taken when the one before is torn down: so long, anybody may take it."""

    def __init__(self, session: pytest.Session, queue: Iterator[int]) -> None:
        self._session, self._queue = session, queue
        self.number: int | None = None

    def listchain(self) -> list[Node]:
        """What of the session, file and so on the next test needs as well."""
        self.number = next(self._queue, None)
        return [] if self.number is None else self._session.items[self.number].listchain()


class _Recorder:
    """Keeps the reports of a test, in a worker, in place of what shows them."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._tw = create_terminal_writer(config, open(os.devnull, "w"))
        self.reports: list[Any] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.reports.append(
            self._config.hook.pytest_report_to_serializable(config=self._config, report=report),
        )


def _work(session: pytest.Session, place: int, units: Sequence[Sequence[int]], tokens: int, says: int) -> NoReturn:
    """Be a worker: run tests as long as there are any."""

    def queue() -> Iterator[int]:
        while token := os.read(tokens, NUMBER.size):
            yield from units[NUMBER.unpack(token)[0]]

    def say(number: int, reports: list[Any] | None) -> None:
        data = pickle.dumps((number, reports))
        stream.write(NUMBER.pack(len(data)) + data)

    try:
        recorder = _of_its_own(session.config, place)
        numbers = queue()
        number = next(numbers, None)
        with open(says, "wb", buffering=0) as stream:
            while number is not None:
                say(number, None)
                following = _Next(session, numbers)
                item = session.items[number]
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                say(number, recorder.reports)
                recorder.reports.clear()
                number = following.number
    except BaseException:
        os.write(2, traceback.format_exc().encode())
    finally:
        os._exit(0)


def _of_its_own(config: pytest.Config, place: int) -> _Recorder:
    """Give a worker what it must not share with the others: output, folders and the telling of results."""
    plugins = config.pluginmanager
    for name in ("terminalreporter", "lfplugin"):
        plugins.unregister(name=name)
    capture = plugins.getplugin("capturemanager")
    capture.stop_global_capturing()
    capture.start_global_capturing()
    capture.suspend_global_capture()
    folders = config._tmp_path_factory  # type: ignore[attr-defined]
    folders._basetemp = folders.getbasetemp() / f"of-{place}"
    folders._basetemp.mkdir(mode=0o700)
    recorder = _Recorder(config)
    plugins.register(recorder, "terminalreporter")
    return recorder
