"""What differs between PMAC families, as data: identity, factory defaults and default settings of the link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

MOTOR_COUNT = 8
"""Motors, and coordinate systems, of the non-Turbo controller."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """One family of controllers."""

    name: str
    version_reply: str
    type_reply: str
    global_defaults: Mapping[int, float]
    motor_defaults: Mapping[int, float]
    coordinate_defaults: Mapping[int, float]

    def factory_variables(self) -> dict[int, float]:
        """Return every I-variable as it leaves the factory."""
        values = dict(self.global_defaults)
        for number in range(1, MOTOR_COUNT + 1):
            per_number = {**self.motor_defaults, **self.coordinate_defaults}
            values.update({100 * number + key: value for key, value in per_number.items()})
        return values


PMAC = Dialect(
    name="pmac",
    version_reply="1.17",
    type_reply="PMAC1, X1",
    global_defaults={3: 1, 6: 3, 8: 2, 9: 2, 10: 3_713_707, 12: 10},
    motor_defaults={
        0: 0,
        8: 96,
        9: 96,
        11: 32_000,
        12: 16_000,
        15: 0.25,
        16: 32,
        17: 0.015625,
        19: 0.015625,
        20: 0,
        21: 50,
        22: 32,
        23: 32,
        28: 160,
        30: 2000,
        31: 1280,
        32: 1280,
        34: 1,
        63: 4_194_304,
        69: 20_480,
    },
    coordinate_defaults={87: 0, 88: 50, 89: 1000, 90: 1000, 95: 1644},
)
"""The paper's controller. Replies and defaults that no source confirms are choices (docs/pmac-emulation.md)."""
