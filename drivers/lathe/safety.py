"""The safety devices that the controller sees, and whether the machine may be moved with them.

The profile names each device in the controller's language: `guard->Y:$FFC2,3=1` is bit 3 of a word, which is 1
when the guard is closed. The console reads the devices and refuses motion accordingly. The console is not a
safety device; only the devices themselves protect people.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from drivers.errors import DriverError
from profiles.machine import SAFETY_DEVICES, MachineProfile, Safety, is_signature
from profiles.problem import Problem

WIRED, NOT_FITTED = "wired", "not fitted"
FORM = "DEVICE->X|Y:$ADDRESS,BIT=0|1"
WORD_BITS = 24

_WORD = r"(?P<space>[XY]):\$(?P<address>[0-9A-F]{1,6})"
_INPUT = re.compile(rf"(?P<device>\w+)->{_WORD},(?P<bit>\d{{1,2}})=(?P<good>[01])")


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyInput:
    """One bit of a controller word. `item` queries the word, `good` is the value of the bit in the safe state."""

    device: str
    item: str
    bit: int
    good: int

    def is_good(self, word: int) -> bool:
        """Whether the device is in its safe state, by the word that was read."""
        return (word >> self.bit) & 1 == self.good


def inputs_of(safety: Safety) -> tuple[SafetyInput, ...]:
    """Return the safety devices that the controller sees. Raises DriverError: `safety.bad_input`, all of them."""
    found = [_read(text) for text in safety.inputs]
    problems = [each for each in found if isinstance(each, Problem)]
    if problems:
        raise DriverError(*problems)
    return tuple(each for each in found if isinstance(each, SafetyInput))


def safety_problems(machine: MachineProfile, inputs: Mapping[str, bool]) -> tuple[Problem, ...]:
    """Return why nobody may be near this machine while it moves; `inputs` are the devices that were read."""
    return (*_find_unfitted_devices(machine.safety), *device_problems(inputs))


def device_problems(inputs: Mapping[str, bool]) -> tuple[Problem, ...]:
    """Return the devices in the wrong state: nothing may be moved then."""
    return tuple(
        Problem(code="safety.not_good", key=f"safety.{device}") for device, good in inputs.items() if not good
    )


def _find_unfitted_devices(safety: Safety) -> Iterator[Problem]:
    for device, fitted in safety.devices.items():
        key = f"safety.{device}"
        if fitted == NOT_FITTED and not is_signature(safety.signed_by):
            yield Problem(code="safety.not_signed", key=key, value=fitted, limit="safety.signed_by")
        elif fitted not in (WIRED, NOT_FITTED):
            yield Problem(code="safety.unknown", key=key, value=fitted, limit=f"{WIRED} | {NOT_FITTED}")


def _read(text: str) -> SafetyInput | Problem:
    found = _INPUT.fullmatch(text.replace(" ", ""))
    if found is None or found["device"] not in SAFETY_DEVICES or int(found["bit"]) >= WORD_BITS:
        limit = f"{FORM}; {', '.join(SAFETY_DEVICES)}; BIT < {WORD_BITS}"
        return Problem(code="safety.bad_input", key="safety.inputs", value=text, limit=limit)
    return SafetyInput(
        device=found["device"],
        item=f"R{found['space']}${found['address']}",
        bit=int(found["bit"]),
        good=int(found["good"]),
    )
