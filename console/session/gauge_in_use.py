"""The gauge on which the parts of a data folder are measured: chosen once, remembered there by its name."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from console.session.data.kept_files import gauges_folder, make_folder, path_exists, read_kept_values
from profiles.files import printable, write_atomically
from profiles.gauge import GaugeProfile
from profiles.store import load_gauge
from profiles.strict_values import read_own

SCHEMA = 1
FILE_NAME = "gauge_in_use.json"
DAMAGED = "gauge.choice_damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenGauge:
    """The name of a gauge, as `console gauges use` keeps it; None: no gauge."""

    gauge: str | None


def gauge_in_use(data: Path) -> GaugeProfile | None:
    """Return the gauge in use, None where none was chosen.

    Raises `ProfileError`: its file is not there any more or refused, or the choice cannot be read.
    """
    name = name_in_use(data)
    return None if name is None else load_gauge(name, gauges_folder(data))


def name_in_use(data: Path) -> str | None:
    """Return the name of the gauge in use, None where none was chosen. Raises `ProfileError`: damaged."""
    path = data / FILE_NAME
    if not path_exists(path):
        return None
    found = read_kept_values(path, DAMAGED)
    return read_own(ChosenGauge, found, schema=SCHEMA, code=DAMAGED, where=printable(str(path))).gauge


def use_gauge(data: Path, name: str | None) -> None:
    """Remember a gauge, which must be known, or that there is none; raises `ProfileError` as `load_gauge`."""
    if name is not None:
        load_gauge(name, gauges_folder(data))
    make_folder(data)
    content = json.dumps({"schema": SCHEMA, "gauge": name})
    write_atomically(data / FILE_NAME, f"{content}\n".encode(), overwrite=True, private=True)
