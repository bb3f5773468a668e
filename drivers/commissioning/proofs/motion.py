"""Tests that need motion, in air: the delay of a table's source, and PVT times."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.commissioning.check import Check
from drivers.commissioning.proofs.bench import POLL_S, SETTLE_S, ProofRig, proof, unproven
from drivers.commissioning.reading import ask_or_none
from drivers.pmac.axes import read_definitions
from drivers.pmac.compensation.table import CompensationTable, TableDefinition, TableSource
from drivers.pmac.gathering.gather_client import DataGathering, GatheredData
from drivers.pmac.language.text import format_constant
from drivers.pmac.status import decode

PROGRAM = 999
COUNTER = "P1010"
PVT_MS, PAIRS = 10.4, 200
"""Segments with a time that is no whole number of ms, and how often there and back."""

STEP_COUNTS = 10.0
JOG_S = 1.5
RAMP_S = 0.6
SAMPLES = 200
LONGEST_DELAY = 3
REST_TIMEOUT_S = 10.0
CAM_COUNTS = 200
"""Height of the cam over half a turn, on a killed motor."""

ENTRY = 16


def source_delay(bench: ProofRig) -> Check:
    """Measure the delay of a table's source in servo cycles, for a target on each side of it.

    Only the spindle is closed; its jog ends by itself; tool and carriage stay killed.
    """
    spindle = bench.motor("spindle")
    targets = {name: bench.motor(name) for name in ("tool", "carriage")}
    wanted = {name: int(spindle > motor) for name, motor in targets.items()}
    found = {name: _delay(bench, spindle, motor) for name, motor in targets.items()}
    told, asked = (", ".join(f"{name} {delay}" for name, delay in each.items()) for each in (found, wanted))
    return proof("source_delay", holds=found == wanted, found=told, wanted=asked)


def pvt_rounding(bench: ProofRig) -> Check:
    """Measure PVT segments of fractional ms; the carriage oscillates by ten counts."""
    if ask_or_none(bench.client, f"LIST PROG{PROGRAM}"):
        return unproven(["pvt_rounding"])[0]  # somebody else's program is there
    value = bench.client.numbers(COUNTER, again=True)[0]
    try:
        _load(bench)
        found_ms = _run(bench) / (2 * PAIRS)
    finally:
        # After a stop the program may not have ended yet, and the controller refuses.
        bench.give_back(f"{COUNTER}={format_constant(value)}", f"OPEN PROG{PROGRAM}", "CLEAR", "CLOSE")
    wanted_ms, other_ms = _segment_ms(bench)
    holds = abs(found_ms - wanted_ms) < abs(found_ms - other_ms)
    return proof("pvt_rounding", holds=holds, found=f"{found_ms:.2f} ms", wanted=f"{wanted_ms:g} ms")


def _delay(bench: ProofRig, spindle: int, target: int) -> int | None:
    """Return the delay that fits the gathered data best, None where none does."""
    table = _cam(bench, spindle, target)
    bench.define(table)
    bench.tell("I51=1")
    gathering = DataGathering(client=bench.client, dialect=bench.dialect)
    channels = gathering.motor_channels(f"#{spindle} actual", f"#{target} compensation")
    plan = gathering.prepare(channels, SAMPLES)
    bench.move(f"#{spindle}J/")
    bench.move(f"#{spindle}J^{_jog_counts(bench, spindle)}")
    bench.settle(RAMP_S)
    gathering.start(plan)
    bench.settle(plan.duration_ms / 1000.0 + SETTLE_S)
    gathering.stop()
    data = gathering.fetch(plan)
    _rest(bench, spindle)
    bench.tell(f"#{spindle}K", "DELETE GATHER")
    bench.delete(target)
    return _best(data, table, spindle, target)


def _best(data: GatheredData, table: CompensationTable, spindle: int, target: int) -> int | None:
    source, corrections = data.values[f"#{spindle} actual"], data.values[f"#{target} compensation"]
    if len(source) <= LONGEST_DELAY or max(source) - min(source) < SAMPLES:
        return None  # it did not turn
    errors = {
        delay: max(
            abs(correction - table.correction(float(source[place - delay])))
            for place, correction in enumerate(corrections)
            if place >= LONGEST_DELAY
        )
        for delay in range(LONGEST_DELAY + 1)
    }
    return min(errors, key=errors.__getitem__)


def _cam(bench: ProofRig, spindle: int, target: int) -> CompensationTable:
    span = bench.judged.machine.spindle.counts_per_rev
    definition = TableDefinition(motor=target, sources=(TableSource(spindle, span),), target=target, columns=2)
    return definition.filled((CAM_COUNTS * ENTRY, 0))


def _jog_counts(bench: ProofRig, motor: int) -> str:
    speed = abs(bench.judged.value(bench.dialect.motor_index(motor, 22)) or 0.0)
    return format_constant(float(round(speed * JOG_S * 1000.0)))


@dataclass(frozen=True, slots=True)
class _Axis:
    letter: str
    scale: float


def _load(bench: ProofRig) -> None:
    """Enter the oscillating program; the motors are closed already."""
    carriage = bench.motor("carriage")
    definitions = read_definitions(bench.judged.machine.controller.axis_definitions)
    axis = next(_Axis(each.axis, each.scale) for each in definitions if each.motor == carriage)
    step = format_constant(STEP_COUNTS / abs(axis.scale))
    bench.client.download(
        (
            f"OPEN PROG{PROGRAM}",
            "CLEAR",
            f"INC({axis.letter})",
            f"PVT{PVT_MS}",
            f"{COUNTER}=0",
            f"WHILE({COUNTER}<{PAIRS})",
            f"{axis.letter}{step}:0",
            f"{axis.letter}-{step}:0",
            f"{COUNTER}={COUNTER}+1",
            "ENDWHILE",
            f"ABS({axis.letter})",
            "CLOSE",
        )
    )


def _run(bench: ProofRig) -> float:
    """Run the program; return how long it took, ms."""
    bench.move(f"&1B{PROGRAM}R")
    began_s = bench.clock.now_s()
    while not _arrived(bench) and bench.clock.now_s() - began_s < REST_TIMEOUT_S:
        bench.settle(POLL_S)
    bench.moving = not _arrived(bench)
    return (bench.clock.now_s() - began_s) * 1000.0


def _arrived(bench: ProofRig) -> bool:
    (digits_,) = bench.client.query("&1??", again=True)
    flags = decode(digits_, bench.dialect.system_bits)
    motor = bench.flags(bench.motor("carriage"))
    return "running_program" not in flags and "move_timer_active" not in motor


def _segment_ms(bench: ProofRig) -> tuple[float, float]:
    """Return how long a segment should take, and how long by the other rule."""
    switch = bench.dialect.segment_time_switch
    exact = switch is not None and not bench.judged.value(switch)
    whole = float(round(PVT_MS))
    return (PVT_MS, whole) if exact else (whole, PVT_MS)


def _rest(bench: ProofRig, motor: int) -> float:
    """Wait until a motor is commanded to rest; return its position."""
    end = bench.clock.now_s() + REST_TIMEOUT_S
    while bench.clock.now_s() < end:
        flags = bench.flags(motor)
        if "desired_velocity_zero" in flags or "open_loop" in flags:
            bench.moving = False
            break
        bench.settle(POLL_S)
    bench.settle()
    return bench.position(motor)
