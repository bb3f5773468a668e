"""Whether gains were proven in air: a health test with exactly these gains, in which nothing swings.

The newest test with them counts. A tool may end beside its step, which friction does; it must not overshoot by
much more than the model of these gains does, nor swing where it should stand. With a notch filter the test also
has to be the one that the model makes of it, and of no other reading of its coefficients.

Nothing is cut with the notch filter that a profile states before a health test in air has proven it. A manual says
how a controller reads the signs of its coefficients; only a test on this controller shows it. How the filter has
come into the profile, from a trial or by hand, makes no difference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from console.session.data.health import KeptHealth, kept_tests
from console.session.data.identified_responses import FOLDER
from console.session.data.kept_files import folder_name
from console.session.tuning.bounds import FAST_SWEEP, SLOW_SWEEP, unmeasured_problem
from console.session.tuning.known_loop import known_loop
from console.session.tuning.notch_evidence import (
    MOST_TESTS,
    NO_FIRMWARE,
    filter_doubts,
    format_residual,
    same_firmware,
)
from drivers.identification.health import HealthResult
from drivers.identification.tool_gains import matches, names_of
from profiles.axis.sampled_loop import SampledLoop, loop_of
from profiles.axis.servo_gains import notch_from_variables, present_settings
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

MORE_OVERSHOOT_PERCENT = 15.0  # than the model has
MOST_SWING, STANDS_AFTER_MS = 0.05, 60.0  # rms over the step, from so long after it
LEAST_SWING_UM = 0.5  # what the noise of a scale makes of a tool that stands
LEAST_COHERENCE = 0.95


def find_missing_proofs(
    data: Path, machine: MachineProfile, gains: Mapping[str, float], loop: SampledLoop, *, simulated: bool
) -> tuple[Problem, ...]:
    """Return why gains are not proven in air; nothing where they are. `loop` has them, and the known axis."""
    try:
        kept = newest_test(data, machine, gains, simulated=simulated)
    except ProfileError as error:
        return tuple(error.problems)
    if kept is None or kept.result is None:
        return (Problem(code="trial.unproven", key=machine.name),)
    return doubts(kept.result, loop, machine.tool.motor)


def newest_test(
    data: Path,
    machine: MachineProfile,
    gains: Mapping[str, float],
    firmware: tuple[str, str] = NO_FIRMWARE,
    *,
    simulated: bool,
) -> KeptHealth | None:
    """Return the newest test with exactly these gains; None where none was made, on this firmware if it is known.

    Raises ProfileError: the folder cannot be read.
    """
    for kept in kept_tests(data, machine.name, MOST_TESTS):
        found = kept.result
        if found is None or found.origin.simulated is not simulated or not matches(found.origin.gains, gains):
            continue
        if same_firmware(firmware, found):
            return kept
    return None


def doubts(test: HealthResult, loop: SampledLoop, motor: int) -> tuple[Problem, ...]:
    """Return why a test does not prove the gains of a loop of a motor."""
    return (*_swings(test), *filter_doubts(test, loop, motor))


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


_roundness_exit_code: dict[tuple[object, ...], tuple[Problem, ...]] = {}
"""What was found of each test since the program started: after a new test or response the axis is fitted again."""


def stated_filter_problems(
    machine: MachineProfile, data: Path, firmware: tuple[str, str] = NO_FIRMWARE, *, simulated: bool
) -> tuple[Problem, ...]:
    """Return why nothing is cut with the notch filter of a profile; nothing where it has none, or it is proven.

    It takes up to a second where a test or a response is new: call it at rest.
    """
    if not notch_from_variables(machine):
        return ()
    gains = present_settings(machine, names_of(machine.tool.motor))
    try:
        kept = newest_test(data, machine, gains, firmware, simulated=simulated)
        if kept is None or kept.result is None:
            return (Problem(code="trial.filter_untested", key=machine.name),)
        responses = tuple(sorted(each.name for each in (data / FOLDER / folder_name(machine.name)).glob("*.json")))
        question = repr(machine), str(kept.file), responses, firmware, simulated
        if question not in _roundness_exit_code:
            _roundness_exit_code[question] = _doubts(machine, data, firmware, kept.result, simulated=simulated)
        return _roundness_exit_code[question]
    except ProfileError as error:
        return tuple(error.problems)


def _doubts(
    machine: MachineProfile, data: Path, firmware: tuple[str, str], test: HealthResult, *, simulated: bool
) -> tuple[Problem, ...]:
    known = known_loop(machine, data, firmware, simulated=simulated)
    if known.unfiltered and known.fit is not None:
        judged = doubts(test, known.loop, machine.tool.motor)
        if known.fit.holds:
            return judged
        # By an axis that its responses do not show a test says nothing: only other responses help, or no filter.
        folder = printable(str(data / FOLDER / folder_name(machine.name)))
        return (replace(unmeasured_problem(known), code="trial.filter_misfit", key=folder),)
    # An axis fitted to responses with the filter would explain a test with it however it is read.
    loop = loop_of(machine)
    if not doubts(test, loop, machine.tool.motor):
        return ()
    value = format_residual(test, loop)
    return (Problem(code="trial.filter_axis", key=SLOW_SWEEP, value=value, limit=FAST_SWEEP),)
