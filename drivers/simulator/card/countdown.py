"""Timers of the controller: not updated while they count; the value is computed when read."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping

from drivers.pmac.dialect import Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.plcs.plc import LOWEST_COUNT, timer_variables
from drivers.pmac.variables import VariableStore

_I = VariableKind.I
_LOWEST = float(LOWEST_COUNT)


class Countdown:
    """Timers by name, from 0: the value written, and the servo cycle of writing; some do not run."""

    def __init__(self, names: Iterable[Hashable], now: Callable[[], int]) -> None:
        """Let all timers run; `now` returns the number of servo cycles so far."""
        self._now = now
        self._written: dict[Hashable, tuple[float, int]] = {name: (0.0, now()) for name in names}
        self._running = frozenset(self._written)

    def __contains__(self, name: object) -> bool:
        """Whether the timer exists."""
        return name in self._written

    def read(self, name: Hashable) -> float:
        """Return the present value of a timer."""
        value, since = self._written[name]
        # As `count_down`, for a single timer: each PLC scan reads it.
        return max(_LOWEST, value - (self._now() - since)) if name in self._running else value

    def write(self, name: Hashable, value: float) -> None:
        """Let a timer continue from a value."""
        self._written[name] = value, self._now()

    def run_only(self, names: Iterable[Hashable]) -> None:
        """Let these continue from their values, and stop the others."""
        now = self._now()
        self._written = {name: (self.read(name), now) for name in self._written}
        self._running = frozenset(names)


class TimedVariables(VariableStore):
    """The variables of a controller, of which some I-variables are timers. SAVE does not keep the timers."""

    def __init__(self, i_variables: Mapping[int, float], dialect: Dialect, now: Callable[[], int]) -> None:
        self._timer_numbers = frozenset(timer_variables(dialect, dialect.system_count))
        self._timers = Countdown(self._timer_numbers, now)
        super().__init__({}, dialect)
        self.replace_i(i_variables)

    def i(self, index: int) -> float:
        """Return an I-variable."""
        value = self._i.get(index)
        if value is not None:
            return value
        return self._timers.read(index) if index in self._timer_numbers else 0.0

    def replace_i(self, values: Mapping[int, float]) -> None:
        """Replace the whole set of I-variables; timers not among them start at 0."""
        super().replace_i({index: value for index, value in values.items() if index not in self._timer_numbers})
        for index in self._timer_numbers:
            self._timers.write(index, values.get(index, 0.0))
        self._follow_activation()

    def _read(self, kind: VariableKind, index: int, system: int) -> float | None:
        if kind is _I and index in self._timer_numbers:
            return self._timers.read(index)
        return super()._read(kind, index, system)

    def _set_i(self, index: int, value: float) -> None:
        if index in self._timer_numbers:
            # Timers do not change `i_revision`: a PLC that writes one in each scan must not cause all settings to
            # be reread.
            revision = self.i_revision
            super()._set_i(index, value)
            self._timers.write(index, self._i.pop(index))
            self.i_revision = revision
            return
        super()._set_i(index, value)
        if index == self.dialect.system_activation:
            self._follow_activation()

    def _follow_activation(self) -> None:
        activation = self.dialect.system_activation
        if activation is not None:
            self._timers.run_only(timer_variables(self.dialect, super().i(activation)))
