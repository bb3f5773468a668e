"""Bounds of a learned path about what its job wants: a file must not command anything else.

Learning corrects a path; it never replaces it. Anything beyond these bounds is not a correction of this cut,
but a fault of the trace, the file or the set-up.
"""

from __future__ import annotations

from collections.abc import Callable

from profiles.compensations.path import CutPath, LobedPath
from profiles.problem import Problem

MOST_MEAN_UM = 60.0
"""Tolerance of the mean: a soft servo under a fine cut is held back by some tens of um."""

MOST_SHARE, MOST_WAVE_UM = 0.6, 10.0
"""Tolerance of the lobe, relative and in um; for a command plus what friction may hold back."""

MOST_WAVES = 50
"""Highest order of an overtone."""


def path_problems(
    path: CutPath,
    job_wants: LobedPath,
    response: Callable[[int], complex],
    friction_um: Callable[[int], float] = lambda _: 0.0,
) -> tuple[Problem, ...]:
    """Return why a path does not fit a cut whose target is `job_wants`: codes `path.*`.

    `response` is the nominal one from command to tool, by order; `friction_um` the amplitude by which dry
    friction may hold the tool back at them, which its command has to make up for.
    """
    shapes = (*_shape(path.target, job_wants), *_shape(path.command, job_wants))
    if shapes:
        return shapes
    target, command, lobe = path.target.waves[0], path.command.waves[0], job_wants.waves[0]
    most_um = MOST_SHARE * lobe.amplitude_um + MOST_WAVE_UM
    off_and_most_um = {
        "wanted": (abs(target.coefficient - lobe.coefficient), most_um),
        "command": (
            abs(response(lobe.lobes) * command.coefficient - target.coefficient),
            most_um + friction_um(lobe.lobes),
        ),
        "wanted mean": (abs(path.target.mean_um - job_wants.mean_um), MOST_MEAN_UM),
        "command mean": (abs(path.command.mean_um - path.target.mean_um), MOST_MEAN_UM),
    }
    for wave in path.target.overtones:
        off_and_most_um[f"{wave.lobes}/rev wanted"] = (wave.amplitude_um, MOST_WAVE_UM)
    for wave in path.command.overtones:
        told_um = abs(response(wave.lobes)) * wave.amplitude_um
        off_and_most_um[f"{wave.lobes}/rev command"] = (told_um, MOST_WAVE_UM + friction_um(wave.lobes))
    return tuple(
        Problem(code="path.beyond", key=key, value=f"{off_um:.1f} um", limit=f"<= {limit_um:.1f} um")
        for key, (off_um, limit_um) in off_and_most_um.items()
        if not off_um <= limit_um
    )


def _shape(path: LobedPath, job_wants: LobedPath) -> tuple[Problem, ...]:
    numbers = [wave.lobes for wave in path.waves]
    if path.lobes != job_wants.lobes or len(set(numbers)) != len(numbers):
        value, limit = ", ".join(map(str, numbers)), f"{job_wants.lobes}, and others once each"
        return (Problem(code="path.waves", key="lobes", value=value, limit=limit),)
    if not all(1 <= number <= MOST_WAVES for number in numbers):
        return (
            Problem(
                code="path.waves", key="lobes", value=", ".join(map(str, numbers)), limit=f"1 to {MOST_WAVES}"
            ),
        )
    if path.growth_per_mm != job_wants.growth_per_mm:
        value, limit = f"{100 * path.growth_per_mm:g} %/mm", f"{100 * job_wants.growth_per_mm:g} %/mm"
        return (Problem(code="path.waves", key="growth", value=value, limit=limit),)
    return ()
