"""A fault as a line of text: `NAME [KEY=VALUE ...]`, such as `late-reply after=1.5 for=0.2 delay_ms=300`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from drivers.simulator.faults.board import FaultBoard, Injected
from drivers.simulator.faults.catalogue import Value, find, refusal


def inject_words(board: FaultBoard, name: str, settings: Sequence[str]) -> Injected:
    """Inject a fault by its name, with settings `KEY=VALUE`. Raises RefusedError: `simulator.fault`."""
    return board.ask(name, given_in(name, settings))


def given_in(name: str, settings: Sequence[str]) -> dict[str, Value]:
    """Return the values of settings. Raises RefusedError: `simulator.fault`, no such fault; one is no setting."""
    find(name)
    given: dict[str, Value] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key or key in given:
            raise refusal(name, "setting", ascii(setting)[1:-1], "KEY=VALUE, each key once")
        given[key] = value
    return given


def check_line(line: str) -> None:
    """Check a line without injecting anything. Raises RefusedError: `simulator.fault`, it is no fault."""
    words = words_of(line)
    given, fault = given_in(words[0], words[1:]), find(words[0])
    times = {time.name: time for time in fault.times}
    fault.settle({key: value for key, value in given.items() if key not in times}, times)
    for key in given.keys() & times.keys():
        times[key].check(given[key], fault.name)


def words_of(line: str) -> list[str]:
    """Return the words of a line, at least one. Raises RefusedError: `simulator.fault`."""
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise refusal("", "command", ascii(f"{line} ({error})")[1:-1][:80], "NAME [KEY=VALUE ...]") from error
    if not words:
        raise refusal("", "command", "", "NAME [KEY=VALUE ...]")
    return words
