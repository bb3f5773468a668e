"""What is told beside the result: warnings, on the error output."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from console.text.catalogue import Catalogue
from profiles.problem import Problem


def tell(problems: Iterable[Problem], text: Catalogue) -> list[str]:
    """Print each problem as a warning on stderr, one line each, and return the sentences."""
    warnings = [text.problem(problem) for problem in problems]
    for warning in warnings:
        print(f"console: {text('warning')}: {warning}", file=sys.stderr)
    sys.stderr.flush()
    return warnings
