"""Run the commissioning tests in order: first the controller with every drive killed, then tests with motion.

The machine is moved only if all other tests passed, and the drives are killed before and after. Everything is
restored: no table, no gather buffer, I51 = 0, the definition of the spare M-variable, what is gathered. The
heartbeat stays, since no later motion is possible without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace

from drivers.clock import Clock
from drivers.commissioning.check import Check, Group
from drivers.commissioning.checked_configuration import digits
from drivers.commissioning.fingerprint import changed_settings
from drivers.commissioning.proofs.bench import POLL_S, SETTLE_S, ProofRig, list_missing_tests, names_of, proof
from drivers.commissioning.proofs.stopping import MeasuredStops, prove_stops
from drivers.commissioning.reading import Extent, holds_another, read_configuration, read_gathering
from drivers.commissioning.verification import Verification, read_of_machine
from drivers.controller import Controller
from drivers.errors import ControllerError, DriverError, LinkError
from drivers.lathe.stop import StopPath
from drivers.pmac.axes import read_definitions
from drivers.pmac.compensation.table import CompensationTable, TableDefinition, TableSource
from drivers.pmac.compensation.table_text import definition_text
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.gathering.gather_client import DataGathering, GatheredData
from drivers.pmac.language.text import format_constant
from drivers.pmac.programs.setup import sign_program
from drivers.pmac.reserved import OWNER
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.status import decode
from profiles.findings import Severity, worst
from profiles.problem import Problem

BEGIN_CYCLES = 4_000_000  # written into the timer: more cycles than the measurement takes
MEASURED_S = 1.0
TOLERANCE = 0.02  # relative tolerance of the rate: what two round trips may hide
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
FLAT_COUNTS = 10.0
ENTRY = 16  # entries are in sixteenths of a count
SAME_COUNTS = 0.5  # a source that dithers by a count changes the correction by less than this
LEAST_TURNED = 64.0  # counts that a source must be away from its zero for the roll-over test


def servo_rate(bench: ProofRig) -> Check:
    """Measure the servo rate with the last timer of the family; the timer is left running."""
    name = _timer(bench)
    bench.tell(f"{name}={BEGIN_CYCLES}")
    (first,) = bench.client.numbers(name, again=True)
    began_s = bench.clock.now_s()
    bench.settle(MEASURED_S)
    (last,) = bench.client.numbers(name, again=True)
    passed_s = bench.clock.now_s() - began_s
    wanted_us = servo_cycle_ms(bench.judged.value(10) or 0.0) * 1000.0
    cycles = first - last
    if cycles <= 0.0 or passed_s <= 0.0:
        return proof("servo_rate", holds=False, found="-", wanted=f"{digits(wanted_us)} us")
    found_us = passed_s * 1e6 / cycles
    holds = abs(found_us / wanted_us - 1.0) <= TOLERANCE
    return proof("servo_rate", holds=holds, found=f"{digits(found_us)} us", wanted=f"{digits(wanted_us)} us")


def _timer(bench: ProofRig) -> str:
    """Return the timer variable; in a family without one, the spare M-variable points at it."""
    dialect = bench.dialect
    if dialect.timer_numbers:
        return f"I{dialect.system_index(1, dialect.timer_numbers[-1])}"
    space, address = dialect.timer_words[-1]
    name = f"M{bench.spare}"
    bench.client.request(f"{name}->{space}:${address:X},0,24,S", lines=0)
    return name


Proof = Callable[[ProofRig], Check]


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
    if holds_another(bench.client, PROGRAM):
        return list_missing_tests(["pvt_rounding"])[0]  # somebody else's program is there
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


def compensation_edge(bench: ProofRig) -> Check:
    """Test that the last correction stays when I51 goes to 0, and can be cleared by hand then."""
    target = bench.motor("carriage")
    bench.define(spindle_table(bench, target, bench.judged.machine.spindle.counts_per_rev, (160,) * 4))
    bench.tell("I51=1")
    bench.settle()
    on = bench.correction(target)
    bench.tell("I51=0")
    bench.settle()
    kept = bench.correction(target)
    bench.clear_correction(target)
    bench.settle()
    cleared = bench.correction(target)
    bench.delete(target)
    found = ", ".join(digits(value) for value in (on, kept, cleared))
    holds = _is_near(on, FLAT_COUNTS) and _is_near(kept, FLAT_COUNTS) and _is_near(cleared, 0.0)
    return proof("compensation_edge", holds=holds, found=found, wanted=f"{FLAT_COUNTS:g}, {FLAT_COUNTS:g}, 0")


def table_zero(bench: ProofRig) -> Check:
    """Test the correction at the zero of the source: the last entry, also where that is not 0."""
    target, here = bench.motor("carriage"), bench.position(bench.motor("spindle"))
    # Long enough for the source to be within the first spacing, or within the last.
    span = 4 * int(abs(here)) + 4000
    table = spindle_table(bench, target, span, (0, 100 * ENTRY))
    found = _correction(bench, table)
    wanted = table.correction(here)
    return proof("table_zero", holds=_is_near(found, wanted), found=digits(found), wanted=digits(wanted))


def roll_over(bench: ProofRig) -> Check:
    """Test that a source beyond the span is folded into it."""
    target, here = bench.motor("carriage"), bench.position(bench.motor("spindle"))
    if abs(here) < LEAST_TURNED:
        return list_missing_tests(["roll_over"])[0]
    span = max(16, int(abs(here) / 2.4))
    table = spindle_table(bench, target, span, (10 * ENTRY, 30 * ENTRY, 20 * ENTRY, 0))
    found, wanted = _correction(bench, table), table.correction(here)
    # A source that dithers by a count changes the correction by its slope.
    holds = abs(found - wanted) <= SAME_COUNTS + 80.0 / span
    return proof("roll_over", holds=holds, found=digits(found), wanted=digits(wanted))


def delete_order(bench: ProofRig) -> Check:
    """Test the order of tables in memory: defined high to low, deleted low to high, before gathering."""
    low, high = sorted((bench.motor("tool"), bench.motor("carriage")))
    span = bench.judged.machine.spindle.counts_per_rev
    of_low, of_high = (spindle_table(bench, motor, span, (0, 0)) for motor in (low, high))
    bench.define(of_high)
    bench.define(of_low)
    kept = bench.refuses(f"#{high}DELETE COMP")
    bench.delete(low, high)
    bench.define(of_low)
    upward = bench.refuses(f"#{high}DEFINE COMP {definition_text(of_high.definition)}")
    bench.delete(low)
    bench.tell("DEFINE GATHER 10")
    gathering = bench.refuses(f"#{low}DEFINE COMP {definition_text(of_low.definition)}")
    bench.tell("DELETE GATHER")
    refused = (kept, upward, gathering)
    found = ", ".join("ERR003" if each else "-" for each in refused)
    return proof("delete_order", holds=all(refused), found=found, wanted="ERR003, ERR003, ERR003")


def _correction(bench: ProofRig, table: CompensationTable) -> float:
    target = table.definition.target
    bench.define(table)
    bench.tell("I51=1")
    bench.settle()
    found = bench.correction(target)
    bench.delete(target)
    return found


def spindle_table(bench: ProofRig, target: int, span: int, entries: tuple[int, ...]) -> CompensationTable:
    """Return a table by the spindle; `entries` are in sixteenths of a count."""
    sources = (TableSource(bench.motor("spindle"), span),)
    return TableDefinition(motor=target, sources=sources, target=target, columns=len(entries)).fill_table(entries)


def _is_near(found: float, wanted: float) -> bool:
    return abs(found - wanted) <= SAME_COUNTS


def fails(checks: list[Check]) -> bool:
    """Whether a test has failed: then nothing is moved for the others."""
    return any(check.severity is Severity.REFUSAL for check in checks)


def _delay(bench: ProofRig, spindle: int, target: int) -> int | None:
    """Return the delay that best fits the gathered data, None if the spindle did not turn."""
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
    bench.client.download(sign_program(text).splitlines())


def _run(bench: ProofRig) -> float:
    """Run the program; return how long it took, ms."""
    bench.move(f"&1B{PROGRAM}R")
    began_s = bench.clock.now_s()
    while not _has_arrived(bench) and bench.clock.now_s() - began_s < REST_TIMEOUT_S:
        bench.settle(POLL_S)
    bench.moving = not _has_arrived(bench)
    return (bench.clock.now_s() - began_s) * 1000.0


def _has_arrived(bench: ProofRig) -> bool:
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


KILLED: tuple[Proof, ...] = (servo_rate, compensation_edge, table_zero, delete_order)
SPINDLE: tuple[Proof, ...] = (source_delay, roll_over)
CLOSED: tuple[Proof, ...] = (pvt_rounding,)


def prove(
    client: Controller,
    stop: StopPath,
    clock: Clock,
    verification: Verification,
    owner: float | None = None,
    owner_seen: Callable[[float], None] = lambda _: None,
) -> MeasuredStops:
    """Run all tests that a cut relies on; the drives are killed before and afterwards.

    `owner` is the number of the console that controls the machine, None for the owner at the beginning. When
    another console takes control meanwhile, what moves is stopped, and nothing else is sent; `owner_seen` is
    called with the new owner.

    Raises:
        StoppedError: somebody stopped; the drives are killed.
        LinkError: the link broke; check the machine.
        DriverError: an axis does not arrive; the drives are killed. `owner.ousted`. `measurement.changed`, another
            host has written settings meanwhile: the stops are those of neither.
    """
    judged = verification.judged
    names = names_of(judged.machine)
    busy = (
        verification.state.enabled_motors or judged.configuration.tables or "gathering" in verification.state.card
    )
    if busy or worst(verification.checks) is Severity.REFUSAL:
        first = Check(Group.PROOFS, "proofs_refused", Severity.REFUSAL)
        return MeasuredStops(checks=(first, *list_missing_tests(names)))
    if owner is None:
        (owner,) = client.numbers(f"P{OWNER}", again=True)
    bench = ProofRig(client=client, stop=stop, clock=clock, judged=judged, owner=owner, owner_seen=owner_seen)
    restoring = _restoring_lines(bench)
    checks: list[Check] = []
    stops = MeasuredStops()
    try:
        checks += _stage(bench, KILLED)
        if not judged.machine.spindle.followed and not fails(checks):
            checks += _stage(bench, SPINDLE)
            checks += _close_loops(bench)
        if not fails(checks):
            stops = prove_stops(bench)
            checks += stops.checks
    finally:
        _leave(bench, restoring)
    if stops.entries:
        _refuse_changed(bench)
    done = {check.code.removeprefix("proof_").removeprefix("unproven_") for check in checks}
    missing = [name for name in names if name not in done]
    return replace(stops, checks=(*checks, *list_missing_tests(missing)))


def _refuse_changed(bench: ProofRig) -> None:
    machine, before = bench.judged.machine, bench.judged.configuration
    now = read_of_machine(bench.client, machine, bench.dialect)
    changed = changed_settings(before, now, machine)
    if problems := [
        Problem(code="measurement.changed", key=name, value=found, limit=was) for name, was, found in changed
    ]:
        raise DriverError(*problems)


def _stage(bench: ProofRig, proofs: Iterable[Proof]) -> list[Check]:
    """Carry out tests; a function has the name of its test."""
    checks = []
    for carry_out in proofs:
        try:
            checks.append(carry_out(bench))
        except (ControllerError, GatherError) as error:
            found = str(error)
            if isinstance(error, ControllerError):
                found = f"{error.problems[0].value}: ERR{error.error_number:03d}"
            checks.append(Check(Group.PROOFS, f"proof_{carry_out.__name__}", Severity.REFUSAL, found=found))
    return checks


def _close_loops(bench: ProofRig) -> list[Check]:
    for axis in bench.judged.axes:
        bench.move(f"#{axis.motor}J/")
    bench.settle()
    bench.moving = False
    checks = _stage(bench, CLOSED)
    bench.stop.switch_off()
    bench.settle()
    return checks


def _leave(bench: ProofRig, restoring: Iterable[str]) -> None:
    """Kill every drive and restore what can be restored; another console's machine is left as it is."""
    if bench.ousted:
        return
    with suppress(LinkError):
        bench.stop.switch_off()
    bench.clock.wait(SETTLE_S)
    bench.put_back(restoring)


def _restoring_lines(bench: ProofRig) -> tuple[str, ...]:
    """Read what the tests use of the controller: the spare M-variable, and the gather set-up."""
    client, dialect, spare = bench.client, bench.dialect, bench.spare
    extent = Extent(settings=(), pointers=(range(spare, spare + 1),), motors=(), programs=())
    pointer = read_configuration(client, dialect, extent).pointers.get(spare, "*")
    settings = read_gathering(client, dialect).items()
    return (f"M{spare}->{pointer}", *(f"I{index}={format_constant(value)}" for index, value in settings))
