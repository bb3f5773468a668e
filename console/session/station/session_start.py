"""A simulated lathe that is taken over in the middle of somebody's work: what was known there is known here."""

from __future__ import annotations

from dataclasses import dataclass

from console.session.cut.alignment import Alignment


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionStart:
    """The stamps of an `alignment` (clamping, jaw 1, touch-off) with which a session begins; its drives."""

    alignment: Alignment
    drives_on: bool
