"""Health test of one machine: the one at the given address, or one in memory with --sim."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

from console.cli.library import data_of, machine_of
from console.cli.machine.identify_run import work_agreed
from console.cli.output import show
from console.session.data.health import kept_tests, store
from console.session.data.kept_files import utc_now
from console.session.errors import SessionError
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from console.text.columns import table
from drivers.identification.health import (
    FIGURES,
    HealthRequest,
    HealthResult,
    check_health,
    figures_of,
    health_problems,
    model_figures_of,
)
from drivers.identification.identify import take_up
from drivers.identification.result import ResponseOrigin
from drivers.identification.rig import Rig, refuse_unready
from profiles.files import printable

NOTHING = "-"


def check_and_keep(options: Namespace, interruption: Interruption, text: Catalogue) -> int:
    """Test, print and keep the result; 1 without consent to move a machine."""
    loaded, data = machine_of(options), data_of(options)
    request = HealthRequest() if options.step is None else HealthRequest(step_um=options.step)
    if problems := health_problems(request, loaded.machine):
        raise SessionError(*problems)

    def work(rig: Rig, origin: ResponseOrigin) -> HealthResult:
        take_up(rig)
        return check_health(rig, request, origin, utc_now())

    def refuse(rig: Rig) -> None:
        refuse_unready(rig, health_problems(request, rig.machine))

    result = work_agreed(options, loaded, interruption, text, refuse, work)
    if result is None:
        return 1
    kept = kept_tests(data, loaded.machine.name, 1)
    before = kept[0].result if kept else None
    file = store(data, result)
    show(options, lambda: {**asdict(result), "file": str(file)}, lambda: _lines(result, before, file, text))
    return 0


def _lines(result: HealthResult, before: HealthResult | None, file: Path, text: Catalogue) -> list[str]:
    """Return the figures beside those of the model and of the test before."""
    columns = ("figure", "measured", "model", "before")
    found, model = figures_of(result), model_figures_of(result)
    last = {} if before is None else figures_of(before)
    rows = [tuple(text(f"health.column.{name}") for name in columns)]
    for key in FIGURES:
        values = (f"{each[key]:.4g}" if key in each else NOTHING for each in (found, model, last))
        rows.append((text(f"health.{key}"), *values))
    mark = f"{text('sim')}  " if result.origin.simulated else ""
    head = text("health.head", machine=result.origin.machine, step=f"{result.step_um:g}")
    return [mark + head, "", *table(rows, numeric=(1, 2, 3)), "", text("identify.kept", file=printable(str(file)))]
