"""The paper's results beside ours, as far as no lathe is needed."""

from __future__ import annotations

from profiles.paper import acceptance, chuck, parts, servo_figures, slips
from profiles.paper.record import Experiments, Section


def sections(paper: Experiments) -> tuple[Section, ...]:
    """Return the figures, tables, equations and slips in the order of the paper, then the acceptance numbers."""
    return (
        chuck.section(paper.machine),
        servo_figures.section(paper.machine),
        parts.section(paper),
        slips.section(paper),
        acceptance.section(paper),
    )
