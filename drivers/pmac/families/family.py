"""The differences between the families of controllers, as fields; no other code asks for the family."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum, auto
from functools import cached_property
from typing import TypeVar

from drivers.pmac.memory import WORD_BITS
from drivers.pmac.status import BitTable

_Value = TypeVar("_Value")


class SettingScope(StrEnum):
    """The owner of an I-variable setting."""

    GLOBAL = auto()
    MOTOR = auto()
    SYSTEM = auto()


@dataclass(frozen=True, slots=True)
class SettingPlace:
    """The number of a setting: I`number` of the controller, Ix`number` of a motor or of a coordinate system."""

    scope: SettingScope
    number: int


@dataclass(frozen=True, slots=True)
class Register:
    """The register of motor or system 1, and the spacing to those of the others.

    `space` as in M-variable definitions: X or Y (24 bits), D (48 bits) or L (floating).
    """

    space: str
    address: int
    stride: int = 0
    scope: SettingScope = SettingScope.MOTOR


@dataclass(frozen=True, slots=True)
class Watchdog:
    """How long a background cycle may take before the controller shuts itself down.

    Every background cycle it restarts at I`number`, counts down, and trips below zero; if that is 0, or there is
    no such setting, it starts at `count`. It counts servo cycles, `of_interrupts` real-time interrupts.
    """

    count: int
    number: int | None = None
    of_interrupts: bool = False


@dataclass(frozen=True, slots=True)
class ConversionTable:
    """The encoder conversion table: results in X from `first_address`, set-up in Y at the same addresses.

    The set-up of a line is also I`first_setting` and so on, in families where it is not plain memory (None). By
    factory default, the first lines are the encoders at the `channels`, 1, 2 and so on; `factory` follows them.
    """

    first_address: int
    lines: int
    channels: tuple[int, ...]
    factory: tuple[int, ...] = ()
    first_setting: int | None = None

    @property
    def setup(self) -> tuple[int, ...]:
        """The factory default words of the first lines."""
        return (*self.channels, *self.factory)


@dataclass(frozen=True, slots=True)
class UserBuffer:
    """Where the words of DEFINE UBUFFER are: the last ones before the end of memory, down to `start` at most.

    `ends` are those of the sizes of memory, the smallest first. Where the words begin is reported by the setting,
    or by the X word at the address, that the family has for it.
    """

    start: int
    ends: tuple[int, ...]
    setting: int | None = None
    x_address: int | None = None


@dataclass(frozen=True, slots=True)
class PhaseClock:
    """The phase interrupts: a servo cycle has I`divider` + 1 of them; what counts their period has this rate."""

    divider: int
    counts_per_ms: float


@dataclass(frozen=True, slots=True)
class BufferDirectory:
    """Where memory names the programs: a long word for each, one for each PLC, and where text begins."""

    programs: range
    plcs: range
    storage: int


@dataclass(frozen=True, slots=True)
class GatherSettings:
    """The I-variables of data gathering: the period in servo cycles, masks of 24 sources each, the addresses."""

    period: int
    masks: tuple[int, ...]
    first_source: int

    @property
    def source_count(self) -> int:
        """Number of sources: one for each bit of the masks."""
        return WORD_BITS * len(self.masks)


class FamilySetting(StrEnum):
    """The settings whose number or scope is not the same in every family.

    Settings that are the same everywhere (I10, Ix16, Ix87 ...) are addressed by number.
    """

    JOG_DELAY_MS = auto()  # Calculation delay before a jog, a home search or a RAPID move
    SEGMENT_MS = auto()  # Segmentation time of LINEAR and CIRCLE moves; 0 is none
    IN_POSITION_LOOKS = auto()  # Additional polls that in-position needs, beyond the first
    RAPID_AT_PROGRAM_SPEED = auto()
    """Whether RAPID goes at Ix16 (not 0) or at the jog speed Ix22 (0)."""
    LEAST_ARC = auto()  # Half turns below which the angle of a circle move is a full turn more; 0 is 2^-20
    FLAG_MODE = auto()
    """Use of flags and what a fault disables: bit 17 no travel limits, bits 21 and 22 the neighbours."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Dialect:
    """One family of controllers. `replies` are the replies to words such as VERSION, without an end of line.

    It is equal to itself only, so that it can be a key.

    `type_prefix` is how the reply to TYPE begins, whichever controller of the family it is.

    `system_offset` + 100 x + nn is the index of Ixnn of coordinate system x; motors have 100 x + nn everywhere. A
    word that is not among `replies` does not exist in the family. `axis_codes` are the values of bits 16 to 19 of
    the second word of `?` for each axis. P is reported in steps of `position_step` counts. `hexadecimal` settings
    hold addresses. `registers` are the suggested targets of M-variables.

    `highest_index` is that of I, P, Q and M. `global_ranges`, `motor_ranges` and `system_ranges` give the lowest
    value and the number of values of the I-variables that wrap; `motor_fractions` have 24 bits with their sign, so
    many of them behind the point, and wrap as well. The others are floating point.

    `segment_time_switch` is the I-variable that gives SPLINE and PVT moves their time by TM while it is 0, in
    steps of `segment_step_ms` up to `longest_segment_ms`; without one, or if it is not 0, TA does, in whole ms.
    `other_axes_speed` is the Ix-number of a coordinate system with the speed of axes that F does not cover;
    without one, a move of such axes alone takes no time of its own. `offset_following` is the Ix-number of a
    motor, and the bit of it, that keep following out of the position. `no_line_feeds_switch` is the I-variable
    (ASCII through the DPRAM) that removes the line feeds of I3.

    `variable_addresses` are the L words of P0 and Q0, `definitions_address` is the long word of M0's definition;
    the others follow.

    `timer_numbers` are the Ix-numbers of a coordinate system that count down, for the systems up to the value of
    I`system_activation` + 1; `timer_words` are memory words that do, by space and address. `velocity_average` are
    the I-variables over which V is averaged, period less one and shift. `kinematics` is the Ix-number of a
    coordinate system that switches its kinematic programs on, where there are any.
    """

    name: str
    type_prefix: str
    replies: Mapping[str, str]
    motor_count: int
    system_count: int
    highest_index: int
    system_offset: int
    places: Mapping[FamilySetting, SettingPlace]
    global_defaults: Mapping[int, float]
    motor_defaults: Mapping[int, float]
    system_defaults: Mapping[int, float]
    global_ranges: Mapping[int, tuple[int, int]]
    motor_ranges: Mapping[int, tuple[int, int]]
    motor_fractions: Mapping[int, int]
    system_ranges: Mapping[int, tuple[int, int]]
    motor_bits: BitTable
    system_bits: BitTable
    system_words: int
    global_bits: BitTable
    axis_codes: Mapping[str, int]
    position_step: float
    highest_address: int
    global_addresses: tuple[int, ...]
    motor_addresses: tuple[int, ...]
    system_addresses: tuple[int, ...]
    registers: Mapping[str, Register]
    conversion_table: ConversionTable
    gathering: GatherSettings
    offset_following: tuple[int, int]
    watchdog: Watchdog
    variable_addresses: Mapping[str, int]
    definitions_address: int
    segment_time_switch: int | None = None
    segment_step_ms: float = 1.0
    longest_segment_ms: float = 8_388_607.0
    other_axes_speed: int | None = None
    system_activation: int | None = None
    timer_numbers: tuple[int, ...] = ()
    timer_words: tuple[tuple[str, int], ...] = ()
    no_line_feeds_switch: int | None = None
    velocity_average: tuple[int, int] | None = None
    kinematics: int | None = None
    buffer_directory: BufferDirectory | None = None
    user_buffer: UserBuffer | None = None
    phase_clock: PhaseClock | None = None

    def numbers(self, scope: SettingScope) -> range:
        """Return the numbers of the motors, or of the coordinate systems; a single instance is number 1."""
        counts = {
            SettingScope.GLOBAL: 1,
            SettingScope.MOTOR: self.motor_count,
            SettingScope.SYSTEM: self.system_count,
        }
        return range(1, counts[scope] + 1)

    def motor_index(self, motor: int, number: int) -> int:
        """Return the index of Ix`number` of a motor."""
        return 100 * motor + number

    def system_index(self, system: int, number: int) -> int:
        """Return the index of Ix`number` of a coordinate system."""
        return self.system_offset + 100 * system + number

    def index(self, setting: FamilySetting, owner: int = 1) -> int:
        """Return the index of a setting; `owner` is the motor or the coordinate system, where it has one."""
        place = self.places[setting]
        if place.scope is SettingScope.GLOBAL:
            return place.number
        index_of = self.motor_index if place.scope is SettingScope.MOTOR else self.system_index
        return index_of(owner, place.number)

    @cached_property
    def factory(self) -> Mapping[int, float]:
        """Factory default of every I-variable; missing ones are 0."""
        return self._spread(self.global_defaults, self.motor_defaults, self.system_defaults)

    @cached_property
    def settings(self) -> Mapping[int, tuple[FamilySetting, int]]:
        """The setting of a family-dependent number, and its motor or coordinate system, by index."""
        return {
            self.index(setting, owner): (setting, owner)
            for setting, place in self.places.items()
            for owner in self.numbers(place.scope)
        }

    @cached_property
    def ranges(self) -> Mapping[int, tuple[int, int]]:
        """The lowest value and the number of values, by index."""
        return self._spread(self.global_ranges, self.motor_ranges, self.system_ranges)

    @cached_property
    def fractions(self) -> Mapping[int, int]:
        """The bits behind the point of what holds a fraction in 24 bits with its sign, by index."""
        return self._spread({}, self.motor_fractions, {})

    @cached_property
    def hexadecimal(self) -> frozenset[int]:
        """The I-variables that hold addresses, by index."""
        numbers = (self.global_addresses, self.motor_addresses, self.system_addresses)
        return frozenset(self._spread(*(dict.fromkeys(listed, True) for listed in numbers)))

    def _spread(
        self, card: Mapping[int, _Value], motors: Mapping[int, _Value], systems: Mapping[int, _Value]
    ) -> dict[int, _Value]:
        spread = dict(card)
        for motor in self.numbers(SettingScope.MOTOR):
            spread.update({self.motor_index(motor, number): value for number, value in motors.items()})
        for system in self.numbers(SettingScope.SYSTEM):
            spread.update({self.system_index(system, number): value for number, value in systems.items()})
        return spread
