"""Write gains of the tool: Ix30 to Ix33, drives disabled, each read back. Nothing is saved in the controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.commissioning.gains import Write, apply
from drivers.commissioning.judged import same
from drivers.commissioning.reading import read_settings
from drivers.errors import DriverError
from drivers.identification.tool_loop import ToolLoop, read_tool_loop
from drivers.pmac.client import PmacClient
from drivers.pmac.language.text import format_constant
from profiles.problem import Problem

WRITTEN = (30, 31, 32, 33)
"""Ix30 to Ix33: what a proposal changes. Scales, integration mode, notch filter and limits are never written."""


@dataclass(frozen=True, slots=True)
class ToolGains:
    """The gains of the tool in one controller."""

    client: PmacClient
    motor: int

    @property
    def names(self) -> tuple[str, ...]:
        """The names of what is written, as in a profile."""
        return tuple(f"I{self.motor}{number}" for number in WRITTEN)

    @property
    def indices(self) -> Mapping[str, int]:
        """The number of each I-variable by its name."""
        dialect = self.client.dialect
        return {f"I{self.motor}{number}": dialect.motor_index(self.motor, number) for number in WRITTEN}

    def loop(self, at: str) -> ToolLoop:
        """Read the whole loop; errors as `read_tool_loop`."""
        return read_tool_loop(self.client, self.client.dialect, self.motor, at)

    def read(self) -> dict[str, float]:
        """Read the gains that are written. Raises DriverError: the link broke."""
        found = read_settings(self.client, self.indices.values())
        return {name: found[index] for name, index in self.indices.items()}

    def write(self, values: Mapping[str, float]) -> None:
        """Write each value that differs, read it back, and read all of them once more at the end.

        Raises:
            RefusedError: `controller.drives_on`, `controller.program_running`; nothing was written.
            ControllerError: the controller refused a line; what was written before stands.
            DriverError: `controller.not_taken`, a value differs; nothing was sent after it.
            LinkError: the link broke; whether its last line was executed is unknown.
        """
        found = self.read()
        writes = tuple(self._write(name, value, found[name]) for name, value in values.items())
        apply(self.client, self.client.dialect, [each for each in writes if each.wanted != each.found])
        after = self.read()
        for each, (name, value) in zip(writes, values.items(), strict=True):
            if not same(after[name], value):
                stands = format_constant(after[name])
                raise DriverError(
                    Problem(code="controller.not_taken", key=each.line, value=stands, limit=each.wanted)
                )

    def _write(self, name: str, value: float, found: float) -> Write:
        text, question = format_constant(value), f"I{self.indices[name]}"
        return Write(f"{question}={text}", question, text, format_constant(found))


def matches(found: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    """Whether every wanted gain was found; a filter that nobody wrote down is none."""
    return all(same(found.get(name, 0.0), value) for name, value in wanted.items())
