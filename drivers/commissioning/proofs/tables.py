"""Test what compensation tables do when switched, deleted and left behind, with the drives killed."""

from __future__ import annotations

from drivers.commissioning.amounts import digits
from drivers.commissioning.check import Check
from drivers.commissioning.proofs.bench import ProofRig, proof, unproven
from drivers.pmac.compensation.table import CompensationTable, TableDefinition, TableSource
from drivers.pmac.compensation.table_text import definition_text
from profiles.findings import Severity

FLAT_COUNTS = 10.0
ENTRY = 16  # entries are in sixteenths of a count
SAME_COUNTS = 0.5  # a source that dithers by a count changes the correction by less than this
LEAST_TURNED = 64.0  # counts that a source must be away from its zero for the roll-over test


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
    holds = _near(on, FLAT_COUNTS) and _near(kept, FLAT_COUNTS) and _near(cleared, 0.0)
    return proof("compensation_edge", holds=holds, found=found, wanted=f"{FLAT_COUNTS:g}, {FLAT_COUNTS:g}, 0")


def table_zero(bench: ProofRig) -> Check:
    """Test the correction at the zero of the source: the last entry, also where that is not 0."""
    target, here = bench.motor("carriage"), bench.position(bench.motor("spindle"))
    # Long enough for the source to be within the first spacing, or within the last.
    span = 4 * int(abs(here)) + 4000
    table = spindle_table(bench, target, span, (0, 100 * ENTRY))
    found = _correction(bench, table)
    wanted = table.correction(here)
    return proof("table_zero", holds=_near(found, wanted), found=digits(found), wanted=digits(wanted))


def roll_over(bench: ProofRig) -> Check:
    """Test that a source beyond the span is folded into it."""
    target, here = bench.motor("carriage"), bench.position(bench.motor("spindle"))
    if abs(here) < LEAST_TURNED:
        return unproven(["roll_over"])[0]
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
    return TableDefinition(motor=target, sources=sources, target=target, columns=len(entries)).filled(entries)


def _near(found: float, wanted: float) -> bool:
    return abs(found - wanted) <= SAME_COUNTS


def fails(checks: list[Check]) -> bool:
    """Whether a test has failed: then nothing is moved for the others."""
    return any(check.severity is Severity.REFUSAL for check in checks)
