"""Entry point: read the command line, run one command, and report any error in one line.

Nothing of the project is imported before `main` runs, so that a Ctrl-C during the imports is caught there too
(one that comes while Python itself still starts is handled by Python).
Nothing heavy is imported here: every command imports what it needs.
"""

from __future__ import annotations

import errno
import gc
import os
import sys
from contextlib import suppress

TYPE_CHECKING = False  # importing `typing` for it would be the slowest import of this file
if TYPE_CHECKING:
    from collections.abc import Sequence

    from console.session.configuration import Configuration
    from console.text.catalogue import Catalogue
    from profiles.problem import Problem

DONE, FAILED, WRONG_USAGE = 0, 1, 2
OUTPUT_FAULTS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)
SCREEN = "console.screens.start"
PLOTTED = {"reproduce": "console.screens.paper_figures", "replay": "console.flight.replay.start"}
"""Modules that draw for a command: `reproduce` with `--plot`, `replay` always; only the screens can draw."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return the exit code: 0 done, 1 refused or failed, 2 wrong usage."""
    text: Catalogue | None = None
    words: list[str] = []
    problems: list[Problem] = []
    gc.disable()  # what is imported and read at first stays; looking for garbage in it takes a sixth of the time
    # Matrices are small here. Threads that spin while they wait for the next one take the core that a stop needs.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when numpy is imported
    try:
        for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
            if getattr(sys, name) is None:  # closed by the caller: no other file may take its number
                setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))
        from console.cli.output import escape_streams, hint_at_encoding
        from console.session.configuration import read_configuration
        from console.text.catalogue import choose_language, load

        escape_streams()
        words = list(sys.argv[1:] if arguments is None else arguments)
        configuration = read_configuration(os.environ)
        text = load(choose_language(words, os.environ, configuration.value("language")))
        hint_at_encoding(text)
        code = _run(words, text, configuration, problems)
        return _flush_output(_with_json(words, code, problems, text), text)
    except KeyboardInterrupt as interrupted:
        return _with_json(words, _report_interruption(interrupted, text), problems, text)
    finally:
        gc.enable()


def _run(words: list[str], text: Catalogue, configuration: Configuration, problems: list[Problem]) -> int:
    """Run a command, explain what goes wrong, and add it to the problems; return the exit code."""
    try:
        return _dispatch(words, text, configuration)
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else FAILED
    except BrokenPipeError:
        _forget_output()
        return FAILED
    except OSError as error:
        # File and link errors have problem types of their own, so a bare write error here comes from the output.
        bare = error.filename is None and error.errno in OUTPUT_FAULTS
        return _report_lost_output(error, text) if bare else _explain(error, text, problems)
    except Exception as error:
        return _explain(error, text, problems)


def _dispatch(words: list[str], text: Catalogue, configuration: Configuration) -> int:
    from importlib import import_module

    from console.cli.arguments import contradiction
    from console.cli.commands import COMMANDS, SHOWS_CONFIGURATION, build
    from console.cli.configured_options import fill_in
    from console.cli.logged_commands import carried_out
    from profiles.problem import ProblemError

    parser = build(text)
    options = parser.parse_args(words)
    if options.version:
        return _version(options.json)
    if sentence := contradiction(options, text):
        parser.error(sentence)
    if options.command == SHOWS_CONFIGURATION:
        options.configuration = configuration
    elif configuration.problems:
        raise ProblemError(*configuration.problems)
    else:
        fill_in(options, configuration)
    if options.command is None and not (options.sim or options.link or options.machine):
        parser.print_help()
        print(f"console: {text('usage.no_command', limit=' | '.join(COMMANDS))}", file=sys.stderr)
        return WRONG_USAGE
    modules = PLOTTED if getattr(options, "plot", False) else COMMANDS
    command = import_module(modules.get(options.command, SCREEN))
    if options.command is not None:  # the screens collect from their first picture on
        gc.enable()
    return carried_out(lambda: command.main(options, text), options, words)


def _with_json(words: list[str], code: int, problems: list[Problem], text: Catalogue | None) -> int:
    """Return the exit code of a command; with --json, a failure is also a JSON object."""
    if code != DONE and text is not None and "--json" in words:
        from console.cli.output import print_failure

        with suppress(OSError):  # nobody reads it
            print_failure(code, problems, text)
    return code


def _version(as_json: bool) -> int:
    from importlib.metadata import version

    from console.cli.output import print_json

    said = {"name": "trilobe", "version": version("trilobe")}
    if as_json:
        print_json(said)
    else:
        print(" ".join(said.values()))
    return DONE


def _report_interruption(interrupted: KeyboardInterrupt, text: Catalogue | None) -> int:
    signal = str(interrupted) or "SIGINT"
    if text is None:  # raised before the language was chosen
        return _complain(f"ended by {signal}; this command was not moving anything")
    _flush_output(FAILED, text)
    return _complain(text("error.interrupted", signal=signal))


def _explain(error: Exception, text: Catalogue, problems: list[Problem]) -> int:
    """Catch every error and explain it: no traceback ever reaches an operator."""
    from profiles.problem import Problem, ProblemError

    if isinstance(error, ProblemError):
        problems += error.problems
        for problem in error.problems:
            _complain(text.problem(problem))
        return FAILED
    if isinstance(error, MemoryError):
        return _complain(text.problem(Problem(code="session.no_memory")))
    detail = " ".join(f"{type(error).__name__}: {error}".split())
    if os.environ.get("TRILOBE_TRACEBACK"):
        raise error
    return _complain(text("error.unexpected", value=detail))


def _complain(line: str) -> int:
    with suppress(OSError):  # the terminal is gone; the exit code still reports the result
        print(f"console: {line}", file=sys.stderr)
    return FAILED


def _flush_output(code: int, text: Catalogue) -> int:
    """Return the exit code; a result that could not be written counts as a failure."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _forget_output()
    except OSError as fault:
        if code == DONE:
            return _report_lost_output(fault, text)
        _forget_output()  # the failure has been reported
    try:
        sys.stderr.flush()
    except OSError:
        _forget_output()
    return code


def _report_lost_output(fault: OSError, text: Catalogue) -> int:
    _complain(text("error.output", value=fault.strerror or str(fault)))
    _forget_output()
    return FAILED


def _forget_output() -> None:
    """Discard pending output: nobody reads it, and the interpreter should exit without a complaint of its own."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


if __name__ == "__main__":
    sys.exit(main())
