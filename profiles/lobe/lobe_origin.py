"""Where the lobe of a job comes from: none yet, the model, or the part that its file states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from profiles.job import NO_LOBE, Job
from profiles.lobe.lobe_conditions import CONDITIONS, NAMES, kept_condition
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

MODEL = "model"
_VALUES = ("lobe_error_um_pp", "lobe_phase_deg", "lobe_error_source", "lobe_past_jaw_deg")
_OF_LOBE = (*_VALUES, *CONDITIONS, *NAMES)
_UM_DIGITS, _DEG_DIGITS = 3, 3  # a job file is for people; a nanometre is beyond any model


def without_lobe(job: Job) -> Job:
    """Return the job with no lobe known yet; jaw 1 stays where it is."""
    unset: dict[str, Any] = {key: None for key in (*CONDITIONS, *NAMES, "lobe_past_jaw_deg")}
    assumed = tuple(key for key in job.assumed if key not in _OF_LOBE or key == "lobe_phase_deg")
    return replace(
        job,
        lobe_error_um_pp=0.0,
        lobe_phase_deg=job.jaw_1_deg,
        lobe_error_source=NO_LOBE,
        assumed=assumed,
        **unset,
    )


def with_modelled_lobe(job: Job, machine: MachineProfile) -> Job:
    """Return the job with the lobe that the model predicts in the middle of its cut, to 0.001 um and 0.001 deg.

    Raises `ProfileError`: `rule.material_unknown`, or the rules by which the part cannot be held or cut at all.
    """
    # The model loads numerics, and the rules models of their own, which the first page does without.
    from profiles.chucking.grip import centrifugal_loss_n
    from profiles.chucking.held_part import held_part
    from profiles.findings import refusals
    from profiles.lobe.cut_error import cut_error
    from profiles.rules import IMPOSSIBLE, check

    bare = without_lobe(job)
    broken = [f.problem for f in refusals(check(bare, machine)) if f.problem.code in IMPOSSIBLE]
    if broken:
        raise ProfileError(*broken)
    found = cut_error(held_part(bare, machine), centrifugal_loss_n(bare, machine))
    past_deg = 0.0
    if found.phase_deg is not None:
        lobe_deg = 360.0 / job.jaws
        past_deg = (found.phase_deg - bare.jaw_1_deg + 0.5 * lobe_deg) % lobe_deg - 0.5 * lobe_deg
        past_deg = round(past_deg, _DEG_DIGITS)
    return replace(
        bare,
        lobe_error_um_pp=round(found.um_pp, _UM_DIGITS),
        lobe_phase_deg=bare.jaw_1_deg + past_deg,
        lobe_past_jaw_deg=past_deg or None,
        lobe_error_source=MODEL,
    )


def with_lobe_of(job: Job, filed: Job) -> Job:
    """Return the job with the lobe of its file, found under the conditions there."""
    kept: dict[str, Any] = {key: getattr(filed, key) for key in _OF_LOBE}
    for own in CONDITIONS.values():
        kept |= kept_condition(filed, own, getattr(job, own))
    assumed = {key for key in job.assumed if key not in _OF_LOBE}
    assumed |= {key for key in filed.assumed if key in _OF_LOBE}
    as_filed = tuple(key for key in filed.assumed if key in assumed)
    return replace(job, **{**kept, "assumed": (*as_filed, *sorted(assumed.difference(as_filed)))})
