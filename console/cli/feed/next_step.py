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
            print(_format_next_step(state, options, text), flush=True)

    return follow(options, text, show, LEAST_HZ, once=not options.follow)


def _news(step: FeedStep | None) -> object:
    return step and (step.word, step.why)


def _format_next_step(state: FeedState, options: Namespace, text: Catalogue) -> str:
    step = state.next
    said = text("next.none") if step is None else step_words(step, state, text)
    if options.json:
        named = {"schema": state.schema, "machine": state.machine, "process": state.process, "text": said}
        return json.dumps({**named, "next": None if step is None else asdict(step)})
    at = datetime.fromisoformat(state.at_utc).astimezone()
    why = () if step is None else step.why
    return "\n".join([f"{head(state, at, text)}  {said}", *(f"  - {text.problem(each)}" for each in why)])


def step_words(step: FeedStep, state: FeedState, text: Catalogue) -> str:
    """Return the page and the sentence of a step; the word itself where this console has no sentence for it."""
    page, _, name = step.word.partition(".")
    key, facts = f"{page}_page.next.{name}", {"force": step.force_n, "left": step.left_s}
    if page not in PAGES:
        return step.word
    figures = {fact: "–" if value is None else f"{value:.0f}" for fact, value in facts.items()}
    radius = "–" if step.radius_mm is None else text.units.figure(step.radius_mm, "mm", 3)
    angle = "–" if state.axes.spindle_deg is None else f"{state.axes.spindle_deg:.2f}"
    said = text(key, radius=radius, angle=angle, **figures)
    return step.word if said.startswith(key) else f"{text(f'page.{page}')}: {said}"
