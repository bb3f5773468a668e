"""Output of results: JSON with unrounded numbers on stdout, warnings on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping

from console.text.catalogue import Catalogue
from console.text.escaping import encodable, escaped
from profiles.problem import Problem


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON object. Numbers are not rounded; there is no NaN in JSON, so none may be in `value`."""
    shown = json.dumps(value, ensure_ascii=False, allow_nan=False, indent=2)
    # JSON has its own escapes for what the stream would replace, such as an undecodable file name.
    if encodable(escaped(shown), sys.stdout.encoding) != shown:
        shown = json.dumps(value, allow_nan=False, indent=2)
    print(shown)


def tell(problems: Iterable[Problem], text: Catalogue) -> list[str]:
    """Print each problem as a warning on stderr, one line each, and return the sentences."""
    warnings = [text.problem(problem) for problem in problems]
    for warning in warnings:
        print(f"console: {text('warning')}: {warning}", file=sys.stderr)
    sys.stderr.flush()
    return warnings
