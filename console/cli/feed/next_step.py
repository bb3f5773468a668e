"""`console next`: the next step at each machine with its key, in the operator's language, or why there is none."""

from __future__ import annotations

import json
from argparse import Namespace
from dataclasses import asdict
from datetime import datetime
from typing import TYPE_CHECKING

from console.cli.feed.watch import follow, head
from console.cli.parser import Parser
from console.session.feed.request import LEAST_HZ
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from console.session.feed.feed_state import FeedState, FeedStep

PAGES = ("align", "run", "inspect")
"""Pages whose next steps a feed publishes: a word is PAGE.NAME."""


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, and whether to stay for the steps after this one."""
    parser.add_argument("--machine", metavar="NAME", dest="watched", help=text("help.watch_machine"))
    parser.add_argument("--follow", action="store_true", help=text("help.next_follow"))


def main(options: Namespace, text: Catalogue) -> int:
    """Print the next step of every console of the data folder, or of one machine; with --follow each new one."""

    def show(before: FeedState | None, state: FeedState) -> None:
        if before is None or (options.follow and _news(before.next) != _news(state.next)):
            print(_shown(state, options, text), flush=True)

    return follow(options, text, show, LEAST_HZ, once=not options.follow)


def _news(step: FeedStep | None) -> tuple[object, ...]:
    return () if step is None else (step.word, step.why)


def _shown(state: FeedState, options: Namespace, text: Catalogue) -> str:
    step = state.next
    said = text("next.none") if step is None else step_words(step, state, text)
    if options.json:
        named = {"schema": state.schema, "machine": state.machine, "process": state.process}
        return json.dumps({**named, "next": None if step is None else {**asdict(step), "text": said}})
    rows = [f"{head(state, datetime.fromisoformat(state.at_utc).astimezone(), text)}  {said}"]
    return "\n".join([*rows, *(f"  - {text.problem(problem)}" for problem in (() if step is None else step.why))])


def step_words(step: FeedStep, state: FeedState, text: Catalogue) -> str:
    """Return the page and the sentence of a step; the word itself where this console has no sentence for it."""
    page, _, name = step.word.partition(".")
    key, angle_deg = f"{page}_page.next.{name}", state.axes.spindle_deg
    if page not in PAGES:
        return step.word
    said = text(
        key,
        force=_figure(step.force_n, 0),
        radius="–" if step.radius_mm is None else text.units.figure(step.radius_mm, "mm", 3),
        angle=_figure(angle_deg, 2),
        left=_figure(step.left_s, 0),
    )
    return step.word if said.startswith(key) else f"{text(f'page.{page}')}: {said}"


def _figure(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
