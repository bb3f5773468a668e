"""The notch filter that a profile states: nothing is cut with it before a health test in air has proven it.

A manual says how a controller reads the signs of its coefficients; only a test on this controller shows it. How
the filter has come into the profile, from a trial or by hand, makes no difference.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.session.data.identified_responses import FOLDER
from console.session.data.kept_files import folder_name
from console.session.tuning.air_proof import doubts, newest_test
from console.session.tuning.bounds import FAST_SWEEP, SLOW_SWEEP, unmeasured_problem
from console.session.tuning.known_loop import known_loop
from console.session.tuning.notch_evidence import NO_FIRMWARE, format_residual
from drivers.identification.health import HealthResult
from drivers.identification.tool_gains import names_of
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import notch_from_variables, present_settings
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

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
