"""Tests that need motion, in air: the delay of a table's source, and PVT times."""

from __future__ import annotations

from drivers.commissioning.check import Check
from drivers.commissioning.proofs.bench import POLL_S, SETTLE_S, ProofRig, proof, unproven
from drivers.commissioning.proofs.tables import ENTRY, spindle_table
from drivers.commissioning.reading import holds_program
from drivers.pmac.axes import read_definitions
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.gathering.gather_client import DataGathering, GatheredData
from drivers.pmac.language.text import format_constant
from drivers.pmac.status import decode

PROGRAM = 999
COUNTER = "P1010"
PVT_MS, PAIRS = 10.4, 200  # segments with a time that is no whole number of ms, and how often there and back
STEP_COUNTS = 10.0
JOG_S = 1.5
RAMP_S = 0.6
SAMPLES = 200
LONGEST_DELAY = 3
REST_TIMEOUT_S = 10.0
CAM_COUNTS = 200  # height of the cam over half a turn, on a killed motor


_OSCILLATION = """\
OPEN PROG{program}
CLEAR
INC({letter})
PVT{pvt}
{counter}=0
WHILE({counter}<{pairs})
{letter}{step}:0
{letter}-{step}:0
{counter}={counter}+1
ENDWHILE
ABS({letter})
CLOSE
"""


def source_delay(bench: ProofRig) -> Check:
    """Measure the delay of a table's source in servo cycles, for a target on each side of it.

    Only the spindle is closed; its jog ends by itself; tool and carriage stay killed.
    """
    spindle = bench.motor("spindle")
    targets = {name: bench.motor(name) for name in ("tool", "carriage")}
    wanted = ", ".join(f"{name} {int(spindle > motor)}" for name, motor in targets.items())
    found = ", ".join(f"{name} {_delay(bench, spindle, motor)}" for name, motor in targets.items())
    return proof("source_delay", holds=found == wanted, found=found, wanted=wanted)


def pvt_rounding(bench: ProofRig) -> Check:
    """Measure PVT segments of fractional ms; the carriage oscillates by ten counts."""
    if holds_program(bench.client, PROGRAM):
        return unproven(["pvt_rounding"])[0]  # somebody else's program is there
    value = bench.client.numbers(COUNTER, again=True)[0]
    try:
        _load(bench)
        found_ms = _run(bench) / (2 * PAIRS)
    finally:
        # After a stop the program may not have ended yet, and the controller refuses.
        bench.give_back(f"{COUNTER}={format_constant(value)}", f"OPEN PROG{PROGRAM}", "CLEAR", "CLOSE")
    switch = bench.dialect.segment_time_switch
    exact = switch is not None and not bench.judged.value(switch)
    wanted_ms, other_ms = (PVT_MS, float(round(PVT_MS))) if exact else (float(round(PVT_MS)), PVT_MS)
    holds = abs(found_ms - wanted_ms) < abs(found_ms - other_ms)
    return proof("pvt_rounding", holds=holds, found=f"{found_ms:.2f} ms", wanted=f"{wanted_ms:g} ms")


def _delay(bench: ProofRig, spindle: int, target: int) -> int | None:
    """Return the delay that fits the gathered data best, None where none does."""
    table = spindle_table(bench, target, bench.judged.machine.spindle.counts_per_rev, (CAM_COUNTS * ENTRY, 0))
    bench.define(table)
    bench.tell("I51=1")
    gathering = DataGathering(client=bench.client, dialect=bench.dialect)
    channels = gathering.motor_channels(f"#{spindle} actual", f"#{target} compensation")
    plan = gathering.prepare(channels, SAMPLES)
    bench.move(f"#{spindle}J/")
    speed = abs(bench.judged.value(bench.dialect.motor_index(spindle, 22)) or 0.0)
    bench.move(f"#{spindle}J^{format_constant(float(round(speed * JOG_S * 1000.0)))}")
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


def _load(bench: ProofRig) -> None:
    carriage = bench.motor("carriage")
    definitions = read_definitions(bench.judged.machine.controller.axis_definitions)
    axis = next(each for each in definitions if each.motor == carriage)
    step = format_constant(STEP_COUNTS / abs(axis.scale))
    text = _OSCILLATION.format(
        program=PROGRAM, letter=axis.axis, step=step, pvt=PVT_MS, counter=COUNTER, pairs=PAIRS
    )
    bench.client.download(text.splitlines())


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


def _rest(bench: ProofRig, motor: int) -> None:
    end = bench.clock.now_s() + REST_TIMEOUT_S
    while bench.clock.now_s() < end:
        flags = bench.flags(motor)
        if "desired_velocity_zero" in flags or "open_loop" in flags:
            bench.moving = False
            break
        bench.settle(POLL_S)
    bench.settle()
