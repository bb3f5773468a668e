"""The saved jobs as a table for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.problem import Problem
from profiles.store import LibraryEntry, LoadedJob

Listed: TypeAlias = tuple[LibraryEntry, LoadedJob | tuple[Problem, ...]]
"""An entry with its job, or why it is unreadable."""


def job_lines(listed: Sequence[Listed], text: Catalogue) -> list[str]:
    """Return a row for each job, then why some cannot be read."""
    rows = [tuple(text(f"jobs.{name}") for name in ("name", "material", "size", "lobe", "speed", "source"))]
    rows += [_row(each, text) for each in listed]
    problems = [text.problem(problem) for _, loaded in listed if isinstance(loaded, tuple) for problem in loaded]
    return [*table(rows), *problems]


def _row(listed: Listed, text: Catalogue) -> tuple[str, ...]:
    entry, loaded = listed
    if not isinstance(loaded, LoadedJob):
        return (printable(entry.name), text("jobs.unreadable"), "", "", "", "")
    job = loaded.job
    return (
        printable(entry.name),
        job.material,
        f"D {job.diameter_mm:.1f} x {job.wall_thickness_mm:.1f} mm",
        f"{job.lobe_error_um_pp:.1f} um p-p",
        f"{job.spindle_speed_rpm:.0f} rpm",
        text("jobs.bundled" if entry.bundled else "jobs.own"),
    )
