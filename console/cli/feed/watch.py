"""`console watch`: the state of running consoles, line after line."""

from __future__ import annotations

import json
import sys
import time
from argparse import Namespace
from collections.abc import Callable
from dataclasses import asdict
from datetime import datetime
from typing import TYPE_CHECKING

from console.cli.arguments import number, number_parser_within
from console.cli.library import data_of
from console.cli.output import tell
from console.cli.parser import Parser
from console.session.errors import SessionError
from console.session.feed.request import LEAST_HZ, MOST_HZ
from console.text.catalogue import Catalogue
from profiles.files import printable
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.session.feed.feed_state import FeedAlarm, FeedCut, FeedState
    from console.session.feed.following import Follower

    Seen = Callable[[FeedState | None, FeedState], None]

WAIT_S = 0.5  # for something new
SILENT_S = 5.0  # a console sends a line a second at the least


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, the rate, and whether only to list."""
    parser.add_argument("--machine", metavar="NAME", dest="watched", help=text("help.watch_machine"))
    rate = number_parser_within(number, LEAST_HZ, MOST_HZ, "usage.watch_rate", f"{LEAST_HZ:g} - {MOST_HZ:g}")
    parser.add_argument("--rate", metavar="HZ", type=rate, default=LEAST_HZ, help=text("help.watch_rate"))
    parser.add_argument("--list", action="store_true", dest="listing", help=text("help.watch_list"))


def main(options: Namespace, text: Catalogue) -> int:
    """Follow every console of the data folder, or of one machine, until all have ended or the user ends it."""

    def show(before: FeedState | None, state: FeedState) -> None:
        if before is None or not options.listing:
            _show(before, state, options, text)

    return follow(options, text, show, options.rate, once=options.listing)


def follow(options: Namespace, text: Catalogue, show: Seen, rate_hz: float, *, once: bool) -> int:
    """Show the states of every console of the data folder, or of one machine; with `once` what each sends first.

    Raises SessionError: no console runs, or none on this machine.
    """
    from console.session.feed.following import Follower

    machines: set[str] = set()

    def is_wanted(state: FeedState) -> bool:
        machines.add(state.machine)
        return options.watched in (None, state.machine)

    data = data_of(options)
    follower = Follower(data, rate_hz, is_wanted, lambda problem: tell([problem], text), show)
    try:
        if not follower.settle():
            none = Problem(code="feed.none", where=printable(str(data)))
            unknown = Problem(code="feed.unknown", value=options.watched, limit=", ".join(sorted(machines)))
            raise SessionError(unknown if machines else none)
        if not once:
            _follow(follower, options, text)
    except KeyboardInterrupt:  # the usual way to leave
        pass
    finally:
        follower.close()
    return 0


def _follow(follower: Follower, options: Namespace, text: Catalogue) -> None:
    """Let what comes be shown, and say when a console ends, or when none sends a state."""
    said_s = 0.0
    while before := dict(follower.newest):
        follower.wait(WAIT_S)
        for path in before.keys() - follower.newest.keys():
            _show_end(before[path].state, options, text)
        last_s = max(said_s, *(each.came_s for each in before.values()))
        if time.monotonic() - last_s >= SILENT_S:
            print(f"console: {text('watch.silent', seconds=f'{SILENT_S:g}')}", file=sys.stderr)
            said_s = time.monotonic()


def _show(before: FeedState | None, state: FeedState, options: Namespace, text: Catalogue) -> None:
    """Print a state: as it is, or a line, and one for each alarm that is new or has changed."""
    if options.json:
        print(json.dumps(asdict(state)))
        return
    known = () if before is None else before.alarms
    lines = [_alarm_line(state, alarm, text) for alarm in state.alarms if alarm not in known]
    print("\n".join([state_line(state, text), *lines]))


def _show_end(state: FeedState, options: Namespace, text: Catalogue) -> None:
    named = {"schema": state.schema, "machine": state.machine, "process": state.process}
    if options.json:
        print(json.dumps({**named, "ended": True}))
    else:
        print(f"{head(state, datetime.now(), text)}  {text('watch.ended')}")


def state_line(state: FeedState, text: Catalogue) -> str:
    """Return a state on one line."""
    said = [head(state, datetime.fromisoformat(state.at_utc).astimezone(), text)]
    said.append(text(f"activity.{state.activity}"))
    if state.stale:
        said.append(text("watch.stale"))
    said += [f"{name} {value}" for name, value in _positions(state, text)]
    cut = state.cut
    if cut is not None:
        said.append(_cut_shown(cut, state.tool_error_um, text))
    said.append(text("watch.parts", parts=state.parts))
    if state.job is not None:
        said.append(state.job)
    by = state.controlled_by
    said.append(text("watch.nobody") if by is None else text("watch.by", name=by.name or by.number or "?"))
    if state.alarms:
        said.append(text("watch.alarms", count=len(state.alarms)))
    return "  ".join(said)


def _cut_shown(cut: FeedCut, error_um: float | None, text: Catalogue) -> str:
    turns = f"{_number(cut.turn, 1)}/{_number(cut.turns, 1)}"
    return text("watch.cut", turns=turns, left=_number(cut.left_s, 0), error=_number(error_um, 1))


def _number(value: float | None, digits: int, unit: str = "") -> str:
    return "–" if value is None else f"{value:z.{digits}f}{unit}"


def head(state: FeedState, at: datetime, text: Catalogue) -> str:
    """Return when, at which machine and of which console something is said."""
    sim = f"{text('sim')}  " if state.simulated else ""
    return f"{at:%H:%M:%S}  {sim}{state.machine}@{state.process}"


def _positions(state: FeedState, text: Catalogue) -> list[tuple[str, str]]:
    axes, rpm = state.axes, state.spindle_rpm
    found = [
        ("R", axes.tool_radius_mm, "mm", 3),
        ("Z", axes.carriage_mm, "mm", 3),
        ("C", axes.spindle_deg, "°", 1),
        ("S", rpm, "rpm", 0),
    ]
    return [(name, _number(value, digits, f" {unit}")) for name, value, unit, digits in found]


def _alarm_line(state: FeedState, alarm: FeedAlarm, text: Catalogue) -> str:
    at = datetime.fromisoformat(state.at_utc).astimezone()
    priority, word = text(f"alarms_page.priority.{alarm.priority}"), text(f"watch.alarm.{alarm.state}")
    number = "" if alarm.number is None else f"{alarm.number}  "
    return f"{head(state, at, text)}  {number}{priority}  {word}  {alarm.text}"
