"""Predict what a plain cut of a job leaves: the error over angle and length, its causes, and warnings.

Where the job's lobe was found on a part, the shape is that of the model, and height and angle are those of the
lobe that was found; the unscaled model is given too.

Angles are spindle angles in degrees; `z_mm` is from the jaw faces, positive towards the free end. Deviations of
the released part are in um, positive where it is high.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats, read_only
from profiles.axis.envelope import Envelope, envelope
from profiles.chucking.advice import ClampingAdvice, clamping_advice
from profiles.chucking.diagnosis import Mechanism
from profiles.chucking.grip import centrifugal_loss_n
from profiles.chucking.held_part import held_part
from profiles.cutting_process import CuttingProcess, cutting_process, process_findings
from profiles.findings import Finding, Severity, judge_condition, refusals
from profiles.job import Job
from profiles.lobe.cut_error import CutError, LobeScale, cut_error, lobe_change_um, lobe_scale, scaled_cut
from profiles.lobe.lobe_conditions import found_on_a_part
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError, refusal_error
from profiles.rules import IMPOSSIBLE, check

Z_PLACES, ANGLES, STOCK_STEPS = 7, 360, 3

_OF_PREDICTION = (
    "rule.force_over_chuck",
    "rule.grip_margin",
    "rule.grip_need",
    "rule.grip_loss",
    "rule.material_unknown",
    "rule.clamp_stress",
    "rule.clamp_scatter",
    "rule.clamp_span",
    "rule.chatter_width",
    "rule.depth_under_lobe",
    "rule.tool_force",
    "rule.encoder_acceleration",
    "rule.along_middle",
    "rule.along_degree",
    "rule.moving_out",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """The prediction of one job on one machine; the arrays are read only.

    `error_um` has shape (Z, angle) and a mean of 0 over each turn; `parts_um` has the same for each mechanism.
    `size_um` (Z,) is the excess of the radius because the part deflects. `cut` is the error in its middle,
    `stock_um_pp` the same after `stock_mm` is removed from the radius, at the same force. All of these, and the
    lobed blank of `process`, are scaled to `scaled_to`, the lobe that was found; None where none was, or where
    the model has no such lobe there. `model` is `cut` as the model alone has it, `model_um_pp` (Z,) its peak to
    peak of `error_um`. `assumed` names the keys of the machine that were not given.
    """

    angle_deg: Floats
    z_mm: Floats
    error_um: Floats
    parts_um: dict[Mechanism, Floats]
    model_um_pp: Floats
    size_um: Floats
    cut: CutError
    model: CutError
    scaled_to: LobeScale | None
    stock_mm: Floats
    stock_um_pp: Floats
    process: CuttingProcess
    advice: ClampingAdvice
    envelope: Envelope
    assumed: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def error_um_pp(self) -> Floats:
        """Peak-to-peak error at each Z, shape (Z,)."""
        return floats(np.ptp(self.error_um, axis=1))


def predict(
    job: Job, machine: MachineProfile, *, angle_deg: ArrayLike | None = None, z_mm: ArrayLike | None = None
) -> Prediction:
    """Return the prediction, by default for a turn in whole degrees and from the jaws to the free end.

    Raises `ProfileError`: a material without data (`rule.material_unknown`), a Z that is not in front of the jaws
    (`value.out_of_range`), or a part that cannot be held or cut at all, with the rules that were broken.
    """
    of_rules = check(job, machine)
    broken = [f.problem for f in refusals(of_rules) if f.problem.code in IMPOSSIBLE]
    if broken:
        raise ProfileError(*broken)
    part, loss_n, scale = held_part(job, machine), centrifugal_loss_n(job, machine), lobe_scale(job, machine)
    factor = 1.0 if scale is None else scale.factor
    z = _places(job, z_mm)
    angle = read_only(np.arange(ANGLES) * (360 / ANGLES) if angle_deg is None else np.atleast_1d(angle_deg))
    stock_mm = np.linspace(0.0, job.depth_of_cut_mm, STOCK_STEPS)
    stock = [cut_error(part.turned_down(float(depth)), loss_n) for depth in stock_mm]
    from_jaw_deg = angle - job.jaw_1_deg
    if scale is not None and stock[0].phase_deg is not None:
        # By how far the maximum that was found is past that of the model.
        from_jaw_deg = from_jaw_deg - round(job.lobe_phase_deg - stock[0].phase_deg, 6)
    bare = part.error_parts_um(from_jaw_deg, z)
    parts = {name: read_only(factor * each) for name, each in bare.items()}
    cut = stock[0] if scale is None else scaled_cut(stock[0], factor, job.lobe_phase_deg)
    lobed_um_pp = job.lobe_error_um_pp if scale is None and found_on_a_part(job) else cut.um_pp
    of_prediction = (f for f in of_rules if f.problem.code in _OF_PREDICTION)
    return Prediction(
        angle_deg=angle,
        z_mm=z,
        error_um=read_only(np.sum(list(parts.values()), axis=0)),
        parts_um=parts,
        model_um_pp=read_only(np.ptp(np.sum(list(bare.values()), axis=0), axis=1)),
        size_um=read_only(part.size_um(z)),
        cut=cut,
        model=stock[0],
        scaled_to=scale,
        stock_mm=read_only(stock_mm),
        stock_um_pp=read_only([factor * each.um_pp for each in stock]),
        process=cutting_process(part, machine, lobed_um_pp),
        advice=clamping_advice(job, machine),
        envelope=envelope(job, machine),
        assumed=part.holding.assumed,
        findings=(*of_prediction, *_second_pass(job, machine), *process_findings(part, machine)),
    )


def _second_pass(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Judge whether a second pass may use the same compensation; empty where no lobe can be judged."""
    change_um, most_um = lobe_change_um(job, machine), job.roundness_tolerance_um
    if change_um is None:
        return ()
    value, limit = f"{change_um:+.3g} um", f"± {most_um:.6g} um"
    problem = Problem(code="rule.second_pass", key="depth_of_cut_mm", value=value, limit=limit)
    return (judge_condition(abs(change_um) <= most_um, problem, Severity.WARNING),)


def _places(job: Job, z_mm: ArrayLike | None) -> Floats:
    if z_mm is None:
        return read_only(np.linspace(0.0, job.overhang_mm, Z_PLACES))
    z = read_only(np.atleast_1d(floats(z_mm)))
    for each in z[~((z >= 0) & (z <= job.overhang_mm))][:1]:
        limit = f">= 0, <= {job.overhang_mm:.6g} mm"
        raise refusal_error("value.out_of_range", key="z_mm", value=f"{each:.6g} mm", limit=limit)
    return z
