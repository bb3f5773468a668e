"""How results leave the command line: JSON with unrounded numbers, or lines for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping

from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.escaping import encodable, escaped
from profiles.chucking.diagnosis import Diagnosis
from profiles.findings import Finding, Severity
from profiles.problem import Problem
from profiles.roundness import RoundnessResult


def print_json(value: Mapping[str, object]) -> None:
    """Print one JSON object. Numbers are not rounded; there is no NaN in JSON, so none may be in `value`."""
    shown = json.dumps(value, ensure_ascii=False, allow_nan=False, indent=2)
    # What the stream would escape or replace, such as a file name that is no text, JSON can say in its own way.
    if encodable(escaped(shown), sys.stdout.encoding) != shown:
        shown = json.dumps(value, allow_nan=False, indent=2)
    print(shown)


def roundness_fields(result: RoundnessResult) -> dict[str, object]:
    """Return a roundness result for JSON; lengths in um, angles in degrees from the spindle index."""
    return {
        "RONt_um": result.ront_um,
        "RONp_um": result.ronp_um,
        "RONv_um": result.ronv_um,
        "RONq_um": result.ronq_um,
        "reference_circle": result.reference_circle,
        "filter_upr": result.filter_upr,
        "state": result.state,
        "eccentricity_um": result.eccentricity_um,
        "points": result.points,
        "harmonics": [
            {"n": h.n, "amplitude_um": h.amplitude_um, "phase_deg": h.phase_deg} for h in result.harmonics
        ],
    }


MARKS = {Severity.OK: "✓", Severity.NOTICE: "·", Severity.WARNING: "!", Severity.REFUSAL: "✗"}


def finding_rows(findings: Iterable[Finding], text: Catalogue) -> list[str]:
    """Return one line for each finding: mark, name, what was met, what is allowed."""
    rows = [
        (MARKS[f.severity], text(f"name.{f.problem.code}"), f.problem.value, f.problem.limit) for f in findings
    ]
    return table(rows)


def finding_fields(finding: Finding, text: Catalogue) -> dict[str, object]:
    """Return a finding for JSON; one that holds has no sentence but its name and numbers."""
    problem = finding.problem
    held = f"{text(f'name.{problem.code}')}: {problem.value} ({problem.limit})"
    return {
        "severity": finding.severity.value,
        "code": problem.code,
        "text": held if finding.severity is Severity.OK else text.problem(problem),
    }


def said_of_place(seen: Diagnosis, text: Catalogue) -> str:
    """Return the place of a lobe with its mechanism, or that neither is clear."""
    if seen.high_at_jaws is None:
        return text("place.between")
    place = text("predict.high" if seen.high_at_jaws else "predict.low")
    if seen.mechanism is None:
        return text("place.no_mechanism", place=place)
    return text("place.mechanism", place=place, mechanism=text(f"mechanism.{seen.mechanism}"))


_DECIMALS = 9
"""Of a number that is too small for the digits that are asked for; what is still smaller is 0."""


class PlainNumber(float):
    """A number whose `g` format writes out what would get an exponent."""

    def __format__(self, spec: str) -> str:
        """Return the number in that format; a large one has all digits that stand before the point."""
        shown = super().__format__(spec)
        if "e" not in shown:
            return shown
        sign = "+" if spec.startswith("+") else ""
        if "e+" in shown:
            return super().__format__(f"{sign}.0f")
        digits = super().__format__(f"{sign}.{_DECIMALS}f").rstrip("0").rstrip(".")
        return "0" if digits in ("0", "-0", "+0") else digits


def tell(problems: Iterable[Problem], text: Catalogue) -> list[str]:
    """Print each problem as a warning on stderr, one line each, and return the sentences."""
    warnings = [text.problem(problem) for problem in problems]
    for warning in warnings:
        print(f"console: {text('warning')}: {warning}", file=sys.stderr)
    sys.stderr.flush()
    return warnings
