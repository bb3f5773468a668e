"""The proofs in their order: first what the card does while every drive is killed, then what has to be seen move.

Only a card on which everything else holds is moved, from drives killed to drives killed. What was there before is
there afterwards: no table, no gather buffer, I51 = 0, the definition of the spare M-variable, what is gathered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

from drivers.clock import Clock
from drivers.errors import ControllerError, LinkError
from drivers.pmac.client import PmacClient
from drivers.pmac.configuration.check import Check, Group, Outcome, worst
from drivers.pmac.configuration.proofs.bench import (
    CHANNELS,
    NAMES,
    SETTLE_S,
    Before,
    ProofBench,
    unproven,
    unproven_of,
)
from drivers.pmac.configuration.proofs.motion import pvt_rounding, source_delay, stop_from_jog
from drivers.pmac.configuration.proofs.tables import (
    compensation_edge,
    delete_order,
    fails,
    roll_over,
    table_zero,
)
from drivers.pmac.configuration.proofs.timing import servo_rate
from drivers.pmac.configuration.reading import Extent, read_configuration, read_settings
from drivers.pmac.configuration.verification import Verification
from drivers.pmac.gathering.gather import GatherError
from drivers.stop import StopPath

Proof = Callable[[ProofBench], Check]

KILLED: Mapping[str, Proof] = {
    "servo_rate": servo_rate,
    "compensation_edge": compensation_edge,
    "table_zero": table_zero,
    "delete_order": delete_order,
}
SPINDLE: Mapping[str, Proof] = {"source_delay": source_delay, "roll_over": roll_over}
CLOSED: Mapping[str, Proof] = {"pvt_rounding": pvt_rounding, "stop_from_jog": stop_from_jog}


def prove(client: PmacClient, stop: StopPath, clock: Clock, verification: Verification) -> list[Check]:
    """Prove what a cut relies on; the drives are killed before and afterwards.

    Raises:
        StoppedError: somebody stopped; the drives are killed.
        LinkError: the link broke; look at the machine.
    """
    judged = verification.judged
    busy = verification.state.enabled or judged.configuration.tables or "gathering" in verification.state.card
    if busy or worst(verification.checks) is Outcome.FAILS:
        first = Check(group=Group.PROOFS, code="proofs_refused", outcome=Outcome.FAILS)
        return [first, *unproven()]
    bench = ProofBench(client=client, stop=stop, clock=clock, judged=judged)
    before = _before(bench)
    checks: list[Check] = []
    try:
        checks += _stage(bench, KILLED)
        if judged.machine.spindle.drive == "servo" and not fails(checks):
            checks += _stage(bench, SPINDLE)
            checks += _closed(bench)
    finally:
        _leave(bench, before)
    done = {check.code.removeprefix("proof_").removeprefix("unproven_") for check in checks}
    missing = [name for name in NAMES if name not in done]
    return [*checks, *unproven_of(missing)]


def _stage(bench: ProofBench, proofs: Mapping[str, Proof]) -> list[Check]:
    checks = []
    for name, carry_out in proofs.items():
        try:
            checks.append(carry_out(bench))
        except ControllerError as error:
            found = f"{error.problems[0].value}: ERR{error.error_number:03d}"
        except GatherError as error:
            found = str(error)
        else:
            continue
        checks.append(Check(group=Group.PROOFS, code=f"proof_{name}", outcome=Outcome.FAILS, found=found))
    return checks


def _closed(bench: ProofBench) -> list[Check]:
    """Carry out what needs every loop closed, and open them again."""
    for axis in bench.judged.axes:
        bench.tell(f"#{axis.motor}J/")
    bench.settle()
    return _stage(bench, CLOSED)


def _leave(bench: ProofBench, before: Before) -> None:
    """Kill every drive, and put everything back that can be."""
    with suppress(LinkError):
        bench.stop.switch_off()
    bench.clock.wait(SETTLE_S)
    bench.put_back(before)


def _before(bench: ProofBench) -> Before:
    """Read what the proofs use of the card: the spare M-variable, and what it gathers."""
    spare, gather = bench.spare, bench.dialect.gathering
    extent = Extent(settings=(), pointers=(range(spare, spare + 1),), motors=(), programs=())
    pointers = read_configuration(bench.client, bench.dialect, extent).pointers
    sources = range(gather.first_source, gather.first_source + CHANNELS)
    numbers = (gather.period, *gather.masks, *sources)
    return Before(pointer=pointers.get(spare, "*"), settings=read_settings(bench.client, numbers))
