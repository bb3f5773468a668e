"""What a plain cut of a job will leave: the error over angle and length, where it comes from, and what to mind.

Angles are spindle angles in degrees; `z_mm` is from the jaw faces, positive towards the free end. Deviations of
the released part are in um, positive where it is high.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.chucking.advice import ClampingAdvice, clamping_advice
from profiles.chucking.diagnosis import Mechanism
from profiles.chucking.held_part import HeldPart
from profiles.chucking.holding import holding_of
from profiles.cut_error import CutError, cut_error
from profiles.cutting import cutting_force
from profiles.cutting_process import CuttingProcess, cutting_process, process_findings
from profiles.envelope import Envelope, envelope
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.problem import Problem, ProfileError
from profiles.rules import Finding, Severity, centrifugal_loss_n, check, refusals

FloatArray = NDArray[np.float64]

Z_PLACES, ANGLES, STOCK_STEPS = 7, 360, 6

_IMPOSSIBLE = ("rule.wall_over_radius", "rule.depth_over_wall", "rule.grip_margin")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """The prediction of one job on one machine; the arrays are read only.

    `error_um` has shape (Z, angle) and a mean of 0 over each turn; `parts_um` has the same for each mechanism in
    it. `size_um` (Z,) is by how much the radius comes out too large because the part gives way. `stock_um_pp` is
    the error in the middle of the cut when `stock_mm` has come off the radius, at the same force. `assumed` names
    the keys of the machine that nobody gave.
    """

    angle_deg: FloatArray
    z_mm: FloatArray
    error_um: FloatArray
    parts_um: dict[Mechanism, FloatArray]
    size_um: FloatArray
    cut: CutError
    stock_mm: FloatArray
    stock_um_pp: FloatArray
    process: CuttingProcess
    advice: ClampingAdvice
    envelope: Envelope
    assumed: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def error_um_pp(self) -> FloatArray:
        """Peak-to-peak error at each Z, shape (Z,)."""
        return np.asarray(np.ptp(self.error_um, axis=1), dtype=np.float64)


def predict(
    job: Job, machine: MachineProfile, *, angle_deg: ArrayLike | None = None, z_mm: ArrayLike | None = None
) -> Prediction:
    """Return the prediction, for a turn in whole degrees and from the jaws to the free end if not told otherwise.

    Raises:
        ProfileError: a material without numbers (`rule.material_unknown`), a Z that is not in front of the jaws
            (`value.out_of_range`), or a part that cannot be held or cut at all, with the rules that say so.
    """
    broken = [f.problem for f in refusals(check(job, machine)) if f.problem.code in _IMPOSSIBLE]
    if broken:
        raise ProfileError(*broken)
    part, loss_n = held_part(job, machine), centrifugal_loss_n(job, machine)
    z = _places(job, z_mm)
    angle = _kept(np.arange(ANGLES) * (360 / ANGLES) if angle_deg is None else np.atleast_1d(angle_deg))
    parts = {k: _kept(v) for k, v in part.error_parts_um(angle - job.jaw_1_deg, z).items()}
    stock_mm = np.linspace(0.0, job.depth_of_cut_mm, STOCK_STEPS)
    stock = [cut_error(part.turned_down(float(depth)), loss_n) for depth in stock_mm]
    process, advice = cutting_process(part, machine, stock[0].um_pp), clamping_advice(job, machine)
    findings = (*advice.findings, _second_pass(job, stock), *process_findings(part, machine, process))
    return Prediction(
        angle_deg=angle,
        z_mm=z,
        error_um=_kept(np.sum(list(parts.values()), axis=0)),
        parts_um=parts,
        size_um=_kept(part.size_um(z)),
        cut=stock[0],
        stock_mm=_kept(stock_mm),
        stock_um_pp=_kept([each.um_pp for each in stock]),
        process=process,
        advice=advice,
        envelope=envelope(job, machine),
        assumed=part.holding.assumed,
        findings=findings,
    )


def held_part(job: Job, machine: MachineProfile) -> HeldPart:
    """Return the part in the jaws at speed, under its cut.

    Raises:
        ProfileError: `rule.material_unknown`.
    """
    material = material_named(job.material)
    return HeldPart(
        job=job,
        material=material,
        holding=holding_of(machine),
        force=cutting_force(material, job.depth_of_cut_mm, job.feed_mm_per_rev),
        per_jaw_n=(job.chucking_force_n - centrifugal_loss_n(job, machine)) / job.jaws,
    )


def _second_pass(job: Job, stock: list[CutError]) -> Finding:
    """`rule.second_pass`: at the same force a thinner wall springs back further, p-p ~ R^3 / t^3.

    Far from the jaws, where the lobe dies away and changes its sign, it may also become smaller. A compensation of
    the pass before is wrong by the change either way.
    """
    change_um, most_um = stock[-1].um_pp - stock[0].um_pp, job.roundness_tolerance_um
    value, limit = f"{change_um:+.6g} um", f"± {most_um:.6g} um"
    problem = Problem(code="rule.second_pass", key="depth_of_cut_mm", value=value, limit=limit)
    return Finding(severity=Severity.OK if abs(change_um) <= most_um else Severity.WARNING, problem=problem)


def _places(job: Job, z_mm: ArrayLike | None) -> FloatArray:
    if z_mm is None:
        return _kept(np.linspace(0.0, job.overhang_mm, Z_PLACES))
    z = _kept(np.atleast_1d(np.asarray(z_mm, dtype=np.float64)))
    for each in z[~((z >= 0) & (z <= job.overhang_mm))][:1]:
        limit = f">= 0, <= {job.overhang_mm:.6g} mm"
        raise ProfileError(Problem(code="value.out_of_range", key="z_mm", value=f"{each:.6g} mm", limit=limit))
    return z


def _kept(values: ArrayLike) -> FloatArray:
    copied = np.array(values, dtype=np.float64)
    copied.setflags(write=False)
    return copied
