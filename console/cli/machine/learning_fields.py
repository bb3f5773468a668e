"""Series of learning parts for JSON, unrounded."""

from __future__ import annotations

from collections.abc import Iterable

from console.cli.machine.run_fields import run_fields
from console.cli.measured.roundness_fields import roundness_fields
from console.session.learning.learning import LearnedPart, LearnResult
from profiles.compensations.path import Wave


def learning_fields(result: LearnResult, warnings: list[str]) -> dict[str, object]:
    """Return the result: a run whose part is the last one, with all parts beside it."""
    return {
        **run_fields(result.last, warnings),
        "passes": [_part_fields(part) for part in result.parts],
        "floor": roundness_fields(result.floor),
    }


def _part_fields(part: LearnedPart) -> dict[str, object]:
    return {
        **roundness_fields(part.roundness),
        "mean_deviation_um": part.roundness.mean_deviation_um,
        "learned": {
            "air_lobe_error_um_pp": list(part.air_um),
            "wanted_mean_um": part.path.target.mean_um,
            "wanted": _wave_fields(part.path.target.waves),
            "command_mean_um": part.path.command.mean_um,
            "command": _wave_fields(part.path.command.waves),
            "trim": _wave_fields((Wave.of(part.path.target.lobes, part.trim_um),)),
            "tool_mean_error_um": part.tool_off.mean_um,
            "tool_error": _wave_fields(Wave.of(n, c) for n, c in sorted(part.tool_off.coefficients_um.items())),
            "part_gain": part.part_gain,
            "learned_waves": list(part.learned),
            "frozen": [
                {"n": each.waves, "best_um": each.best_um, "grown_um": each.grown_um} for each in part.grown
            ],
        },
    }


def _wave_fields(waves: Iterable[Wave]) -> list[dict[str, object]]:
    return [{"n": w.lobes, "amplitude_um": w.amplitude_um, "crest_deg": w.crest_deg} for w in waves]
