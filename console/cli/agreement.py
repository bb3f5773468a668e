"""Operator's consent to a command that moves a machine: the name of the machine has to be typed."""

from __future__ import annotations

import sys
from argparse import Namespace

from console.text.catalogue import Catalogue


def agreed(options: Namespace, machine_name: str, simulated: bool, text: Catalogue, command: str) -> bool:
    """Return whether the machine may be moved: with --yes, simulated, or when its name was typed.

    `command` is the word after `console`; `agreement.ask.<command>` is the text of what it is about to move.
    """
    if options.yes or simulated:
        return True
    if not sys.stdin.isatty():
        print(f"console {command}: {text('agreement.nobody_to_ask')}", file=sys.stderr)
        return False
    print(text(f"agreement.ask.{command}", machine=machine_name), end="", file=sys.stderr, flush=True)
    try:
        typed = sys.stdin.readline().strip()
    except UnicodeDecodeError:  # not decodable in the terminal's declared encoding
        typed = ""
    if typed == machine_name:
        return True
    print(f"console {command}: {text('agreement.not_typed')}", file=sys.stderr)
    return False
