"""Decide whether, and where, the links of a command are traced."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from drivers.link.base import Link
from drivers.link.trace import TracedLink
from drivers.link.trace_file import TraceFile
from profiles.problem import Problem


class Tracing:
    """One trace file for all links of a command, one after the other; or none."""

    def __init__(self, path: Path | None, title: str) -> None:
        """Open the file, before anything moves.

        Raises:
            DriverError: `link.trace_unwritable`.
        """
        self._file = None if path is None else TraceFile(path, title)
        self._traced: list[TracedLink] = []

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Return the problem that ended the trace, if any; reported once."""
        return tuple(link.problem for link in self._traced if link.problem is not None)[:1]

    def of(self, link: Link, now_s: Callable[[], float]) -> Link:
        """Return the link with its trace; `now_s` gives the times that are written."""
        if self._file is None:
            return link
        traced = TracedLink(link, self._file, now_s)
        self._traced.append(traced)
        return traced
