"""Running a PLC by itself: its text in, what it tells its host out."""

from __future__ import annotations

from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.language.plc_statements import PlcCode, link_plc, parse_plc_line, stored_lines
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.plcs.plc import Addressed, PlcFault, PlcRun
from drivers.pmac.settings import settings_with
from drivers.pmac.variables import VariableStore


def code_of(text: str) -> PlcCode:
    return link_plc(tuple(line for typed in text.split("\n") for line in stored_lines(parse_plc_line(typed))))


class PlcListener:
    """A host that writes down what it is told."""

    def __init__(self) -> None:
        self.heard: list[tuple[object, ...]] = []

    def command(self, text: str, port: str, addressed: Addressed) -> None:
        self.heard.append(("command", text, port, addressed.motor, addressed.system))

    def send(self, text: str, port: str) -> None:
        self.heard.append(("send", text, port))

    def display(self, text: str) -> None:
        self.heard.append(("display", text))

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        self.heard.append(("enable" if enable else "disable", *numbers))


class PlcBench:
    """One PLC with the variables of a card."""

    def __init__(self, text: str, dialect: Dialect = PMAC, **variables: float) -> None:
        self.store = VariableStore(settings_with({}, dialect), dialect)
        self.host = PlcListener()
        for name, value in variables.items():
            self.set(name, value)
        self.run = PlcRun(code_of(text), self.store, self.host)

    def set(self, name: str, value: float, system: int = 1) -> None:
        self.store.set(VariableKind(name[0]), int(name[1:]), value, system)

    def value(self, name: str, system: int = 1) -> float:
        return self.store.get(VariableKind(name[0]), int(name[1:]), system)

    def scan(self) -> PlcFault | None:
        return self.run.scan()

    def said(self) -> list[tuple[object, ...]]:
        """What the host has heard since the last look."""
        heard, self.host.heard = self.host.heard, []
        return heard
