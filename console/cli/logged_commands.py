"""Which commands are in the log of the program, and what is said of them there."""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import suppress

from console.session.data.kept_files import data_folder
from console.session.ending_signal import ended_by_signals, held_back, that_came
from profiles.problem import ProblemError

LOGGED = frozenset(
    {
        None,  # the screens
        *("run", "retract", "doctor", "controller", "identify", "health", "tune"),
        *("simulator", "metrics", "mtconnect", "mqtt", "ship"),
        *("watch", "study"),
    }
)
"""Commands that work a machine, serve others, or may run for hours. A fault of the program is in it anyway.

Not `restore`: its folder has to be empty.
"""

MAY_HOLD_A_PASSWORD = ("shop",)
"""Options whose values are not logged: a password in one is refused, but only after the line of the begin."""

FAILED = 1


def carried_out(command: Callable[[], int], options: Namespace, words: Sequence[str]) -> int:
    """Carry out a command; log its begin and its end, what ended it, and with which exit code.

    A signal ends it with Interrupted, where it installs no handler of its own. Only what is killed has no end.
    """
    is_logged = options.command in LOGGED
    with ended_by_signals():
        if is_logged:
            _note(options, f"begin  {_mask_command_line(options, words)}")
        code, by = FAILED, ""
        try:
            code = command()
        except ProblemError as error:
            if is_logged:
                _note(options, "refused  " + "; ".join(each.facts for each in error.problems), is_warning=True)
            raise
        except SystemExit as ended:  # wrong usage that the command has reported
            code = ended.code if isinstance(ended.code, int) else FAILED
            raise
        except (KeyboardInterrupt, BrokenPipeError) as ended:  # or nobody reads on, as behind `head`
            by = type(ended).__name__
            raise
        except Exception as error:
            _note(options, f"fault  {_version()}: {_mask_command_line(options, words)}", error=error)
            raise
        finally:
            if is_logged:
                by = that_came() or by
                with held_back():  # a terminal that closes sends more than one
                    _note(options, f"end  {by}{', ' if by else ''}exit code {code}  {_version()}")
    return code


def _mask_command_line(options: Namespace, words: Sequence[str]) -> str:
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
