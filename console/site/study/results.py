"""The results of a study as files: a row for each part, in the order of the cells, whoever has made them when."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from console.escaping import csv_table
from console.site.study.cells import COLUMNS, Row, Value
from profiles.files import write_atomically

TABLE, PARQUET = "results.csv", "results.parquet"


def write_table(folder: Path, rows: Sequence[Row]) -> Path:
    """Write the results as CSV; numbers are not rounded. ProfileError `file.not_writable`."""
    path = folder / TABLE
    content = csv_table(COLUMNS, ([_format_value(row[column]) for column in COLUMNS] for row in rows))
    write_atomically(path, content.encode("utf-8", "backslashreplace"), overwrite=True)
    return path


def _format_value(value: Value) -> Value:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else value


def write_parquet(folder: Path, rows: Sequence[Row]) -> Path:
    """Write the results as Parquet, with pyarrow. ProfileError `file.not_writable`."""
    import pyarrow as arrow
    from pyarrow import parquet

    types: dict[type, Any] = {str: arrow.string(), int: arrow.int64(), float: arrow.float64(), bool: arrow.bool_()}
    schema = arrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    written = io.BytesIO()
    parquet.write_table(arrow.Table.from_pylist([dict(row) for row in rows], schema=schema), written)
    path = folder / PARQUET
    write_atomically(path, written.getvalue(), overwrite=True)
    return path
