"""What is told before anything moves."""

from __future__ import annotations

import sys

from console.session.run import RunPlan
from console.text.catalogue import Catalogue


def tell_warnings(plan: RunPlan, text: Catalogue) -> list[str]:
    """Print each warning of a plan on stderr, one line each, and return them."""
    warnings = [text.problem(problem) for problem in plan.warnings]
    for warning in warnings:
        print(f"console: {text('warning')}: {warning}", file=sys.stderr)
    sys.stderr.flush()
    return warnings
