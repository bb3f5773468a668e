"""Which commands are in the log of the program, and what is said of them there."""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import suppress

from console.session.data.kept_files import data_folder
from profiles.problem import ProblemError

LOGGED = frozenset(
    {
        None,  # the screens
        *("run", "doctor", "controller", "identify", "health", "tune"),
        *("simulator", "metrics", "mtconnect", "mqtt", "ship"),
    }
)
"""Commands that work a machine, or serve others. A fault of the program is in it anyway.

Not `restore`: its folder has to be empty.
"""

MAY_HOLD_A_PASSWORD = ("shop",)
"""Options whose values are not logged: a password in one is refused, but only after the line of the begin."""


def carried_out(command: Callable[[], int], options: Namespace, words: Sequence[str]) -> int:
    """Carry out a command; log its begin and its end, and what ends it."""
    is_logged = options.command in LOGGED
    if is_logged:
        _note(options, f"begin  {_said(options, words)}")
    try:
        code = command()
    except ProblemError as error:
        if is_logged:
            _note(options, "refused  " + "; ".join(each.facts for each in error.problems), is_warning=True)
        raise
    except BaseException as ended:
        if isinstance(ended, Exception) and not isinstance(ended, BrokenPipeError):
            _note(options, f"fault  {_version()}: {_said(options, words)}", error=ended)
        elif is_logged:  # Ctrl-C, wrong usage that the command has told, or nobody reads on, as behind `head`
            _note(options, f"ended  {type(ended).__name__}: {ended}")
        raise
    if is_logged:
        _note(options, f"end  exit code {code}  {_version()}")
    return code


def _said(options: Namespace, words: Sequence[str]) -> str:
    """Return the command line, with dots in place of what may hold a password, however its option was written."""
    hidden = [value for name in MAY_HOLD_A_PASSWORD if (value := getattr(options, name, None))]
    shown = list(words)
    for value in hidden:
        shown = [word.replace(value, "...") for word in shown]
    return shlex.join(shown)


def _version() -> str:
    from importlib.metadata import version  # slow, and the first picture waits for the line of the begin

    return f"trilobe {version('trilobe')}"


def _note(options: Namespace, text: str, *, is_warning: bool = False, error: Exception | None = None) -> None:
    import logging

    from console.session.program_log import note

    level = logging.ERROR if error is not None else logging.WARNING if is_warning else logging.INFO
    with suppress(ProblemError):  # an account without a home has no folder, and no log
        note(data_folder(options.data), text, level=level, error=error)
