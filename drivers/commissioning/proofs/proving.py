"""Run the commissioning tests in order: first the controller with every drive killed, then tests with motion.

The machine is moved only if all other tests passed, and the drives are killed before and after. Everything is
restored: no table, no gather buffer, I51 = 0, the definition of the spare M-variable, what is gathered. The
heartbeat stays, since no later motion is possible without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.commissioning.amounts import digits
from drivers.commissioning.check import Check, Group
from drivers.commissioning.proofs.bench import SETTLE_S, ProofRig, names_of, proof, unproven
from drivers.commissioning.proofs.motion import pvt_rounding, source_delay
from drivers.commissioning.proofs.stopping import MeasuredStops, prove_stops
from drivers.commissioning.proofs.tables import compensation_edge, delete_order, fails, roll_over, table_zero
from drivers.commissioning.reading import Extent, read_configuration, read_gathering
from drivers.commissioning.stop_record import StopEntry
from drivers.commissioning.verification import Verification
from drivers.controller import Controller
from drivers.errors import ControllerError, LinkError
from drivers.lathe.stop import StopPath
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.language.text import format_constant
from drivers.pmac.reserved import OWNER
from drivers.pmac.settings import servo_cycle_ms
from profiles.findings import Severity, worst

BEGIN_CYCLES = 4_000_000  # written into the timer: more cycles than the measurement takes
MEASURED_S = 1.0
TOLERANCE = 0.02  # relative tolerance of the rate: what two round trips may hide


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

KILLED: tuple[Proof, ...] = (servo_rate, compensation_edge, table_zero, delete_order)
SPINDLE: tuple[Proof, ...] = (source_delay, roll_over)
CLOSED: tuple[Proof, ...] = (pvt_rounding,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Proven:
    """The test results, and the measured stops."""

    checks: tuple[Check, ...]
    stops: tuple[StopEntry, ...] = ()


def prove(
    client: Controller,
    stop: StopPath,
    clock: Clock,
    verification: Verification,
    owner: float | None = None,
    owner_seen: Callable[[float], None] = lambda _: None,
) -> Proven:
    """Run all tests that a cut relies on; the drives are killed before and afterwards.

    `owner` is the number of the console that controls the machine, None for the owner at the beginning. When
    another console takes control meanwhile, what moves is stopped, and nothing else is sent; `owner_seen` is
    called with the new owner.

    Raises:
        StoppedError: somebody stopped; the drives are killed.
        LinkError: the link broke; check the machine.
        DriverError: an axis does not arrive; the drives are killed. `owner.ousted`.
    """
    judged = verification.judged
    names = names_of(judged.machine)
    busy = verification.state.enabled or judged.configuration.tables or "gathering" in verification.state.card
    if busy or worst(verification.checks) is Severity.REFUSAL:
        first = Check(Group.PROOFS, "proofs_refused", Severity.REFUSAL)
        return Proven(checks=(first, *unproven(names)))
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
            checks += _closed(bench)
        if not fails(checks):
            stops = prove_stops(bench)
            checks += stops.checks
    finally:
        _leave(bench, restoring)
    done = {check.code.removeprefix("proof_").removeprefix("unproven_") for check in checks}
    missing = [name for name in names if name not in done]
    return Proven(checks=(*checks, *unproven(missing)), stops=stops.entries)


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


def _closed(bench: ProofRig) -> list[Check]:
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
