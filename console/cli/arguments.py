"""Arguments that several commands share, and their allowed values."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from console.cli.parser import Parser
from console.text.catalogue import LANGUAGES, Catalogue

if TYPE_CHECKING:
    from collections.abc import Iterable

    from drivers.cutting.strategy import Strategy
    from drivers.simulator.hosts.control_address import ControlAddress

STAGES = ("air", "partial", "full")
TS_LIMIT_MS = 1000
PLANTS = ("ideal", "mounted", "paper", "realistic")
PLANT_FILE = "FILE.toml"
DEFAULT_PLANT = "ideal"
MOST_CLAMPING_SD_PERCENT = 50.0
SEED_LIMIT = 2**32 - 1

BEFORE = argparse.SUPPRESS
"""Default of an option that may also stand before the command: if absent after it, the earlier value stays."""


def contradiction(options: argparse.Namespace, text: Catalogue) -> str:
    """Return the sentence about mutually exclusive options; "" where none conflict."""
    if options.sim and options.link:
        return text("usage.sim_with_link")
    if getattr(options, "ts", None) is not None:
        from drivers.cutting.strategy import TAKING_TS

        if options.strategy not in TAKING_TS:
            return text("usage.ts_without_paper", limit=" | ".join(TAKING_TS))
    return ""


def add_data(parser: Parser, text: Catalogue, absent: str | None = BEFORE) -> None:
    """Add the option for the data folder."""
    parser.add_argument("--data", metavar="FOLDER", default=absent, help=text("help.data"))


def add_language(parser: Parser, text: Catalogue) -> None:
    """Add the language option, which was evaluated before the parser existed."""
    parser.add_argument("--lang", choices=LANGUAGES, default=BEFORE, help=text("help.lang"))


def add_job(parser: Parser, text: Catalogue) -> None:
    """Add the job as the first argument."""
    parser.add_argument("job", metavar="JOB", help=text("help.job"))


def add_machine(parser: Parser, text: Catalogue, absent: str | None = BEFORE) -> None:
    """Add the machine profile."""
    parser.add_argument("--machine", metavar="NAME", default=absent, help=text("help.machine"))


def add_sim(parser: Parser, text: Catalogue, key: str) -> None:
    """Add `--sim`, whose meaning depends on the command: `key` is that of its help."""
    parser.add_argument("--sim", action="store_true", default=BEFORE, help=text(key))


def add_link(parser: Parser, text: Catalogue, absent: str | None = BEFORE) -> None:
    """Add the address of the controller, and the trace file of its communication."""
    parser.add_argument("--link", metavar="ADDRESS", default=absent, help=text("help.link"))
    parser.add_argument("--trace", metavar="FILE", default=absent, help=text("help.trace"))


def add_plant(parser: Parser, text: Catalogue, absent: str | None = BEFORE) -> None:
    """Add the options for the actual plant of a simulated lathe, and its clamping."""
    add_hardware(parser, text, absent)
    parser.add_argument(
        "--clamping-sd", metavar="PERCENT", type=_clamping_sd, default=absent, help=text("help.clamping_sd")
    )


def add_hardware(parser: Parser, text: Catalogue, absent: str | None = BEFORE) -> None:
    """Add the options for the actual plant of a simulated lathe."""
    parser.add_argument("--plant", metavar="PLANT", type=_plant, default=absent, help=text("help.plant"))
    parser.add_argument("--seed", metavar="N", type=_seed, default=absent, help=text("help.seed"))


def add_strategy(parser: Parser, text: Catalogue) -> None:
    """Add the strategy of the program, with the TS of those that take one."""
    from drivers.cutting.strategy import DEFAULT_STRATEGY, Strategy

    told = ", ".join(text(f"strategy.{each}.help") for each in Strategy)
    strategy_help = text("help.strategy", default=DEFAULT_STRATEGY, strategies=told)
    names = strategy_names(Strategy)
    parser.add_argument("--strategy", choices=names, default=DEFAULT_STRATEGY.value, help=strategy_help)
    parser.add_argument("--ts", metavar="MS", type=milliseconds, help=text("help.ts"))


def strategy_names(strategies: Iterable[Strategy]) -> tuple[str, ...]:
    """Return the available strategy names."""
    return tuple(each.value for each in strategies)


def milliseconds(word: str) -> int:
    """Parse a time as TA and TS accept it."""
    if not (word.isascii() and word.isdigit()) or int(word) > TS_LIMIT_MS:
        raise argparse.ArgumentTypeError(Parser.text("usage.ts", value=word, limit=TS_LIMIT_MS))
    return int(word)


def number(word: str) -> float:
    """Parse a finite number."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(Parser.text("usage.number", value=word))
    return value


def whole_number(word: str) -> int:
    """Parse a whole number of nine digits at most."""
    if not (word.isascii() and word.isdigit()) or len(word) > 9:
        raise argparse.ArgumentTypeError(Parser.text("usage.whole", value=word))
    return int(word)


def whole_numbers(words: str) -> tuple[int, ...]:
    """Parse whole numbers separated by commas."""
    return tuple(whole_number(word) for word in words.split(","))


def compensation(word: str) -> str:
    """Parse "none", "newest" or the number of a version."""
    return word if word in ("none", "newest") else str(whole_number(word))


def control_address(word: str) -> ControlAddress:
    """Parse the address at which a simulator accepts fault requests."""
    from drivers.simulator.hosts.control_address import parse_control_address
    from profiles.problem import ProblemError

    try:
        return parse_control_address(word)
    except ProblemError as error:
        raise argparse.ArgumentTypeError(Parser.text.problem(error.problems[0])) from error


def _seed(word: str) -> int:
    if not (word.isascii() and word.isdigit()) or int(word) > SEED_LIMIT:
        raise argparse.ArgumentTypeError(Parser.text("usage.seed", value=word, limit=SEED_LIMIT))
    return int(word)


def _plant(word: str) -> str:
    if word not in PLANTS and not word.endswith(".toml"):
        limit = " | ".join((*PLANTS, PLANT_FILE))
        raise argparse.ArgumentTypeError(Parser.text("usage.plant", value=word, limit=limit))
    return word


def _clamping_sd(word: str) -> float:
    percent = number(word)
    if not 0.0 <= percent <= MOST_CLAMPING_SD_PERCENT:
        limit = f"{MOST_CLAMPING_SD_PERCENT:g}"
        raise argparse.ArgumentTypeError(Parser.text("usage.clamping_sd", value=word, limit=limit))
    return percent
