"""The program of an air cut: spindle at speed, tool on the fastest lobe, carriage at a feed.

Like every cutting program, it checks the end flag and the watchdog at the end of each turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from drivers.commissioning.checked_configuration import CheckedConfiguration
from drivers.commissioning.rules import LOBE_AMPLITUDE_UM, LOBE_FREQUENCY_HZ
from drivers.pmac import reserved
from drivers.pmac.axes import AxisDefinition, read_definitions
from drivers.pmac.heartbeat.plc import Policy
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.language.text import format_number
from drivers.pmac.programs.setup import sign_program
from profiles.machine import MachineProfile

PROGRAM = 999
SPINDLE_START = "P22"  # P-variable of the console: the spindle position when the program begins, counts
SEGMENT_MS = 4  # a whole number of ms, in every family; a lobe of 50 Hz has five of them
HALF_RUN_UP_MS = 500
APPROACH_MS = 200
GROWING = 50  # segments over which the lobe grows
DEPTH_MM = 1.0  # distance of the tool's lobe from where the tool began
FEED_MM = 0.1  # carriage feed per turn
LONGEST_MS = 3500.0  # a cut that is not ended from outside ends by itself after this time at full speed


@dataclass(frozen=True, slots=True, kw_only=True)
class AirCut:
    """The speeds of an air cut, counts/ms; the tool's is the maximum of its lobe, of `amplitude` counts."""

    turn_ms: int
    amplitude: float
    tool: float
    spindle: float
    carriage: float

    @property
    def speeds(self) -> Mapping[str, float]:
        """By axis."""
        return {"tool": self.tool, "spindle": self.spindle, "carriage": self.carriage}

    @property
    def full_speed_s(self) -> float:
        """When the lobe has its full amplitude, s after the start."""
        return (2 * HALF_RUN_UP_MS + APPROACH_MS + GROWING * SEGMENT_MS) / 1000.0


def air_cut(machine: MachineProfile) -> AirCut:
    """Return the fastest cut of this machine: a lobe of 50 Hz, or the limit of its spindle."""
    fastest_ms = max(1000.0 * machine.chuck.jaws / LOBE_FREQUENCY_HZ, 60_000.0 / machine.spindle.max_speed_rpm)
    turn_ms = SEGMENT_MS * math.ceil(fastest_ms / SEGMENT_MS)
    amplitude = LOBE_AMPLITUDE_UM / machine.tool.count_um
    return AirCut(
        turn_ms=turn_ms,
        amplitude=amplitude,
        tool=amplitude * math.tau * machine.chuck.jaws / turn_ms,
        spindle=machine.spindle.counts_per_rev / turn_ms,
        carriage=FEED_MM * machine.carriage.counts_per_mm / turn_ms,
    )


@dataclass(frozen=True, slots=True)
class AxisStart:
    """The starting position of an axis, counts, and the direction with free travel, +1 or -1."""

    counts: float
    direction: int


def lobe_ends(machine: MachineProfile, tool: AxisStart) -> tuple[float, float]:
    """Return the reversal points of the tool, counts."""
    mean, amplitude = _mean(machine, tool), air_cut(machine).amplitude
    return mean - amplitude, mean + amplitude


def _mean(machine: MachineProfile, tool: AxisStart) -> float:
    return tool.counts + tool.direction * DEPTH_MM * machine.tool.counts_per_mm


def air_cut_lines(
    judged: CheckedConfiguration, policy: Policy, tool: AxisStart, carriage: AxisStart
) -> tuple[str, ...]:
    """Return the program; it moves tool and carriage from their start in the direction of free travel."""
    return tuple(sign_program("\n".join(_AirCutWriter(judged, policy, tool, carriage).lines())).splitlines())


@dataclass(frozen=True, slots=True)
class _Word:
    """The word of one axis, from an expression in counts and another in counts/ms."""

    definition: AxisDefinition
    unit_ms: float

    def word_at(self, place: str, speed: str = "0") -> str:
        """Return the word for a position with the speed there."""
        offset, scale = self.definition.offset, self.definition.scale
        counts = f"({place}-({format_number(offset)}))" if offset else f"({place})"
        per_unit = format_number(self.unit_ms / scale)
        divided = counts if scale == 1.0 else f"({counts}/({format_number(scale)}))"
        return f"{self.definition.axis}{divided}:({speed}*({per_unit}))"


class _AirCutWriter:
    """Writes the program; P25 counts segments, P26 those of growth, P27 is the fraction, P28 the turn's end."""

    def __init__(self, judged: CheckedConfiguration, policy: Policy, tool: AxisStart, carriage: AxisStart) -> None:
        machine = judged.machine
        unit_ms = judged.of_system(90)  # the time unit of speeds
        self._machine, self._cut = machine, air_cut(machine)
        self._words = {
            each.motor: _Word(each, unit_ms) for each in read_definitions(machine.controller.axis_definitions)
        }
        self._out, self._mean = format_number(tool.counts), format_number(_mean(machine, tool))
        self._begin, self._speed = format_number(carriage.counts), carriage.direction * self._cut.carriage
        self._fed = f"{self._begin}+{format_number(self._speed * SEGMENT_MS)}*P25"
        self._alive = "" if policy is Policy.FINISH else f" AND {watchdog_condition(judged.dialect)}"

    def lines(self) -> Iterator[str]:
        flag = f"M{reserved.END_FLAG}"
        yield from (f"OPEN PROG{PROGRAM}", "CLEAR", "ABS", f"{flag}=0", "P25=0", "P26=0", "P28=0")
        yield f"PVT{HALF_RUN_UP_MS} ; the spindle runs up"
        yield self._point(self._out, format_number(HALF_RUN_UP_MS / 6.0), 0.5)
        yield self._point(self._out, str(HALF_RUN_UP_MS))
        yield f"PVT{APPROACH_MS} ; the tool goes to the mean depth of its lobe"
        yield self._point(self._mean, str(HALF_RUN_UP_MS + APPROACH_MS))
        yield from self._turns(flag)
        end = self._fed
        yield f"PVT{APPROACH_MS} ; the tool goes out"
        yield self._point(self._out, self._since(APPROACH_MS), carriage=end)
        yield f"PVT{HALF_RUN_UP_MS} ; the spindle runs down"
        yield self._point(self._out, self._since(APPROACH_MS + HALF_RUN_UP_MS * 5.0 / 6.0), 0.5, carriage=end)
        yield self._point(self._out, self._since(APPROACH_MS + HALF_RUN_UP_MS), 0.0, carriage=end)
        yield "CLOSE"

    def _turns(self, flag: str) -> Iterator[str]:
        """Write the turns of growth and of full lobe; the cut may end at the end of a turn, tool outermost."""
        cut = self._cut
        a_turn = cut.turn_ms // SEGMENT_MS
        angle = f"P25*{format_number(360.0 * self._machine.chuck.jaws / a_turn)}"
        most = math.ceil(LONGEST_MS / cut.turn_ms) * a_turn
        yield f"PVT{SEGMENT_MS} ; the lobe grows, and then goes on"
        yield f"WHILE(P25<P28 OR {flag}=0{self._alive} AND P28<{most})"
        yield f"IF(P25!<P28) P28=P28+{a_turn} ; the end of the next turn"
        yield "P25=P25+1"
        yield f"IF(P26<{GROWING}) P26=P26+1"
        yield f"P27=P26/{GROWING}"
        place = f"{self._mean}-{format_number(cut.amplitude)}*P27*COS({angle})"
        speed = f"{format_number(cut.tool)}*P27*SIN({angle})"
        feed = format_number(self._speed)
        yield self._point(place, self._since(0.0), tool_speed=speed, carriage=self._fed, feed=feed)
        yield "ENDWHILE"

    def _since(self, more_ms: float) -> str:
        """Return the time of the spindle at full speed up to a segment, ms, plus an offset."""
        return f"({format_number(HALF_RUN_UP_MS + APPROACH_MS + more_ms)}+{SEGMENT_MS}*P25)"

    def _point(
        self,
        tool: str,
        spindle_ms: str,
        fraction: float = 1.0,
        *,
        tool_speed: str = "0",
        carriage: str = "",
        feed: str = "0",
    ) -> str:
        """Return a line for the spindle's travel, in ms of full speed, and its fraction of full speed."""
        machine, speed = self._machine, format_number(self._cut.spindle)
        words = [self._words[machine.tool.motor].word_at(tool, tool_speed)]
        if not machine.spindle.followed:
            turned = f"{SPINDLE_START}+{speed}*{spindle_ms}"
            words.append(
                self._words[machine.spindle.motor].word_at(turned, format_number(self._cut.spindle * fraction))
            )
        words.append(self._words[machine.carriage.motor].word_at(carriage or self._begin, feed))
        return " ".join(words)
