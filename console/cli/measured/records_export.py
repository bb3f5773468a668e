"""Export of recorded runs: a table (CSV), every run in full (JSON lines), and on request traces and telemetry."""

from __future__ import annotations

import json
import math
import re
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

from console.cli.library import data_of
from console.cli.measured.records_report import filters_of, row_fields, story_fields
from console.cli.output import SCHEMA, show, tell
from console.escaping import csv_table
from console.session.data.kept_files import make_folder, path_exists
from console.session.data.run_reader import RunFilters, runs, story
from console.session.data.run_rows import RunRow
from console.session.data.run_story import RecordedTelemetry, RunStory
from console.session.errors import SessionError
from console.text.catalogue import Catalogue
from profiles.files import printable, write_atomically
from profiles.metrology.unrolled import unroll_kept
from profiles.problem import Problem

TABLE, LINES = "runs.csv", "runs.jsonl"
PAGE = 200
_KEPT_IN_NAMES = re.compile(r"[^\w.-]+")


def export(options: Namespace, text: Catalogue) -> None:
    """Write the selected runs into a folder, which is created; no file is overwritten."""
    data, folder = data_of(options), Path(options.folder)
    make_folder(folder)
    for name in (TABLE, LINES):
        if path_exists(folder / name):
            raise SessionError(Problem(code="file.exists", where=printable(str(folder / name))))
    rows, lines, files, damaged = list[dict[str, object]](), list[str](), 0, list[Problem]()
    for row in islice(_select_runs(data, filters_of(options)), options.limit):
        found = story(data, row.run_id)
        rows.append(row_fields(row))
        lines.append(json.dumps({"schema": SCHEMA, **story_fields(found)}, ensure_ascii=False))
        files += _write_traces(folder, found) if options.traces else 0
        files += _write_telemetry(folder, found) if options.telemetry else 0
        if found.damaged:
            what = ", ".join(found.damaged)
            damaged.append(Problem(code="record.damaged_run", key=row.run_id[:8], value=what))
    write_atomically(folder / TABLE, _table(rows).encode(), overwrite=False)
    content = "".join(f"{line}\n" for line in lines).encode(errors="replace")
    write_atomically(folder / LINES, content, overwrite=False)
    warnings = tell(damaged, text)
    where = printable(str(folder))
    show(
        options,
        lambda: {"folder": str(folder), "runs": len(rows), "files": files, "warnings": warnings},
        lambda: [text("records.exported", count=len(rows), folder=where, files=files)],
    )


def _select_runs(data: Path, filters: RunFilters) -> Iterator[RunRow]:
    """Yield the runs page by page, newest first."""
    page = runs(data, filters, limit=PAGE)
    while page:
        yield from page
        page = runs(data, filters, before=page[-1].run_id, limit=PAGE)


def _table(rows: Sequence[Mapping[str, object]]) -> str:
    """Return the rows of the list as CSV, with a header; dates are UTC."""
    flat = [_flatten_row(row) for row in rows]
    return csv_table(flat[0], (each.values() for each in flat)) if flat else ""


def _flatten_row(row: Mapping[str, object]) -> dict[str, object]:
    ended = row["ended"]
    assert isinstance(ended, dict)
    others = {key: value for key, value in row.items() if key != "ended"}
    return {**others, **{f"ended_{key}": value for key, value in ended.items()}}


def _write_traces(folder: Path, found: RunStory) -> int:
    """Write each trace as it was recorded, and the sections of each part; return how many."""
    kept = [part for part in found.parts if part.trace is not None]
    for part in kept:
        suffix = ".csv" if part.trace_name is None else Path(part.trace_name).suffix
        name = f"{_name(found, part.part, part.number)}.trace{suffix}"
        write_atomically(folder / name, part.trace or b"", overwrite=False)
    unrolled = [(part, each) for part in found.parts if (each := unroll_kept(part.data)) is not None]
    simulated = "yes" if found.row.simulated else "no"
    for part, each in unrolled:
        name = f"{_name(found, part.part, part.number)}.sections.csv"
        write_atomically(folder / name, each.table(simulated=simulated).encode(), overwrite=False)
    return len(kept) + len(unrolled)


def _write_telemetry(folder: Path, found: RunStory) -> int:
    """Write the telemetry of each cut as a table; return how many."""
    for number, telemetry in enumerate(found.telemetry, start=1):
        name = f"{_name(found, telemetry.part, number)}.{telemetry.kind}.csv"
        write_atomically(folder / name, _telemetry_table(found.row, telemetry).encode(), overwrite=False)
    return len(found.telemetry)


def _telemetry_table(row: RunRow, telemetry: RecordedTelemetry) -> str:
    head = [
        f"# run: {printable(row.run_id)}",
        f"# simulated: {'yes' if row.simulated else 'no'}",
        f"# part: {printable(telemetry.part)}",
    ]
    # What is not known is an empty cell; nine digits give a float32 back.
    rows = [
        ["" if math.isnan(value) else f"{value:.9g}" for value in values] for values in telemetry.rows.tolist()
    ]
    return "\n".join([*head, ",".join(telemetry.columns), *map(",".join, rows)]) + "\n"


def _name(found: RunStory, part: str, number: int) -> str:
    """Return the beginning of a file name; what is simulated says so there, too."""
    sim = "SIM-" if found.row.simulated else ""
    return f"{sim}{found.row.run_id}-{number}{_KEPT_IN_NAMES.sub('-', f'-{part}' if part else '')}"
