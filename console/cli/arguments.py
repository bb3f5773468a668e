"""Arguments that several commands share, and their allowed values."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from console.cli.parser import Parser
from console.text.catalogue import LANGUAGES, Catalogue

if TYPE_CHECKING:
    from drivers.link.address import TcpAddress
    from drivers.simulator.hosts.control_address import ControlAddress

Value = TypeVar("Value")
Number = TypeVar("Number", int, float)

WRONG_USAGE, OUT_OF_TOLERANCE = 2, 3
"""Exit codes besides 0, done, and 1, refused or failed."""
STAGES = ("air", "partial", "full")
TS_LIMIT_MS = 1000
PLANTS = ("ideal", "mounted", "paper", "steady", "easy", "realistic", "hard")
PLANT_FILE = "FILE.toml"
DEFAULT_PLANT = "ideal"
MOST_CLAMPING_SD_PERCENT = 50.0
SEED_LIMIT = 2**32 - 1
LATHE_PARTS = 10_000  # largest number of a part that can be asked for: those before it are drawn, too
MOST_BEFORE_S = 86_400.0

LINK = ("link", "trace")
HARDWARE = ("plant", "seed")
PLANT = (*HARDWARE, "clamping-sd")
"""Options for the actual plant of a simulated lathe, and its clamping."""

BEFORE = argparse.SUPPRESS
"""Default of an option that may also stand before the command: if absent after it, the earlier value stays."""


def contradiction(options: argparse.Namespace, text: Catalogue) -> str:
    """Return the sentence about mutually exclusive options; "" where none conflict."""
    if options.sim and options.link:
        return text("usage.sim_with_link")
    if options.before is not None and options.from_file is None:
        return text("usage.before_alone")
    if options.from_file is not None and (not options.sim or options.link or options.lesson or options.machine):
        return text("usage.from_alone")
    if options.instructor is not None and options.command is not None:
        return text("usage.instructor_with_command")
    if options.instructor is not None and not options.sim:
        return text("usage.instructor_without_sim")
    if getattr(options, "lathe_part", None) is not None and (not options.sim or options.seed is None):
        return text("usage.lathe_part_without_seed")
    if getattr(options, "ts", None) is not None:
        from drivers.cutting.strategy import TAKING_TS

        if options.strategy not in TAKING_TS:
            return text("usage.ts_without_paper", limit=" | ".join(TAKING_TS))
    return ""


def add_shared(
    parser: Parser, text: Catalogue, *names: str, absent: str | None = BEFORE, command: str = ""
) -> None:
    """Add options that several commands have; their help is that of the `command` where it has its own."""
    for name in names:
        key = ".".join(filter(None, ("help", command, name.replace("-", "_"))))
        parser.add_argument(f"--{name}", default=absent, help=text(key), **_SHARED[name])


INDICATOR = "indicator"  # instead of a file: the indicator of the simulated lathe


def add_lathe_part(parser: Parser, text: Catalogue) -> None:
    """Add which part of a simulated lathe it is."""
    number = number_parser_within(_digits, 1, LATHE_PARTS, "usage.lathe_part", LATHE_PARTS)
    parser.add_argument("--lathe-part", metavar="N", type=number, help=text("help.lathe_part"))


def add_practice(parser: Parser, text: Catalogue) -> None:
    """Add the recording whose event is practised, and how long before it that begins."""
    parser.add_argument("--from", metavar="FILE", dest="from_file", help=text("help.from"))
    before = number_parser_within(number, 0.0, MOST_BEFORE_S, "usage.before", f"{MOST_BEFORE_S:g}")
    parser.add_argument("--before", metavar="S", type=before, help=text("help.before"))


def add_fail_out_of_tolerance(parser: Parser, text: Catalogue) -> None:
    """Add that a part out of its tolerance is told by the exit code."""
    parser.add_argument("--fail-out-of-tolerance", action="store_true", help=text("help.fail_out_of_tolerance"))


def add_identity(parser: Parser, text: Catalogue) -> None:
    """Add what the certificate calls the part; absent is None, "" is not stated."""
    from console.session.part_identity import KEYS

    for key in KEYS:
        metavar = "C" if key.endswith("_c") else "TEXT"
        parser.add_argument(f"--{key.replace('_', '-')}", metavar=metavar, help=text(f"help.identity.{key}"))


def stated_identity(options: argparse.Namespace) -> dict[str, Any]:
    """Return the fields of `PartIdentity` that are stated; ProfileError as `identity_values`, by their options."""
    from dataclasses import replace

    from console.session.part_identity import KEYS, identity_values
    from profiles.problem import ProfileError

    given = {key: value for key in KEYS if (value := getattr(options, key)) is not None}
    try:
        return identity_values(given)
    except ProfileError as refused:
        problems = (replace(each, key=f"--{each.key.replace('_', '-')}") for each in refused.problems)
        raise ProfileError(*problems) from refused


def add_gauge(parser: Parser, text: Catalogue) -> None:
    """Add the gauge that measured a part, and how its figures are judged with their uncertainty."""
    from profiles.metrology.conformity import DecisionRule

    parser.add_argument("--gauge", metavar="NAME", help=text("help.gauge"))
    rules = [str(each) for each in DecisionRule]
    parser.add_argument(
        "--accept", metavar="RULE", choices=rules, help=text("help.accept", choices=" | ".join(rules))
    )


def add_job(parser: Parser, text: Catalogue) -> None:
    """Add the job as the first argument, and the machine."""
    parser.add_argument("job", metavar="JOB", help=text("help.job"))
    add_shared(parser, text, "machine")


def add_strategy(parser: Parser, text: Catalogue) -> None:
    """Add the strategy of the program, with the TS of those that take one."""
    from drivers.cutting.strategy import DEFAULT_STRATEGY, Strategy

    each_in_words = ", ".join(text(f"strategy.{each}.help") for each in Strategy)
    strategy_help = text("help.strategy", default=DEFAULT_STRATEGY, strategies=each_in_words)
    names = [*map(str, Strategy)]
    parser.add_argument("--strategy", choices=names, default=DEFAULT_STRATEGY.value, help=strategy_help)
    parser.add_argument("--ts", metavar="MS", type=milliseconds, help=text("help.ts"))


def number(word: str) -> float:
    """Parse a finite number."""
    value = number_or_nan(word)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(Parser.text("usage.number", value=word))
    return value


def number_or_nan(word: str) -> float:
    """Return the number; NaN, which is in no range, for any other word."""
    try:
        return float(word)
    except ValueError:
        return math.nan


def whole_number(word: str) -> int:
    """Parse a whole number of nine digits at most."""
    if len(word) > 9 or _digits(word) < 0:
        raise argparse.ArgumentTypeError(Parser.text("usage.whole", value=word))
    return int(word)


def _digits(word: str) -> int:
    return int(word) if word.isascii() and word.isdigit() else -1


def number_parser_within(
    parse: Callable[[str], Number], least: float, most: float, key: str, limit: object
) -> Callable[[str], Number]:
    """Return the parser of numbers in a range; `key` is the sentence for others, with the `limit`."""

    def parsed(word: str) -> Number:
        value = parse(word)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(Parser.text(key, value=word, limit=limit))
        return value

    return parsed


milliseconds = number_parser_within(_digits, 0, TS_LIMIT_MS, "usage.ts", TS_LIMIT_MS)
"""Parser of a time as TA and TS accept it."""


def list_parser(parse: Callable[[str], Value]) -> Callable[[str], tuple[Value, ...]]:
    """Return the parser of a list with commas."""
    return lambda words: tuple(parse(word) for word in words.split(","))


def compensation(word: str) -> str:
    """Parse "none", "newest" or the number of a version."""
    return word if word in ("none", "newest") else str(whole_number(word))


@contextmanager
def problems_as_usage() -> Iterator[None]:
    """Report what is wrong with an argument as a usage error."""
    from profiles.problem import ProblemError

    try:
        yield
    except ProblemError as error:
        raise argparse.ArgumentTypeError(Parser.text.problem(error.problems[0])) from error


def control_address(word: str) -> ControlAddress:
    """Parse the address at which a simulator accepts fault requests."""
    from drivers.simulator.hosts.control_address import parse_control_address

    with problems_as_usage():
        return parse_control_address(word)


def host_port(word: str) -> TcpAddress:
    """Parse an address to listen at, or to connect to: HOST:PORT."""
    from drivers.link.address import parse_host_port

    with problems_as_usage():
        return parse_host_port(word)


def indicator_line(word: str) -> str:
    """Return the line of an indicator as it was given; it can be parsed."""
    from drivers.link.indicator import parse_indicator

    with problems_as_usage():
        parse_indicator(word)
    return word


def _plant(word: str) -> str:
    if word not in PLANTS and not word.endswith(".toml"):
        limit = " | ".join((*PLANTS, PLANT_FILE))
        raise argparse.ArgumentTypeError(Parser.text("usage.plant", value=word, limit=limit))
    return word


_seed = number_parser_within(_digits, 0, SEED_LIMIT, "usage.seed", SEED_LIMIT)
_sd_percent = number_parser_within(
    number, 0.0, MOST_CLAMPING_SD_PERCENT, "usage.clamping_sd", f"{MOST_CLAMPING_SD_PERCENT:g}"
)

_SHARED: dict[str, dict[str, Any]] = {
    "json": {"action": "store_true"},
    "sim": {"action": "store_true"},
    "data": {"metavar": "FOLDER"},
    "lang": {"choices": LANGUAGES},
    "machine": {"metavar": "NAME"},
    "link": {"metavar": "ADDRESS"},
    "trace": {"metavar": "FILE"},
    "indicator": {"metavar": "LINE", "type": indicator_line},
    "plant": {"metavar": "PLANT", "type": _plant},
    "seed": {"metavar": "N", "type": _seed},
    "clamping-sd": {"metavar": "PERCENT", "type": _sd_percent},
}
"""Shared options; the help of each is `help.NAME`. The language was evaluated before the parser existed."""
