"""What ends a trial of gains by itself: the controller has the gains of before, or those of the profile."""

from __future__ import annotations

from collections.abc import Mapping

from console.session.tuning import record as records
from console.session.tuning.record import TrialRecord
from drivers.identification.tool_gains import matches
from profiles.axis.servo_gains import stated_settings
from profiles.machine import MachineProfile


def ended_by(machine: MachineProfile, trial: TrialRecord, found: Mapping[str, float]) -> str:
    """Return the event that ends a trial with the gains that were found, "" where it goes on.

    `adopted` is that the profile has the proposed ones: those have to be proven in air first. With others of the
    profile, as `controller apply` writes them, nothing of the trial is left; a filter among them is proven as any
    of a profile (`console.session.tuning.stated_filter`).
    """
    if matches(found, trial.before):
        return records.RESTORED
    if matches(stated_settings(machine), found):
        return records.ADOPTED if matches(found, trial.proposed) else records.RESTORED
    return ""
