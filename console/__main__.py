"""The entry point: reads the command line, runs one command, and turns what goes wrong into one line.

Nothing heavy is imported here: every command imports what it needs.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence

from console.cli.parser import build
from console.text.catalogue import Catalogue, choose_language, load

DONE, FAILED, WRONG_USAGE = 0, 1, 2
MODULES = {name: f"console.cli.{name}" for name in ("jobs", "preview", "program", "run", "simulator", "roundness")}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return the exit code: 0 done, 1 refused or failed, 2 wrong usage."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    text = load(choose_language(words, os.environ))
    try:
        return _dispatch(words, text)
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else FAILED
    except KeyboardInterrupt as interrupted:
        return _complain(text("error.interrupted", signal=str(interrupted) or "SIGINT"))
    except BrokenPipeError:
        _forget_output()
        return FAILED
    except Exception as error:
        return _explain(error, text)
    finally:
        _flush()


def _dispatch(words: list[str], text: Catalogue) -> int:
    parser = build(text)
    options = parser.parse_args(words)
    if options.version:
        return _version()
    if options.command is None:
        parser.print_help()
        print(f"console: {text('usage.no_command', limit=' | '.join(MODULES))}", file=sys.stderr)
        return WRONG_USAGE
    module = importlib.import_module(MODULES[options.command])
    if getattr(options, "ts", None) is not None and options.strategy != "paper":
        parser.error(text("usage.ts_without_paper"))
    code: int = module.main(options, text)
    return code


def _version() -> int:
    from importlib.metadata import version

    print(f"trilobe {version('trilobe')}")
    return DONE


def _explain(error: Exception, text: Catalogue) -> int:
    """The one place where any error at all is caught: no traceback ever reaches an operator."""
    from profiles.problem import ProblemError

    if isinstance(error, ProblemError):
        for problem in error.problems:
            _complain(text.problem(problem))
        return FAILED
    detail = " ".join(f"{type(error).__name__}: {error}".split())
    if os.environ.get("TRILOBE_TRACEBACK"):
        raise error
    return _complain(text("error.unexpected", value=detail))


def _complain(line: str) -> int:
    try:
        print(f"console: {line}", file=sys.stderr)
    except OSError:
        pass  # the terminal is gone; the exit code still tells
    return FAILED


def _flush() -> None:
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        _forget_output()


def _forget_output() -> None:
    """Nobody reads any more: let the interpreter end without a complaint of its own."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


if __name__ == "__main__":
    sys.exit(main())
