"""What one status poll asks for, and how its replies become a snapshot.

Apart from the snapshot, which the first picture is painted from before anything of a controller is known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from types import MappingProxyType

from drivers.errors import LinkError
from drivers.lathe.safety import inputs_of
from drivers.lathe.snapshot import AxisState, Snapshot, driven_axes
from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import number_of
from drivers.pmac.status import decode
from profiles.machine import MachineProfile
from profiles.problem import Problem


class SnapshotItems:
    """The items of one request: each motor, the program, the console's words, the safety inputs."""

    def __init__(self, machine: MachineProfile, dialect: Dialect) -> None:
        """Read the inputs that the profile names. Raises DriverError: `safety.bad_input`."""
        motors = (machine.tool.motor, machine.spindle.motor, machine.carriage.motor)
        self.driven = driven_axes(machine)
        self.inputs = inputs_of(machine.safety)
        # The same words come again in most polls, and their meaning depends on nothing else.
        self._motor_flags = lru_cache(maxsize=256)(partial(decode, table=dialect.motor_bits))
        self._system_flags = lru_cache(maxsize=256)(partial(decode, table=dialect.system_bits))
        self._axis, self._number = lru_cache(maxsize=64)(self._axis_of), lru_cache(maxsize=64)(number_of)
        self._inputs = lru_cache(maxsize=64)(self._inputs_of)
        self.items = (
            *(item for motor in motors for item in (f"#{motor}P", "F", "?")),
            "&1??",
            "%",
            f"P{reserved.OWNER}",
            f"P{reserved.LOST}",
            *dict.fromkeys(each.item for each in self.inputs),
        )

    def read(self, replies: Sequence[str], asked_s: float, at_s: float, where: str) -> Snapshot:
        """Make a snapshot of the replies to `items`. Raises LinkError: `link.out_of_step`."""
        try:
            tool, spindle, carriage = (self._axis(*replies[start : start + 3]) for start in (0, 3, 6))
            status, override, owner, lost, *words = replies[9:]
            system = self._system_flags(status)
            return Snapshot(
                asked_s=asked_s,
                at_s=at_s,
                tool=tool,
                spindle=spindle,
                carriage=carriage,
                program_running="running_program" in system,
                runtime_error="runtime_error" in system,
                driven=self.driven,
                owner=int(self._number(owner)),
                lost=int(self._number(lost)),
                override_percent=self._number(override),
                inputs=self._inputs(*words),
            )
        except ValueError as error:
            problem = Problem(code="link.out_of_step", where=where, key=" ".join(self.items), value=str(error))
            raise LinkError(problem) from error

    def _axis_of(self, position: str, error: str, status: str) -> AxisState:
        axis = AxisState(number_of(position), number_of(error), self._motor_flags(status))
        if "open_loop" in axis.flags:  # then the controller reports no desired velocity
            return replace(axis, flags=axis.flags | {"desired_velocity_zero"})
        return axis

    def _inputs_of(self, *words: str) -> Mapping[str, bool]:
        items = dict.fromkeys(each.item for each in self.inputs)
        actual = {item: int(number_of(word)) for item, word in zip(items, words, strict=True)}
        good: dict[str, bool] = {}
        for each in self.inputs:  # a device with two contacts is safe when both are
            good[each.device] = good.get(each.device, True) and each.is_good(actual[each.item])
        return MappingProxyType(good)
