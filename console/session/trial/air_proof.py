"""Whether gains were proven in air: a health test with exactly these gains, in which nothing swings.

The newest test with them counts. A tool may end beside its step, which friction does; it must not overshoot by
much more than the model of these gains does, nor swing where it should stand. With a notch filter the test also
has to be the one that the model makes of it, and of no other reading of its coefficients.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from console.session.data.health import kept_tests
from console.session.trial.notch_evidence import MOST_TESTS, filter_doubts
from drivers.identification.health_result import HealthResult
from drivers.identification.tool_gains import matches
from profiles.axis.sampled_loop import SampledLoop
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

MORE_OVERSHOOT_PERCENT = 15.0  # than the model has
MOST_SWING, STANDS_AFTER_MS = 0.05, 60.0  # rms over the step, from so long after it
LEAST_SWING_UM = 0.5  # what the noise of a scale makes of a tool that stands
LEAST_COHERENCE = 0.95


def unproven(
    data: Path, machine: MachineProfile, gains: Mapping[str, float], loop: SampledLoop, *, simulated: bool
) -> tuple[Problem, ...]:
    """Return why gains are not proven in air; nothing where they are. `loop` has them, and the known axis."""
    try:
        tests = kept_tests(data, machine.name, MOST_TESTS)
    except ProfileError as error:
        return tuple(error.problems)
    for kept in tests:
        found = kept.result
        if found is not None and found.origin.simulated is simulated and matches(found.origin.gains, gains):
            return (*_swings(found), *filter_doubts(found, loop, machine.tool.motor))
    return (Problem(code="trial.unproven", key=machine.name),)


def _swings(test: HealthResult) -> Iterator[Problem]:
    over, most = test.step.overshoot_percent, test.model.step.overshoot_percent + MORE_OVERSHOOT_PERCENT
    if over > most:
        yield Problem(code="trial.overshoots", value=f"{over:.0f} %", limit=f"<= {most:.0f} %")
    times_ms, position_um = np.array(test.times_ms), np.array(test.position_um)
    standing = position_um[times_ms >= STANDS_AFTER_MS]
    limit_um = max(MOST_SWING * test.step_um, LEAST_SWING_UM)
    if standing.size and float(standing.std()) > limit_um:
        yield Problem(code="trial.swings", value=f"{standing.std():.2f} um", limit=f"<= {limit_um:.2f} um")
    if test.sine.coherence < LEAST_COHERENCE:
        value = f"{test.sine.coherence:.3f}"
        yield Problem(code="trial.incoherent", value=value, limit=f">= {LEAST_COHERENCE:g}")
