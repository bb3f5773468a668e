"""`console instruct`: the instructor of a trainee at `console --sim --instructor ADDRESS`."""

from __future__ import annotations

import json
import os
import sys
import time
from argparse import SUPPRESS, ArgumentTypeError, Namespace
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.arguments import WRONG_USAGE, control_address
from console.cli.library import data_of
from console.cli.output import SCHEMA
from console.cli.parser import Parser
from console.school.instructing.order import WORDS, OrderReply
from console.session.dated_input import CLOSED, read_line
from console.text.catalogue import Catalogue
from drivers.clock import OLD_S

if TYPE_CHECKING:
    from console.school.instructing.client import Instructor

FOLLOWED = ("screen", "log")
TOKEN = "TRILOBE_INSTRUCT_TOKEN"
FOLLOW_S = 1.0
CLEAR = "\x1b[H\x1b[2J"
LEAVE = ("quit", "exit", CLOSED)


def add(parser: Parser, text: Catalogue) -> None:
    """Add the address of the trainee's console, the token, and the order."""
    parser.add_argument("address", metavar="ADDRESS", type=control_address, help=text("help.instruct_address"))
    parser.add_argument("words", metavar="WORD", nargs="*", help=text("help.instruct_words"))
    parser.add_argument(
        "--token-file", metavar="FILE", type=Path, help=text("help.instruct_token", variable=TOKEN)
    )
    parser.add_argument("--token", type=_refuse_token, help=SUPPRESS)
    parser.add_argument("--follow", action="store_true", help=text("help.instruct_follow"))


def main(options: Namespace, text: Catalogue) -> int:
    """Give one order, or those of the standard input; 1 when one is refused."""
    line = " ".join(options.words)
    if options.follow and line not in FOLLOWED:
        print(f"console instruct: {text('usage.instruct_follow')}", file=sys.stderr)
        return WRONG_USAGE
    if line == "help":
        return _print_answer(OrderReply(lines=WORDS), options, text)
    from console.school.instructing.client import Instructor
    from console.school.instructing.token import kept_token, token_path

    file = options.token_file or token_path(data_of(options), options.address)
    token = kept_token(file) if options.token_file else os.environ.get(TOKEN) or kept_token(file)
    stays = options.follow or not line
    with Instructor(options.address, token, stays=stays) as instructor:
        if options.follow:
            return _follow_lathe(instructor, line, options, text)
        return _print_answer(instructor.ask(line), options, text) if line else _lines(instructor, options, text)


def _refuse_token(_: str) -> None:
    """Refuse a token in the command line, where every account sees it in the list of processes."""
    raise ArgumentTypeError(Parser.text("usage.instruct_token", variable=TOKEN))


def _lines(instructor: Instructor, options: Namespace, text: Catalogue) -> int:
    """Give the orders that are typed, or come through a pipe, one a line."""
    typed, code = sys.stdin.isatty(), 0
    if typed:
        print(text("instruct.welcome"))
    while True:
        asked = read_line("SIM> ") if typed else None
        if asked is not None and asked.late:
            print(f"console instruct: {text('instruct.late', limit=f'{OLD_S:g} s')}", file=sys.stderr)
            continue
        line = sys.stdin.readline() if asked is None else f"{asked.text}\n"
        if not line or line.strip() in LEAVE:
            return code
        if line.strip() == "help":
            _print_answer(OrderReply(lines=WORDS), options, text)
        elif line.strip():
            code = max(code, _print_answer(instructor.ask(line.rstrip("\r\n")), options, text))
        if typed:
            code = 0  # what was refused has been seen


def _print_answer(answer: OrderReply, options: Namespace, text: Catalogue) -> int:
    """Print an answer; return the exit code."""
    problem = None if answer.problem is None else text.problem(answer.problem)
    if options.json:
        table = {
            "schema": SCHEMA,
            "answer": answer.lines,
            "refused": problem,
            "age_s": answer.age_s,
            "simulated": True,
        }
        print(json.dumps(table, indent=2 if options.words else None))
    else:
        if answer.age_s:
            print(text("instruct.old_screen", age=f"{answer.age_s:.0f}"))
        print("".join(f"{line}\n" for line in answer.lines), end="")
    sys.stdout.flush()
    if problem is not None:
        print(f"console: {problem}", file=sys.stderr)
    return 0 if problem is None else 1


def _follow_lathe(instructor: Instructor, line: str, options: Namespace, text: Catalogue) -> int:
    """Print the screen whenever it has changed, or what is new in the log, until the link or the user ends it."""
    before: tuple[str, ...] = ()
    while True:
        answer = instructor.ask(line)
        if answer.problem is not None:
            return _print_answer(answer, options, text)
        fresh = answer.lines
        if line == "log":  # an older row may have been counted once more
            fresh = tuple((Counter(answer.lines) - Counter(before)).elements())
        if fresh and answer.lines != before:
            if line == "screen" and sys.stdout.isatty():
                print(CLEAR, end="")
            _print_answer(OrderReply(lines=fresh, age_s=answer.age_s), options, text)
        before = answer.lines
        time.sleep(FOLLOW_S)
