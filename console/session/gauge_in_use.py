"""The gauge on which the parts of a data folder are measured: chosen once, remembered there by its name."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from console.session.data.kept_files import gauges_folder, make_folder, path_exists, read_kept_values, utc_now
from profiles.files import printable, write_atomically
from profiles.gauge import GaugeProfile
from profiles.store import load_gauge
from profiles.strict_values import read_own

SCHEMA = 1
FILE_NAME = "gauge_in_use.json"
DAMAGED = "gauge.choice_damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenGauge:
    """The name of the gauge in use, None: no gauge; `machines` have one of their own."""

    gauge: str | None
    machines: Mapping[str, str | None] = field(default_factory=dict)

    def of(self, machine: str) -> str | None:
        """Return that of a machine."""
        return self.machines.get(machine, self.gauge)


def gauge_in_use(data: Path, machine: str = "") -> GaugeProfile | None:
    """Return the gauge that measures the parts of a machine, None where none was chosen.

    Raises `ProfileError`: its file is not there any more or refused, or the choice cannot be read.
    """
    name = chosen_gauge(data).of(machine)
    return None if name is None else load_gauge(name, gauges_folder(data)).on(utc_now()[:10])


def chosen_gauge(data: Path) -> ChosenGauge:
    """Return which gauge is in use, and where another one. Raises `ProfileError`: damaged."""
    path = data / FILE_NAME
    if not path_exists(path):
        return ChosenGauge(gauge=None)
    found = read_kept_values(path, DAMAGED)
    return read_own(ChosenGauge, found, schema=SCHEMA, code=DAMAGED, where=printable(str(path)))


def use_gauge(data: Path, name: str | None, machine: str | None = None) -> None:
    """Remember a gauge, which must be known, or that there is none, for one machine or for all of them.

    Raises `ProfileError` as `load_gauge` and `chosen_gauge`.
    """
    if name is not None:
        load_gauge(name, gauges_folder(data))
    make_folder(data)
    chosen = ChosenGauge(gauge=name)
    if machine is not None:
        before = chosen_gauge(data)
        chosen = replace(before, machines={**before.machines, machine: name})
    content = json.dumps({"schema": SCHEMA, **asdict(chosen)})
    write_atomically(data / FILE_NAME, f"{content}\n".encode(), overwrite=True, private=True)
