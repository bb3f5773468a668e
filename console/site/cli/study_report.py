"""A study on the command line: its progress, and what it found."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from statistics import median

from console.cli.library import data_of
from console.cli.output import show
from console.session.errors import require_extra
from console.site.study.cells import MADE, Row, cells, read_study, write_parquet, write_table
from console.site.study.running import StudyProgress, carry_out
from console.site.study.workers import Workers, cluster, processes
from console.text.catalogue import Catalogue
from console.text.columns import wrap_text
from profiles.files import printable

SAID_EACH_S = 5.0
MOST_REASONS = 8
LONGEST_REASON = 400
NO_PART = "–"
WIDTH, INDENT = 78, 2


def study(options: Namespace, workers: int, text: Catalogue) -> int:
    """Carry out what the arguments name; print the results."""
    if options.parquet:
        require_extra("pyarrow", "parquet")  # not after hours
    path = Path(options.file)
    described = read_study(path)
    folder = path.with_name(f"{path.stem}.study") if options.out is None else Path(options.out)
    telling = _ProgressReporter(text)

    def opens() -> AbstractContextManager[Workers]:
        return processes(workers) if options.scheduler is None else cluster(options.scheduler)

    try:
        rows = carry_out(cells(described, data_of(options), path.parent), folder, opens, telling.take_progress)
    except KeyboardInterrupt:
        telling.report_interruption(folder)
        raise
    files = [write_table(folder, rows), *([write_parquet(folder, rows)] if options.parquet else [])]
    show(options, lambda: study_fields(rows, files), lambda: study_lines(rows, files, text))
    return 0


class _ProgressReporter:
    """Progress on stderr, a line now and then."""

    def __init__(self, text: Catalogue) -> None:
        self._text, self._begun_s, self._said_s = text, time.monotonic(), 0.0
        self._last: StudyProgress | None = None

    def take_progress(self, progress: StudyProgress) -> None:
        """Take notice of progress; print it if that is due."""
        self._last = progress
        now_s = time.monotonic()
        first = progress.made_now == 0
        if not first and now_s - self._said_s < SAID_EACH_S and progress.kept < progress.cells:
            return
        self._said_s = now_s
        print(self._line(progress, now_s - self._begun_s), file=sys.stderr)
        sys.stderr.flush()

    def report_interruption(self, folder: Path) -> None:
        """Say that nothing is lost."""
        if self._last is not None:
            facts = {"kept": self._last.kept, "cells": self._last.cells, "folder": printable(str(folder))}
            print(self._text("study.interrupted", **facts), file=sys.stderr)

    def _line(self, progress: StudyProgress, seconds: float) -> str:
        left = progress.cells - progress.kept
        facts = {"kept": progress.kept, "cells": progress.cells, "bad": progress.bad}
        if not progress.made_now or not left:
            return self._text("study.progress", **facts)
        return self._text("study.progress_left", **facts, left=_clock(left * seconds / progress.made_now))


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}" if minutes >= 60 else f"{minutes}:{rest:02d}"


def study_fields(rows: Sequence[Row], files: Sequence[Path]) -> dict[str, object]:
    """Return what was found, for JSON."""
    return {
        "files": [str(file) for file in files],
        "rows": len(rows),
        "cells": len({row["cell"] for row in rows}),
        "outcomes": dict(Counter(str(row["outcome"]) for row in rows)),
        "groups": [
            {"job": job, "machine": machine, "plant": plant, "strategy": strategy, "part": part, **found}
            for (job, machine, plant, strategy, part), found in _groups(rows).items()
        ],
        "reasons": dict(_reasons(rows)),
    }


def study_lines(rows: Sequence[Row], files: Sequence[Path], text: Catalogue) -> list[str]:
    """Return what was found in words: each group of seeds, then why cells could not be made."""
    said: list[str] = []
    for (*names, part), found in _groups(rows).items():
        group = [*names, *([] if part == NO_PART else [text("study.part", number=part)])]
        said += wrap_text(" · ".join(map(printable, group)), WIDTH)
        said += (" " * INDENT + line for line in wrap_text(_summary_line(found, text), WIDTH - INDENT))
    said.append("")
    reasons = _reasons(rows).most_common()
    for reason, count in reasons[:MOST_REASONS]:
        said += wrap_text(text("study.reason", count=count, reason=printable(reason, LONGEST_REASON)), WIDTH)
    if len(reasons) > MOST_REASONS:
        said.append(text("study.more_reasons", count=len(reasons) - MOST_REASONS))
    return [*said, *(text("study.written", file=printable(str(file))) for file in files)]


def _summary_line(found: Mapping[str, float | int | None], text: Catalogue) -> str:
    facts = [text("study.made", made=found["made"], rows=found["rows"])]
    if found["median_um"] is not None:
        facts.append(text("study.ront", median=f"{found['median_um']:.2f}", worst=f"{found['worst_um']:.2f}"))
    if found["judged"]:
        facts.append(text("study.within", within=found["within"], judged=found["judged"]))
    return " · ".join(facts)


def _reasons(rows: Sequence[Row]) -> Counter[str]:
    return Counter(str(row["reason"]) for row in rows if row["outcome"] != MADE)


def _groups(rows: Sequence[Row]) -> dict[tuple[str, ...], dict[str, float | int | None]]:
    """Return, for each job, machine, plant, strategy and part in a row, what the seeds have become."""
    grouped: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        part = NO_PART if row["part"] is None else str(row["part"])
        key = (str(row["job"]), str(row["machine"]), str(row["plant"]), str(row["strategy"]), part)
        grouped.setdefault(key, []).append(row)
    return {key: _summary(found) for key, found in grouped.items()}


def _summary(rows: Sequence[Row]) -> dict[str, float | int | None]:
    um = [float(row["ront_um"]) for row in rows if row["ront_um"] is not None]
    judged = [row["within_tolerance"] for row in rows if row["within_tolerance"] is not None]
    return {
        "rows": len(rows),
        "made": sum(row["outcome"] == MADE for row in rows),
        "median_um": median(um) if um else None,
        "worst_um": max(um) if um else None,
        "within": sum(map(bool, judged)),
        "judged": len(judged),
    }
