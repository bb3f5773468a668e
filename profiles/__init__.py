"""The profile of the workpiece: described, distorted, compensated, measured. Numbers in, numbers out.

`import profiles` imports nothing else; each module is loaded on first use, so that
`profiles.roundness.evaluate(...)` works in a plain script. Subpackages (`chucking`, `calibration`, `metrology`,
`paper`, `trace_files`) are imported by their full name. Type checkers use the stub beside this file.
"""

_PLACES = {
    "compensation": "compensations.path",
    "cut_error": "lobe.cut_error",
    "cutting": "cutting",
    "envelope": "axis.envelope",
    "findings": "findings",
    "identification": "axis.identification",
    "job": "job",
    "learning": "compensations.learning",
    "least_squares": "least_squares",
    "lobe_fit": "lobe.lobe_fit",
    "machine": "machine",
    "materials": "materials",
    "next_version": "compensations.next_version",
    "prediction": "lobe.prediction",
    "problem": "problem",
    "response": "axis.response",
    "roundness": "roundness",
    "rules": "rules",
    "safe_speed": "axis.envelope",
    "servo": "axis.servo",
    "store": "store",
    "tool_stiffness": "axis.servo",
    "traces": "traces",
}
"""Each public name and its module."""

WORDS = ("words",)
"""Folders with the words of each language."""

__all__ = list(_PLACES)


def __getattr__(name: str) -> object:
    """Return a module of this package, loaded now."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Not by a statement: a package imports nothing by itself.
    return __import__(f"{__name__}.{_PLACES[name]}", fromlist=[name])


def __dir__() -> list[str]:
    """Return the names, including modules that are not loaded yet."""
    return sorted({*globals(), *__all__})
