"""The schema of the records: the queries of its document work."""

from __future__ import annotations

import re
import sqlite3
import time
from contextlib import closing
from pathlib import Path

from console.session.data.record_file import FILE_NAME, opened


def test_the_queries_of_the_document_work(tmp_path: Path) -> None:
    opened(tmp_path, time.monotonic() + 5.0).close()
    document = (Path(__file__).parents[2] / "docs" / "records.md").read_text(encoding="utf-8")
    queries = re.findall(r"^```sql\n(.*?)^```", document, re.MULTILINE | re.DOTALL)
    assert len(queries) == 4
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        for query in queries:
            assert database.execute(query).fetchall() == []
