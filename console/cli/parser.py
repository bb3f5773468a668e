"""The command line as a tree of arguments; light enough to be built for every call."""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from console.text.catalogue import LANGUAGES, Catalogue
from drivers.cutting.strategy import DEFAULT_STRATEGY, INVERTING, Strategy

if TYPE_CHECKING:
    from drivers.link.address import TcpAddress
    from drivers.simulator.hosts.control_address import ControlAddress

STAGES = ("air", "partial", "full")
MOST_PARTS = 20
"""Parts in a row that learn."""

TS_LIMIT_MS = 1000
CALIBRATIONS = ("wrench", "deflection")
DIALECTS = ("pmac", "turbo")
REFERENCE_CIRCLES = ("LSC", "MZC", "MCC", "MIC")
PLANTS = ("ideal", "mounted", "paper", "realistic")
PLANT_FILE = "FILE.toml"
MOST_CLAMPING_SD_PERCENT = 50.0
DEFAULT_PLANT = "ideal"
SEED_LIMIT = 2**32 - 1
SLOWEST, FASTEST = 0.01, 100.0

_WORDING = (
    (re.compile(r"the following arguments are required: (?P<value>.*)"), "usage.required"),
    (re.compile(r"one of the arguments (?P<value>.*) is required"), "usage.required"),
    (re.compile(r"unrecognized arguments: (?P<value>.*)"), "usage.unrecognized"),
    (
        re.compile(r"argument (?P<key>.*?): invalid choice: (?P<value>.*?) \(choose from (?P<limit>.*)\)"),
        "usage.choice",
    ),
    (re.compile(r"argument (?P<key>.*?): expected one argument"), "usage.value_missing"),
    (re.compile(r"argument (?P<key>.*?): (?P<value>.*)"), "usage.argument"),
)
"""What argparse says, and the sentence of ours for it."""


# argparse has no public name for what add_subparsers returns.
_Commands: TypeAlias = "argparse._SubParsersAction[Parser]"  # noqa: SLF001


class Parser(argparse.ArgumentParser):
    """An argument parser that speaks the operator's language, in one line."""

    text: Catalogue

    def print_help(self, file: Any = None) -> None:
        """Print the help; unlike the one of argparse, let the caller know when nobody can read it."""
        (file or sys.stdout).write(self.format_help())

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the command line, and exit with 2."""
        said = " ".join(message.split())
        for pattern, key in _WORDING:
            match = pattern.fullmatch(said)
            if match:
                said = self.text(key, **match.groupdict())
                break
        print(f"{self.prog}: {said}", file=sys.stderr)
        raise SystemExit(2)


class _Formatter(argparse.HelpFormatter):
    """The word in front of the usage line in the operator's language."""

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: str | None = None) -> None:
        """Add the usage line; argparse gives a prefix of its own only where there is to be none."""
        super().add_usage(usage, actions, groups, Parser.text("help.usage") + " " if prefix is None else prefix)


def build(text: Catalogue) -> Parser:
    """Return the parser of the whole command line."""
    Parser.text = text
    parser = Parser(prog="console", description=text("help.console"), add_help=False, allow_abbrev=False)
    _titles(parser, text)
    parser.add_argument("--version", action="store_true", help=text("help.version"))
    parser.add_argument("--json", action="store_true", help=text("help.json"))
    parser.add_argument("--sim", action="store_true", help=text("help.screen"))
    parser.add_argument("--machine", metavar="NAME", help=text("help.machine"))
    parser.add_argument("--link", metavar="ADDRESS", help=text("help.link"))
    parser.add_argument("--trace", metavar="FILE", help=text("help.trace"))
    parser.add_argument("--data", metavar="FOLDER", help=text("help.data"))
    _plant(parser, text, absent=None)
    _language(parser, text)
    commands = parser.add_subparsers(
        dest="command", metavar="COMMAND", title=text("help.commands"), parser_class=Parser
    )
    _jobs(commands, text)
    _preview(commands, text)
    _predict(commands, text)
    _program(commands, text)
    _check_program(commands, text)
    _run(commands, text)
    _simulator(commands, text)
    _fault(commands, text)
    _roundness(commands, text)
    _controller(commands, text)
    _doctor(commands, text)
    _identify(commands, text)
    _calibrate(commands, text)
    _learn(commands, text)
    _reproduce(commands, text)
    return parser


def _jobs(commands: _Commands, text: Catalogue) -> None:
    _command(commands, "jobs", text)


def _predict(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "predict", text)
    _job(parser, text)
    _machine(parser, text)


def _preview(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "preview", text)
    _job(parser, text)
    _machine(parser, text)
    strategy_help = text("help.preview.strategy", default=DEFAULT_STRATEGY)
    parser.add_argument("--strategy", choices=_names(Strategy), default=DEFAULT_STRATEGY.value, help=strategy_help)
    parser.add_argument("--identified", metavar="FILE", help=text("help.identified"))


def _program(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "program", text)
    _job(parser, text)
    _machine(parser, text)
    _strategy(parser, text)


def _check_program(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "check-program", text)
    parser.add_argument("file", metavar="FILE", help=text("help.program_file"))
    _machine(parser, text)
    parser.add_argument("--from", metavar="X=N,Y=N", type=_start, dest="start", help=text("help.start"))
    parser.add_argument("--ta", metavar="MS", type=_ts, dest="ta_ms", help=text("help.other_ta"))
    parser.add_argument("--ts", metavar="MS", type=_ts, dest="ts_ms", help=text("help.other_ts"))


def _run(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "run", text)
    _job(parser, text)
    _machine(parser, text)
    parser.add_argument("--sim", action="store_true", default=argparse.SUPPRESS, help=text("help.sim"))
    _link(parser, text)
    _strategy(parser, text)
    _plant(parser, text)
    parser.add_argument("--identified", metavar="FILE", help=text("help.identified"))
    parser.add_argument("--learn", metavar="PARTS", type=_parts, help=text("help.learn"))
    parser.add_argument("--stage", choices=STAGES, default="full", help=text("help.stage"))
    compensation_help = text("help.compensation")
    parser.add_argument(
        "--compensation", metavar="VERSION", type=_compensation, default="none", help=compensation_help
    )
    parser.add_argument("--part", metavar="FILE.csv", help=text("help.part"))
    parser.add_argument("--yes", action="store_true", help=text("help.run.yes"))


def _simulator(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "simulator", text)
    parser.add_argument("--tcp", metavar="HOST:PORT", type=_host_port, help=text("help.tcp"))
    parser.add_argument("--ethernet", metavar="HOST:PORT", type=_host_port, help=text("help.ethernet"))
    parser.add_argument("--pty", action="store_true", help=text("help.pty"))
    parser.add_argument("--control", metavar="ADDRESS", type=_control, help=text("help.control"))
    _machine(parser, text)
    parser.add_argument("--dialect", choices=DIALECTS, help=text("help.dialect"))
    _plant(parser, text)
    parser.add_argument("--saved", metavar="FILE", help=text("help.saved"))
    parser.add_argument("--speed", metavar="X", type=_speed, default=1.0, help=text("help.speed"))


def _fault(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "fault", text)
    parser.add_argument("address", metavar="ADDRESS", type=_control, help=text("help.fault_address"))
    parser.add_argument("words", metavar="WORD", nargs="+", help=text("help.fault_words"))


def _roundness(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "roundness", text)
    parser.add_argument("file", metavar="FILE.csv", help=text("help.file"))
    filters = parser.add_mutually_exclusive_group()
    filters.add_argument("--filter", metavar="UPR|none", default="50", type=_filter, help=text("help.filter"))
    filters.add_argument("--band", metavar="LOW:HIGH", type=_band, help=text("help.band"))
    parser.add_argument("--circle", choices=REFERENCE_CIRCLES, default="LSC", help=text("help.circle"))
    parser.add_argument("--robust", action="store_true", help=text("help.robust"))
    parser.add_argument("--vblock", metavar="DEG", type=_number, help=text("help.vblock"))
    parser.add_argument("--lobes", metavar="N", type=_whole, help=text("help.lobes"))
    parser.add_argument("--job", metavar="JOB", help=text("help.roundness_job"))


def _controller(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "controller", text)
    title = text("help.controller.actions")
    actions = parser.add_subparsers(
        dest="action", metavar="ACTION", title=title, required=True, parser_class=Parser
    )
    for name, takes_file in (("backup", True), ("verify", False), ("diff", True), ("apply", False)):
        action = _command(actions, name, text, key=f"controller.{name}")
        if takes_file:
            action.add_argument("file", metavar="FILE", help=text("help.backup_file"))
        _machine(action, text)
        _link(action, text)
        if name == "apply":
            action.add_argument("--yes", action="store_true", help=text("help.controller.yes"))


def _doctor(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "doctor", text)
    _machine(parser, text)
    _link(parser, text)
    parser.add_argument("--prove", action="store_true", help=text("help.prove"))
    parser.add_argument("--yes", action="store_true", help=text("help.doctor.yes"))


def _identify(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "identify", text)
    _machine(parser, text)
    parser.add_argument("--sim", action="store_true", default=argparse.SUPPRESS, help=text("help.identify.sim"))
    _iron(parser, text)
    _link(parser, text)
    told = ", ".join(text(f"strategy.{each}.path") for each in INVERTING)
    parser.add_argument(
        "--strategy",
        choices=_names(INVERTING),
        default=DEFAULT_STRATEGY.value,
        help=text("help.identify.strategy", default=DEFAULT_STRATEGY, strategies=told),
    )
    parser.add_argument(
        "--frequencies", metavar="HZ,HZ", type=_frequencies, help=text("help.identify.frequencies")
    )
    parser.add_argument("--amplitude", metavar="UM", type=_number, help=text("help.identify.amplitude"))
    parser.add_argument("--periods", metavar="N", type=_whole, help=text("help.identify.periods"))
    parser.add_argument("--yes", action="store_true", help=text("help.identify.yes"))


def _calibrate(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "calibrate", text)
    title = text("help.calibrate.actions")
    actions = parser.add_subparsers(
        dest="action", metavar="ACTION", title=title, required=True, parser_class=Parser
    )
    chuck = _command(actions, "chuck", text, key="calibrate.chuck")
    chuck.add_argument("file", metavar="FILE.csv", help=text("help.calibrate.table"))
    _machine(chuck, text)
    chuck.add_argument("--kind", choices=CALIBRATIONS, help=text("help.calibrate.kind"))
    chuck.add_argument("--affine", action="store_true", help=text("help.calibrate.affine"))
    chuck.add_argument("--torque", metavar="NM", type=_number, help=text("help.calibrate.torque"))
    chuck.add_argument("--force", metavar="N", type=_number, help=text("help.calibrate.force"))
    chuck.add_argument("--keep", action="store_true", help=text("help.calibrate.chuck.keep"))
    lobe = _command(actions, "lobe", text, key="calibrate.lobe")
    lobe.add_argument("file", metavar="TRACE", help=text("help.calibrate.trace"))
    lobe.add_argument("--job", metavar="JOB", required=True, help=text("help.job"))
    _machine(lobe, text)
    lobe.add_argument("--extra", metavar="N,N", type=_orders, help=text("help.calibrate.extra"))
    lobe.add_argument("--robust", action="store_true", help=text("help.calibrate.robust"))
    lobe.add_argument("--keep", action="store_true", help=text("help.calibrate.lobe.keep"))
    sim_help = text("help.calibrate.lobe.sim")
    lobe.add_argument("--sim", action="store_true", default=argparse.SUPPRESS, help=sim_help)


def _learn(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "learn", text, key="learn.command")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("file", metavar="TRACE", nargs="?", help=text("help.calibrate.trace"))
    what.add_argument("--list", action="store_true", help=text("help.learn.list"))
    what.add_argument("--revert", metavar="VERSION", type=_whole, help=text("help.learn.revert"))
    parser.add_argument("--job", metavar="JOB", required=True, help=text("help.job"))
    _machine(parser, text)
    parser.add_argument("--sim", action="store_true", default=argparse.SUPPRESS, help=text("help.learn.sim"))
    parser.add_argument("--compensation", metavar="VERSION", type=_compensation, help=text("help.learn.cut_with"))
    parser.add_argument("--strategy", choices=_names(INVERTING), help=text("help.learn.strategy"))
    parser.add_argument("--stage", choices=STAGES[1:], help=text("help.learn.stage"))
    parser.add_argument("--identified", metavar="FILE", help=text("help.learn.identified"))
    parser.add_argument("--gain", metavar="GAIN", type=_number, help=text("help.learn.gain"))
    parser.add_argument("--extra", metavar="N,N", type=_orders, help=text("help.learn.extra"))
    parser.add_argument("--robust", action="store_true", help=text("help.calibrate.robust"))
    parser.add_argument("--keep", action="store_true", help=text("help.learn.keep"))


def _reproduce(commands: _Commands, text: Catalogue) -> None:
    parser = _command(commands, "reproduce", text)
    parser.add_argument("--quick", action="store_true", help=text("help.reproduce.quick"))
    parser.add_argument("--plot", action="store_true", help=text("help.reproduce.plot"))


def _command(commands: _Commands, name: str, text: Catalogue, key: str = "") -> Parser:
    """Add a command; its help stands under `key`, by default its name."""
    key = key or name
    parser: Parser = commands.add_parser(
        name,
        help=text(f"help.{key}"),
        description=text(f"help.{key}.long"),
        add_help=False,
        allow_abbrev=False,
    )
    _titles(parser, text)
    # Not given here, it stays as it was given before the command.
    parser.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help=text("help.json"))
    parser.add_argument("--data", metavar="FOLDER", default=argparse.SUPPRESS, help=text("help.data"))
    _language(parser, text)
    return parser


def _titles(parser: Parser, text: Catalogue) -> None:
    parser.formatter_class = _Formatter
    parser._positionals.title = text("help.arguments")  # noqa: SLF001 - no public way to name the groups
    parser._optionals.title = text("help.options")  # noqa: SLF001
    parser.add_argument("-h", "--help", action="help", help=text("help.help"))


def _language(parser: Parser, text: Catalogue) -> None:
    parser.add_argument("--lang", choices=LANGUAGES, default=argparse.SUPPRESS, help=text("help.lang"))


def _job(parser: Parser, text: Catalogue) -> None:
    parser.add_argument("job", metavar="JOB", help=text("help.job"))


def _machine(parser: Parser, text: Catalogue) -> None:
    parser.add_argument("--machine", metavar="NAME", default=argparse.SUPPRESS, help=text("help.machine"))


def _plant(parser: Parser, text: Catalogue, absent: str | None = argparse.SUPPRESS) -> None:
    """Add what says how a simulated lathe really is, and is clamped; `absent` stands where nothing is said."""
    _iron(parser, text, absent)
    parser.add_argument(
        "--clamping-sd", metavar="PERCENT", type=_clamping_sd, default=absent, help=text("help.clamping_sd")
    )


def _iron(parser: Parser, text: Catalogue, absent: str | None = argparse.SUPPRESS) -> None:
    parser.add_argument("--plant", metavar="PLANT", type=_plant_word, default=absent, help=text("help.plant"))
    parser.add_argument("--seed", metavar="N", type=_seed, default=absent, help=text("help.seed"))


def _link(parser: Parser, text: Catalogue) -> None:
    parser.add_argument("--link", metavar="ADDRESS", default=argparse.SUPPRESS, help=text("help.link"))
    parser.add_argument("--trace", metavar="FILE", default=argparse.SUPPRESS, help=text("help.trace"))


def _strategy(parser: Parser, text: Catalogue) -> None:
    told = ", ".join(text(f"strategy.{each}.help") for each in Strategy)
    parser.add_argument(
        "--strategy",
        choices=_names(Strategy),
        default=DEFAULT_STRATEGY.value,
        help=text("help.strategy", default=DEFAULT_STRATEGY, strategies=told),
    )
    parser.add_argument("--ts", metavar="MS", type=_ts, help=text("help.ts"))


def _names(strategies: Iterable[Strategy]) -> tuple[str, ...]:
    return tuple(each.value for each in strategies)


def _ts(word: str) -> int:
    if not (word.isascii() and word.isdigit()) or int(word) > TS_LIMIT_MS:
        raise argparse.ArgumentTypeError(Parser.text("usage.ts", value=word, limit=TS_LIMIT_MS))
    return int(word)


def _seed(word: str) -> int:
    if not (word.isascii() and word.isdigit()) or int(word) > SEED_LIMIT:
        raise argparse.ArgumentTypeError(Parser.text("usage.seed", value=word, limit=SEED_LIMIT))
    return int(word)


def _plant_word(word: str) -> str:
    if word not in PLANTS and not word.endswith(".toml"):
        limit = " | ".join((*PLANTS, PLANT_FILE))
        raise argparse.ArgumentTypeError(Parser.text("usage.plant", value=word, limit=limit))
    return word


def _clamping_sd(word: str) -> float:
    percent = _number(word)
    if not 0.0 <= percent <= MOST_CLAMPING_SD_PERCENT:
        limit = f"{MOST_CLAMPING_SD_PERCENT:g}"
        raise argparse.ArgumentTypeError(Parser.text("usage.clamping_sd", value=word, limit=limit))
    return percent


def _frequencies(word: str) -> tuple[float, ...]:
    return tuple(_number(each) for each in word.split(","))


def _orders(word: str) -> tuple[int, ...]:
    return tuple(_whole(each) for each in word.split(","))


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(Parser.text("usage.number", value=word))
    return value


def _whole(word: str) -> int:
    if not (word.isascii() and word.isdigit()) or len(word) > 9:
        raise argparse.ArgumentTypeError(Parser.text("usage.whole", value=word))
    return int(word)


def _compensation(word: str) -> str:
    return word if word in ("none", "newest") else str(_whole(word))


def _parts(word: str) -> int:
    parts = _whole(word)
    if not 1 <= parts <= MOST_PARTS:
        raise argparse.ArgumentTypeError(Parser.text("usage.parts", value=word, limit=MOST_PARTS))
    return parts


def _start(word: str) -> dict[str, float]:
    from drivers.pmac.analysis.start import read_start

    try:
        return read_start(word)
    except ValueError as error:
        raise argparse.ArgumentTypeError(Parser.text("usage.start", value=str(error))) from error


def _host_port(word: str) -> TcpAddress:
    from drivers.link.address import parse_host_port
    from profiles.problem import ProblemError

    try:
        return parse_host_port(word)
    except ProblemError as error:
        raise argparse.ArgumentTypeError(Parser.text.problem(error.problems[0])) from error


def _control(word: str) -> ControlAddress:
    from drivers.simulator.hosts.control_address import parse_control_address
    from profiles.problem import ProblemError

    try:
        return parse_control_address(word)
    except ProblemError as error:
        raise argparse.ArgumentTypeError(Parser.text.problem(error.problems[0])) from error


def _speed(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = 0.0
    if not SLOWEST <= value <= FASTEST:
        raise argparse.ArgumentTypeError(
            Parser.text("usage.speed", value=word, limit=f"{SLOWEST:g} - {FASTEST:g}")
        )
    return value


def _filter(word: str) -> float | None:
    if word == "none":
        return None
    try:
        value = float(word)
    except ValueError:
        value = 0.0
    if not 1.0 <= value <= 10_000.0:
        raise argparse.ArgumentTypeError(Parser.text("usage.filter", value=word))
    return value


def _band(word: str) -> tuple[float, float]:
    low, _, high = word.partition(":")
    try:
        band = float(low), float(high)
    except ValueError:
        band = 0.0, 0.0
    if not 1.0 <= band[0] < band[1] <= 10_000.0:
        raise argparse.ArgumentTypeError(Parser.text("usage.band", value=word))
    return band
