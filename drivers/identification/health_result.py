"""The result of a health test: figures of step, parabola and sine beside those of the model, as they are kept."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from drivers.identification.result import IdentifiedPoint, Origin
from profiles.axis.step_figures import ErrorFigures, StepFigures
from profiles.strict_values import positive, read_own

SCHEMA = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthModel:
    """What the loop of the profile would have made of the same reference, with the gains that were read."""

    step: StepFigures
    parabola: ErrorFigures
    gain: float
    phase_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthResult:
    """One test. `date` is UTC; the samples are those about the step: ms from its beginning, and um."""

    origin: Origin
    date: str
    step_um: float
    step: StepFigures
    parabola: ErrorFigures
    sine: IdentifiedPoint
    model: HealthModel
    times_ms: tuple[float, ...]
    reference_um: tuple[float, ...]
    position_um: tuple[float, ...]


FIGURES = tuple(
    "rise_ms overshoot_percent settling_ms end_um peak_um rms_um sine_gain sine_phase_deg coherence".split()
)
"""Names of what is compared from test to test."""


def figures_of(result: HealthResult) -> dict[str, float]:
    """Return the `FIGURES` of a test by name, without those that the tool did not reach."""
    return _named(result.step, result.parabola) | {
        "sine_gain": result.sine.gain,
        "sine_phase_deg": result.sine.phase_deg,
        "coherence": result.sine.coherence,
    }


def model_figures_of(result: HealthResult) -> dict[str, float]:
    """Return the same of the model; it has no coherence."""
    model = result.model
    return _named(model.step, model.parabola) | {"sine_gain": model.gain, "sine_phase_deg": model.phase_deg}


def _named(step: StepFigures, parabola: ErrorFigures) -> dict[str, float]:
    """Return figures by name; what the tool did not reach is left out."""
    found = {
        "rise_ms": step.rise_ms,
        "overshoot_percent": step.overshoot_percent,
        "settling_ms": step.settling_ms,
        "end_um": step.end_um,
        "peak_um": parabola.peak_um,
        "rms_um": parabola.rms_um,
    }
    return {key: value for key, value in found.items() if value is not None}


def as_table(result: HealthResult) -> dict[str, Any]:
    """Return the result as plain values for a file."""
    return {"schema": SCHEMA, **asdict(result)}


def from_table(table: Any, where: str = "") -> HealthResult:
    """Read the output of `as_table`. Raises ProfileError: `schema.unsupported`; `health.file`, anything else."""
    return read_own(HealthResult, table, schema=SCHEMA, code="health.file", where=where, judge=_judge)


def _judge(result: HealthResult) -> None:
    positive(result.step_um)
    if not len(result.times_ms) == len(result.reference_um) == len(result.position_um):
        raise ValueError(f"{len(result.times_ms)} times, {len(result.position_um)} positions")
