"""Explain, beside a comparison with the profile, that gains are on trial or that its filter is not proven."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from console.session.tuning.record import RESTORED, ended_by, open_trial
from console.session.tuning.standing_trial import format_gains
from drivers.commissioning.check import Check, Group
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.identification.tool_gains import indices_of
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

DATE = len("2001-11-30T14:05")


def explained_checks(
    data: Path, machine: MachineProfile, address: str, read: ControllerConfiguration, *, simulated: bool
) -> list[Check]:
    """Return warnings beside the checks of a configuration: gains on trial, a filter that no test has proven."""

    def gains() -> dict[str, float]:
        settings, indices = read.settings, indices_of(read.dialect, machine.tool.motor)
        return {name: settings[index] for name, index in indices.items() if index in settings}

    firmware = read.version, read.kind
    return [
        *trial_checks(data, machine, address, gains, simulated=simulated),
        *filter_checks(data, machine, firmware, simulated=simulated),
    ]


def trial_checks(
    data: Path, machine: MachineProfile, address: str, found: Callable[[], Mapping[str, float]], *, simulated: bool
) -> list[Check]:
    """Return a warning with both sets of gains where a trial is not over; nothing for an unreadable file.

    Gains of before or of the profile, where those are `found` in the controller, end a trial; the console that has
    control writes that down.
    """
    try:
        kept = open_trial(data, machine.name, address, simulated=simulated)
    except ProfileError:  # the differences themselves are told all the same
        return []
    if kept is None:
        return []
    gains = found()
    trial = kept[1].complete(tuple(gains))
    if gains.keys() == trial.before.keys() and ended_by(machine, trial, gains) == RESTORED:
        return []
    first = trial.events[0] if trial.events else None
    facts = {"date": "-" if first is None else first.date[:DATE], "by": "-" if first is None else first.by}
    return [
        Check(
            Group.TOOL,
            "gains_on_trial",
            Severity.WARNING,
            "tool",
            found=format_gains(tuple(trial.proposed.items())),
            wanted=format_gains(tuple(trial.before.items())),
            facts=facts,
        )
    ]


def trial_note(
    data: Path, machine: MachineProfile, address: str, found: Callable[[], Mapping[str, float]], *, simulated: bool
) -> tuple[Problem, ...]:
    """Return `trial.active` where a trial is not over, to explain settings that differ."""
    return tuple(
        Problem(code="trial.active", value=check.found, limit=check.wanted)
        for check in trial_checks(data, machine, address, found, simulated=simulated)
    )


def filter_checks(
    data: Path, machine: MachineProfile, firmware: tuple[str, str], *, simulated: bool
) -> list[Check]:
    """Return a warning where no test in air has proven the notch filter of the profile: no cut is armed then."""
    from console.session.tuning.air_proof import stated_filter_problems  # it computes

    found = stated_filter_problems(machine, data, firmware, simulated=simulated)
    if not found:
        return []
    code = "filter_untested" if found[0].code == "trial.filter_untested" else "filter_unproven"
    return [Check(Group.TOOL, code, Severity.WARNING, "tool")]
