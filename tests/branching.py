"""A run that is made up to a point once, and goes on from there as often as is asked, each time in another way.

The way to the point is the same for all: it is made in a process of its own, which waits there. Each continuation
is a copy of that process (fork), so that nothing of one can reach another: what it changes is gone with it.
"""

from __future__ import annotations

import os
import pickle
import traceback
import warnings
from collections.abc import Callable
from typing import Any, Generic, NoReturn, TypeVar

LENGTH_BYTES = 8


Asked = TypeVar("Asked")
Returned = TypeVar("Returned")


class Branching(Generic[Asked, Returned]):
    """`run` is called in a process of its own with a function that waits, at the point, for what is asked.

    The process ends with the one that has made it.
    """

    def __init__(self, run: Callable[[Callable[[], Asked]], Returned]) -> None:
        asked, self._ask = os.pipe()
        self._answer, answered = os.pipe()
        if _fork():
            os.close(asked)
            os.close(answered)
            return
        os.close(self._ask)
        os.close(self._answer)
        _run(run, asked, answered)

    def __call__(self, asked: Asked) -> Returned:
        """Go on from the point with what is asked; return what the run returns there.

        Raises AssertionError: the run has raised something, with all of it.
        """
        _write(self._ask, asked)
        returned, failed = _read(self._answer)
        assert failed is None, failed
        return returned  # type: ignore[no-any-return]


def in_a_copy(act: Callable[[], None]) -> None:
    """Do something in a copy of this process, so that all is as before.

    Raises AssertionError: it has raised something, with all of it.
    """
    answer, answered = os.pipe()
    copy = _fork()
    if not copy:
        _answer(act, answered)
    os.close(answered)
    _, failed = _read(answer)
    os.close(answer)
    os.waitpid(copy, 0)
    assert failed is None, failed


def _run(run: Callable[[Callable[[], Any]], Any], asked: int, answered: int) -> NoReturn:
    """Run to the point, and go on from there in a copy for each thing that is asked."""

    def wait() -> Any:
        while True:
            question = _read(asked)
            copy = _fork()
            if not copy:
                return question
            os.waitpid(copy, 0)

    _answer(lambda: run(wait), answered)


def _answer(act: Callable[[], Any], answered: int) -> NoReturn:
    """Say what comes of it, and end this process: it is a copy, and nothing else of it may go on."""
    said: tuple[Any, str | None]
    try:
        try:
            said = act(), None
        except BaseException:
            said = None, traceback.format_exc()
        _write(answered, said)
    finally:
        os._exit(0)


def _fork() -> int:
    """Copy this process with the one thread that calls: the others of a worker only carry what it says."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # from Python 3.12 on, where there are other threads
        return os.fork()


def _write(pipe: int, value: object) -> None:
    data = pickle.dumps(value)
    with open(pipe, "wb", closefd=False) as stream:
        stream.write(len(data).to_bytes(LENGTH_BYTES, "big") + data)


def _read(pipe: int) -> Any:
    """Return the next value; raise EOFError where nobody is left to say anything."""
    with open(pipe, "rb", buffering=0, closefd=False) as stream:
        length = int.from_bytes(_exactly(stream, LENGTH_BYTES), "big")
        return pickle.loads(_exactly(stream, length))


def _exactly(stream: Any, count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = stream.read(count - len(data))
        if not more:
            raise EOFError
        data += more
    return data
