"""The single-profile formats beside tables: to add one, write a reader and list it here."""

from __future__ import annotations

from collections.abc import Sequence

from profiles.trace_files.closed import Content, TraceFormat
from profiles.trace_files.records import PRF, SMD
from profiles.trace_files.sdf import SDF
from profiles.trace_files.x3p import X3P

OF_BYTES: tuple[TraceFormat[bytes], ...] = (X3P,)
OF_TEXT: tuple[TraceFormat[str], ...] = (SDF, SMD, PRF)


def recognised(content: Content, formats: Sequence[TraceFormat[Content]]) -> TraceFormat[Content] | None:
    """Return the format that the start of a file matches, None where it matches none."""
    return next((each for each in formats if each.begins(content)), None)
