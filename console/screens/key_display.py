"""`console terminal`: what each key of this terminal sends, and the key that the screens read in it."""

from __future__ import annotations

import os
import select
import sys
import termios
import time
import tty
from argparse import Namespace
from codecs import getincrementaldecoder
from collections.abc import Iterator

from console.cli.output import print_json
from console.cli.parser import Parser
from console.session.errors import SessionError
from console.text.catalogue import Catalogue
from profiles.problem import Problem

SILENCE_S = 0.2  # after which nothing more belongs to a key


def add(parser: Parser, text: Catalogue) -> None:
    """Add nothing: the command has no arguments of its own."""


def main(options: Namespace, text: Catalogue) -> int:
    """Print what each key sends, until Ctrl-C; ProblemError without a terminal."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise SessionError(Problem(code="screen.keys_need_terminal"))
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    try:
        tty.setraw(terminal)
        raw = termios.tcgetattr(terminal)
        raw[1] = before[1]  # lines end as before
        termios.tcsetattr(terminal, termios.TCSANOW, raw)
        print(text("terminal_keys.press"), file=sys.stderr)
        for sent, keys in _strokes(terminal):
            if options.json:
                print_json({"sent": sent, "keys": keys})
            else:
                read = ", ".join(keys) or text("terminal_keys.answer")
                print(f"{sent.replace(chr(27), 'ESC '):<24} {read}")
            if "ctrl+c" in keys:
                break
    finally:
        os.write(sys.stdout.fileno(), b"\x1b[<u")
        termios.tcsetattr(terminal, termios.TCSAFLUSH, before)
    return 0


def _strokes(terminal: int) -> Iterator[tuple[str, list[str]]]:
    """Yield what was sent with the names of its keys, none for an answer of the terminal."""
    from textual import constants, events

    from console.tui.application.key_releases import PLAIN, KeyReleases
    from console.tui.driver import IDENTIFY, Reader, terminal_encoding

    releases, sent = KeyReleases(), ""
    reader, decode = Reader(releases), getincrementaldecoder(terminal_encoding())("replace").decode
    asked = "" if constants.DISABLE_KITTY_KEY else f"\x1b[>{PLAIN}u" + releases.ask(True, time.monotonic())
    os.write(sys.stdout.fileno(), (IDENTIFY + asked).encode())
    while True:
        ready = bool(select.select([terminal], [], [], SILENCE_S)[0])
        data = os.read(terminal, 4096) if ready else b""
        if ready and not data:
            return
        sent += (typed := decode(data, not ready))
        said = [each for character in typed for each in reader.read(character, time.monotonic())]
        said += [] if ready else reader.idle(time.monotonic())
        if said or (sent and not ready):
            yield sent, [each.key for each in said if isinstance(each, events.Key)]
            sent = ""
