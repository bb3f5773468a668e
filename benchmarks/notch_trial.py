"""What a health test shows of a first notch filter, for each way in which a controller may read its signs.

On a simulated tool that bends at 300 Hz by 40 % of its motion, `console identify` makes both sweeps and `console
tune show` proposes a first filter. The machine profile states it, and `console health` tests it on four plants,
which differ in `notch_reading`: rise time, gain at 40 Hz, and what the model and the reading found leave of the
step. After the test of the reading that the manual states the next filter is proposed.

    python -m benchmarks.notch_trial
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.designed_loop import machine_text, proposed, sweep, told
from benchmarks.measure import extent, print_table
from console.session.data.health import kept_tests
from console.session.tuning.known_loop import known_loop
from console.session.tuning.notch_evidence import gathered_step
from profiles.axis.notch import SignConvention
from profiles.axis.step_figures import left_by, reading_of
from profiles.store import load_machine

SEED = 1
PLANT = 'flexible_fraction = 0.4\nnotch_reading = "{reading}"\n'


def tested(machine: Path, plant: Path, data: Path) -> dict[str, Any]:
    """Return what `console health` finds of the filter that a machine states."""
    words = ("--sim", "--plant", str(plant), "--seed", str(SEED), "--machine", str(machine), "--data", str(data))
    return told("health", *words)


def left(machine: Path, data: Path) -> tuple[str, str, str]:
    """Return how the newest test shows that the filter is read, and what the model and that reading leave, %."""
    stated = load_machine(str(machine)).machine
    loop = known_loop(stated, data, simulated=True).loop
    test = kept_tests(data, stated.name, 1)[0].result
    assert test is not None
    found = left_by(loop, gathered_step(test))
    reading = reading_of(found)
    by_reading = "-" if reading is None else f"{100.0 * found[reading]:.2f}"
    return "-" if reading is None else str(reading), f"{100.0 * found[SignConvention.STATED]:.2f}", by_reading


def row(name: str, test: dict[str, Any], shown: tuple[str, str, str]) -> tuple[str, ...]:
    """Return one row: as measured beside the model, and what the test shows."""
    model = test["model"]
    return (
        name,
        f"{test['step']['rise_ms']:.2f}",
        f"{model['step']['rise_ms']:.2f}",
        f"{test['sine']['gain']:.3f}",
        f"{model['gain']:.3f}",
        *shown,
    )


def main() -> None:
    """Run and print the table."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plants = {each: folder / f"{each}.toml" for each in SignConvention}
        for each, plant in plants.items():
            plant.write_text(PLANT.format(reading=each), encoding="utf-8")
        swept = folder / "swept"
        sweep(str(plants[SignConvention.STATED]), SEED, swept)
        first, machine = proposed(swept), folder / "first.toml"
        machine.write_text(machine_text(first["settings"]), encoding="utf-8")
        for each in tuple(SignConvention)[: extent(len(SignConvention), 1)]:
            data = folder / f"data-{each}"
            shutil.copytree(swept, data)
            rows.append(row(str(each), tested(machine, plants[each], data), left(machine, data)))
        data = folder / f"data-{SignConvention.STATED}"
        further = proposed(data, str(machine))
    head = ("", "rise, ms", "model", "gain at 40 Hz", "model", "read as", "model leaves, %", "that leaves, %")
    print_table("A notch filter in its health test", head, rows)
    yields = {"published": first["before"], "first filter": first["after"], "next filter": further["after"]}
    print_table(
        "Yields at most, um/N",
        ("", "um/N"),
        [(name, f"{margins['stiffness']['most_um_per_n']:.1f}") for name, margins in yields.items()],
    )


if __name__ == "__main__":
    main()
