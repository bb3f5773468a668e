"""Whether the servo really runs at the rate that I10 says, by a timer of the card and the clock of the host."""

from __future__ import annotations

from drivers.pmac.configuration.amounts import digits
from drivers.pmac.configuration.check import Check
from drivers.pmac.configuration.proofs.bench import ProofBench, proof
from drivers.pmac.settings import servo_cycle_ms

BEGIN_CYCLES = 4_000_000
"""Written into the timer: more than passes meanwhile."""

MEASURED_S = 1.0
TOLERANCE = 0.02
"""Of the rate: what two round trips may hide."""


def servo_rate(bench: ProofBench) -> Check:
    """Measure the servo rate with the last timer of the family; it is left to count."""
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


def _timer(bench: ProofBench) -> str:
    """Return the variable that is the timer; of a family without such settings, the spare one points at it."""
    dialect = bench.dialect
    if dialect.timer_numbers:
        return f"I{dialect.system_index(1, dialect.timer_numbers[-1])}"
    space, address = dialect.timer_words[-1]
    name = f"M{bench.spare}"
    bench.client.request(f"{name}->{space}:${address:X},0,24,S", lines=0)
    return name
