"""The record of a run: what was cut with what, each step, and how it ended."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

from console.cli.run_order import RunOrder
from console.session.errors import SessionError
from console.session.records import DRIVES_ON_PATIENCE_S, OPEN_PATIENCE_S, RunRecord

Result = TypeVar("Result")


def begin_record(data: Path, order: RunOrder) -> RunRecord:
    """Begin the record of a run, in the data folder. On a lathe in this process no drive waits for other writers.

    Raises:
        SessionError: as `RunRecord`; nothing was started.
    """
    patience_s = OPEN_PATIENCE_S if order.address is None else DRIVES_ON_PATIENCE_S
    return RunRecord(data, _described(order), open_patience_s=OPEN_PATIENCE_S, patience_s=patience_s)


def recorded(
    record: RunRecord,
    warnings: list[str],
    order: RunOrder,
    work: Callable[[], Result],
    told: Callable[[Result, list[str]], dict[str, object]],
) -> Result:
    """Run, and keep in the record how it went, as it is `told`, however it ends.

    With the plan it keeps the dates of the calibrations with which the job was judged.
    """
    try:
        duration_s, used = order.plan.cut.duration_s, order.machine.used
        record.add("planned", {"warnings": warnings, "duration_s": duration_s, "calibrations": used})
        result = work()
        record.add("result", told(result, warnings))
    except BaseException as error:
        # What ended the run matters more than a record that cannot take it.
        with suppress(SessionError):
            record.add("ended", {"reason": str(error) or type(error).__name__})
        raise
    finally:
        record.close()
    return result


def _described(order: RunOrder) -> dict[str, object]:
    job, machine, plan = order.job, order.machine, order.plan
    return {
        "software": f"trilobe {version('trilobe')}",
        "job": job.job.name,
        "job_sha256": job.sha256,
        "machine": machine.machine.name,
        "machine_sha256": machine.sha256,
        "simulated": int(order.simulated),
        "strategy": plan.cut.strategy.value,
        "program": plan.cut.text,
    }
