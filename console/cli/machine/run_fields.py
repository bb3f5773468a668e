"""Result of a run for JSON, unrounded; what was not measured is null."""

from __future__ import annotations

from dataclasses import asdict

from console.cli.clamping_fields import span_fields
from console.cli.measured.roundness_fields import roundness_fields
from console.session.cut.run import RunResult


def run_fields(result: RunResult, warnings: list[str]) -> dict[str, object]:
    """Return the result, with the warnings that were printed on stderr."""
    plan, figures = result.plan, result.figures
    return {
        "job": plan.job.name,
        "machine": plan.machine.name,
        "simulated": result.simulated,
        "strategy": plan.cut.strategy.value,
        "stage": plan.stage.value,
        "compensation": plan.compensation,
        "inverted": plan.inverted or "model",
        "expected": None if plan.expected is None else asdict(plan.expected),
        "clamping": span_fields(plan.job, plan.machine),
        "spindle_rpm": figures.spindle_speed_rpm,
        "lobe_frequency_hz": result.lobe_frequency_hz,
        "before": None if result.before is None else roundness_fields(result.before),
        "after": None if result.after is None else roundness_fields(result.after),
        "improvement_percent": result.improvement_percent,
        "roundness_tolerance_um": plan.job.roundness_tolerance_um,
        "within_tolerance": result.within_tolerance,
        "tool_error_um": figures.tool_error_um,
        "tool_error_rms_um": figures.tool_error_rms_um,
        "following_error_um": figures.following_error_um,
        "following_error_rms_um": figures.following_error_rms_um,
        "telemetry_samples": figures.samples,
        "segment_ms": plan.cut.segment_ms,
        "cut_duration_s": plan.cut.duration_s,
        "warnings": warnings,
        "collisions": list(result.collisions),
    }
