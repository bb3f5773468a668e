"""Running a program without motion: its text in, what it asks for out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.structure import ExecutableProgram, link
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.requests import BlendBreak, EndOfProgram, Request
from drivers.pmac.settings import settings_with
from drivers.pmac.variables import VariableStore

ORIGIN = {"X": 0.0, "Y": 0.0, "Z": 0.0}


def code_of(text: str) -> ExecutableProgram:
    return link(tuple(parse_line(line) for line in text.split("\n")))


@dataclass
class Listener:
    """A host that writes down what it is told."""

    heard: list[tuple[object, ...]] = field(default_factory=list)

    def command(self, text: str, port: str) -> None:
        self.heard.append(("command", text, port))

    def send(self, text: str, port: str) -> None:
        self.heard.append(("send", text, port))

    def display(self, text: str) -> None:
        self.heard.append(("display", text))

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        self.heard.append(
            (("resume" if enable else "pause") if keeping else ("enable" if enable else "disable"), *numbers)
        )


class Bench:
    """One coordinate system: its variables, modes and programs outlive a run."""

    def __init__(self, dialect: Dialect = PMAC, system: int = 1, **variables: float) -> None:
        self.store = VariableStore(settings_with({}, dialect), dialect)
        self.system = system
        self.modes = Modes()
        self.host = Listener()
        self.programs: dict[int, str] = {}
        for name, value in variables.items():
            self.store.set(VariableKind(name[0]), int(name[1:]), value, system)

    def value(self, name: str) -> float:
        return self.store.get(VariableKind(name[0]), int(name[1:]), self.system)

    def start(
        self,
        text: str,
        positions: Mapping[str, float] = ORIGIN,
        label: int | None = None,
        strict: bool = True,
        number: int = 0,
    ) -> ProgramRun:
        return ProgramRun(
            code_of(text),
            self.store,
            self.modes,
            positions,
            self.system,
            strict,
            library=self.library,
            host=self.host,
            label=label,
            number=number,
        )

    def library(self, number: int) -> ExecutableProgram | None:
        text = self.programs.get(number)
        return None if text is None else code_of(text)

    def run(self, text: str, positions: Mapping[str, float] = ORIGIN, looks: int = 1000) -> list[Request]:
        """Return every request up to the end, without that."""
        return requests_of(self.start(text, positions), looks)


def requests_of(run: ProgramRun, looks: int = 1000) -> list[Request]:
    requests: list[Request] = []
    for _ in range(looks):
        request = run.advance()
        if isinstance(request, EndOfProgram):
            return requests
        if not isinstance(request, BlendBreak):
            requests.append(request)
    raise AssertionError(f"no end after {looks} requests")


def targets(requests: list[Request], axis: str = "X") -> list[float]:
    """Where the moves go."""
    return [request.targets[axis] for request in requests if hasattr(request, "targets")]
