"""Targets of the state feed: what a reader gets, broken and forged, as far as each output that others read.

The oracle is that of each format, not ours: a line of `watch` is one printable line, a series of Prometheus comes
once and in its form, a payload of MQTT is JSON as RFC 8259 has it, a line of SHDR has no line end in it.
"""

from __future__ import annotations

import io
import json
import re
import socket
from argparse import Namespace
from collections.abc import Iterator
from contextlib import closing, contextmanager, redirect_stdout, suppress
from dataclasses import asdict, replace
from pathlib import Path
from random import Random
from typing import Any

from console.cli.feed.watch import _show, _show_end
from console.session.feed.feed_state import FeedState
from console.session.feed.following import ReceivedState, Stream
from console.session.feed.observed_state import ObservedState
from console.session.feed.report import line_of, report
from console.session.station.state import Activity
from console.site.cli.metrics import response
from console.site.exchange.mtconnect import PublishedState, is_news, messages, publish_state, shdr_lines
from console.text.catalogue import load
from profiles.store import load_machine
from tests.fuzz.target import FoundError, Target, Try

REQUEST = b"GET /metrics HTTP/1.1\r\nHost: localhost:9301\r\n\r\n"
LANGUAGES = load("en"), load("ko")
SAMPLE = re.compile(r'([a-z_]+(?:\{(?:[a-z_]+="(?:[^"\\\n]|\\["\\n])*",?)*\})?) ([-+]?[0-9][0-9.e+-]*)')
UTF_8_JSON = ("communications", "motion", "system", "state")

FORGED: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2, 1e308, -1e308, 2**31, 2**63, 10**400, -0.0, 1e-320, 400.0),
    *(
        "",
        "x",
        "x" * 5000,
        "cutting",
        "lost",
        "high",
        "new",
        "run",
        "9",
        "nan",
        "a\nb",
        "a\r\nb",
        "a|b",
        'a"b',
        "\\",
    ),
    *("\x1b[2J", "\x00", "\ud800", "\u202e", "가공", "2026-01-01T00:00:00Z", "0001-01-01T00:00:00Z"),
    *("2026-13-01T00:00:00Z", "9999-12-31T23:59:59-23:59", "2026-01-01", "2999-12-31T23:59:59.999999Z"),
    *([], [1], {}, {"number": 1}, [None], [[[]]], [{}] * 2000, float("nan"), float("inf")),
)
"""Values that a line of another program may have in any place."""


def sound_states() -> list[FeedState]:
    """Return states of consoles as they are published: in a cut, with alarms, without a link, observing."""
    from tests.tui import scenes

    alarms, log = scenes.alarmed()
    numbers = {(each.problem.code, each.problem.key): each.number for each in log.alarms.standing}
    machine = load_machine("lee-2001-lathe").machine
    cutting = replace(scenes.machine(Activity.CUTTING), cut=scenes.cut(), spindle_rpm=1000.3)
    held = replace(cutting, alarms=alarms)
    moments = [cutting, held, scenes.machine(Activity.READY), scenes.machine(Activity.LOST)]
    return [
        report(
            ObservedState(
                state=state, machine=machine, now_s=state.at_s, job="ring", run_id="ab12", numbers=numbers
            ),
            process=7,
            operator="kim",
            at_utc="2026-01-01T00:00:00.000Z",
        )
        for state in moments
    ]


def forged(line: bytes) -> bytes:
    """Return a line with some values replaced, removed or added, drawn from its bytes; a broken one as it is."""
    try:
        table = json.loads(line)
    except (ValueError, RecursionError):
        return line
    random, places = Random(line), [table]
    for each in places:
        inner = each.values() if isinstance(each, dict) else each if isinstance(each, list) else ()
        places += [value for value in inner if isinstance(value, dict | list) and value]
    for _ in range(random.randrange(3)):
        place = random.choice(places)
        keys = list(place) if isinstance(place, dict) else range(len(place)) if isinstance(place, list) else ()
        if not keys:
            continue
        key: Any = random.choice(list(keys))
        if random.random() < 0.1 and isinstance(place, dict):
            del place[key]
        else:
            place[key if random.random() < 0.95 or isinstance(place, list) else "more"] = random.choice(FORGED)
    return json.dumps(table).encode("ascii", "replace")


class Outputs:
    """Everything that is made of a feed, in one process."""

    def __init__(self) -> None:
        self.before: tuple[PublishedState, FeedState] | None = None

    def take(self, data: bytes) -> None:
        """Read lines as they are, and forged, and render each state. Raises ConnectionError: there is none."""
        line, _, rest = data.partition(b"\n")
        found = [self.read(data), self.read(forged(line) + b"\n" + rest)]
        if not any(found):
            raise ConnectionError

    def read(self, sent: bytes) -> bool:
        """Return whether there was a state."""
        told: list[str] = []
        states: list[FeedState] = []
        ours, theirs = socket.socketpair()
        with closing(ours), closing(theirs):
            stream = Stream(Path("feed"), ours, 1.0, lambda problem: told.append(str(problem)))
            theirs.sendall(sent)
            theirs.shutdown(socket.SHUT_WR)
            with suppress(ConnectionError):
                while True:
                    states += stream.take()
            stream.close()
        require(all(each.isprintable() for each in told) and len(told) <= 2, told)
        for state in states:
            self.render(state)
        return bool(states)

    def render(self, state: FeedState) -> None:
        """Render a state in each format."""
        before = self.before and self.before[1]
        for as_json, text in ((False, LANGUAGES[0]), (False, LANGUAGES[1]), (True, LANGUAGES[0])):
            watch(before, state, Namespace(json=as_json), text)
        now = publish_state(state, "")
        told = shdr_lines(now, self.before and self.before[0])
        require(all("\n" not in each and each.isprintable() for each in told), told)
        is_news(state, before)
        for key, payload in messages(now, state).items():
            require(key not in UTF_8_JSON or isinstance(strict(payload), dict), payload)
        self.before = now, state
        aged = ReceivedState(state=state, came_s=0.0).age_state(3.0)
        scrape(response(REQUEST, (), [aged, state], LANGUAGES[1]))


def watch(before: FeedState | None, state: FeedState, options: Namespace, text: Any) -> None:
    """Print what `watch` does."""
    out = io.StringIO()
    with redirect_stdout(out):
        _show(before, state, options, text)
        _show_end(state, options, text)
    lines = out.getvalue().split("\n")[:-1]
    known = () if before is None else before.alarms
    alarms = 0 if options.json else sum(each not in known for each in state.alarms)
    require(len(lines) == 2 + alarms and all(each.isprintable() for each in lines), lines)
    if options.json:
        require(all(isinstance(strict(each.encode()), dict) for each in lines), lines)


def scrape(answer: bytes) -> None:
    """Read an answer as Prometheus does."""
    head, _, body = answer.partition(b"\r\n\r\n")
    require(head.startswith(b"HTTP/1.1 200 OK\r\n") and b"Content-Length: %d\r\n" % len(body) in head, head)
    found = [SAMPLE.fullmatch(each) for each in body.decode().split("\n")[:-1] if not each.startswith("#")]
    require(all(each is not None for each in found), body)
    series = [each[1] for each in found if each is not None]
    require(len(set(series)) == len(series), series)


def strict(payload: bytes) -> Any:
    """Read JSON without the constants that Python adds to it."""

    def refuse(word: str) -> Any:
        raise FoundError(word)

    return json.loads(payload, parse_constant=refuse)


def require(good: bool, found: object) -> None:
    """Make sure of it."""
    if not good:
        raise FoundError(repr(found)[:1000])


@contextmanager
def outputs() -> Iterator[Try]:
    """All outputs, with what they keep of the state before."""
    yield Outputs().take


def _lines() -> list[bytes]:
    lines = [line_of(asdict(state)) for state in sound_states()]
    return [*lines, lines[0] + lines[1], b"{}\n" + lines[2], b'{"schema":1,"refused":"no"}\n' + lines[3]]


OF_FEED = (
    Target(
        name="feed-states",
        what="states of a feed, to each output",
        seeds=_lines,
        errors=(ConnectionError,),
        opened=outputs,
    ),
)
