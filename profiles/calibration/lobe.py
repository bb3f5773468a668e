"""Find the lobe error of a job in the trace of a part that was cut as the job says, without compensation.

The trace's header lines give the direction and the start of its angles; without both, the phase on the spindle
is unknown, and only the amplitude is known. Where the trace counts from jaw 1, the job has its angle. If a
trace states how its part was cut, it must be without compensation. A simulated part is for practice only, and
the source of the job says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from profiles.chucking.diagnosis import Diagnosis, diagnose
from profiles.chucking.ring import is_thin
from profiles.files import printable
from profiles.job import SIMULATED_SOURCE, Job
from profiles.lobe.lobe_conditions import CONDITIONS
from profiles.lobe.lobe_fit import LobeFit, fit_lobe
from profiles.metrology.points import gaussian_transmission
from profiles.problem import Problem
from profiles.roundness import centred_profile, seen_oval_um_pp
from profiles.trace_files.header import DIRECTIONS, TraceHeader, header_of, size_doubt, unit_doubt
from profiles.traces import Trace

# Value of the header line `start_mark` when the angles of the trace begin at the spindle index.
INDEX = "spindle index"
MOST_FILTERED = 0.005
MOST_BIAS = 0.01
FINEST_UM = 0.01  # no gauge of a workshop resolves less
OVAL = 2  # UPR of an off-axis circle; a chuck with two jaws makes the same
UNDECLARED = 3.0  # multiple of the noise floor above which a harmonic outside the fit is reported
LEAST_UNDECLARED = 0.02  # and the fraction of the tolerance that its amplitude has to be for that


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundLobe:
    """The lobe of a part: the fit, and what it means for the job.

    `phase_deg` is where the released part is high, in spindle degrees in [0, 360), None where unknown.
    `past_jaw_deg` is the angle from jaw 1 to the nearest maximum, positive in the direction of the cut, None where
    the angle of jaw 1 is unknown; so is then `diagnosis`, the cause that its position at the jaws suggests.
    `phase_assumed`: the phase is relative to jaw 1, whose angle the job assumes. `simulated`: the trace was not
    measured by a gauge. `reasons` are why a job cannot use this lobe; `warnings` do not prevent it.
    """

    fit: LobeFit
    phase_deg: float | None
    past_jaw_deg: float | None
    diagnosis: Diagnosis | None
    simulated: bool
    phase_assumed: bool = False
    reasons: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()


def find_lobe(
    trace: Trace, job: Job, *, extra: Iterable[int] = (), robust: bool = False, practice: bool = False
) -> FoundLobe:
    """Find the lobe in the trace of a part of this job; for `practice` the part may be simulated.

    Raises as `fit_lobe`.
    """
    header, unusable = header_of(trace.meta)
    fit = fit_lobe(trace.angle_deg, trace.deviation_um, job.jaws, extra=extra, robust=robust)
    from_index = trace.meta.get("start_mark") == INDEX
    simulated = trace.meta.get("simulated") == "yes"
    phase_deg, past_deg = _on_the_spindle(fit, header, job, from_index)
    seen = None
    if past_deg is not None and fit.lobe.significant:
        thin = is_thin(job.wall_thickness_mm, job.radius_mm)
        seen = diagnose(phase_deg=past_deg, jaw_1_deg=0.0, jaws=job.jaws, thin=thin)
    return FoundLobe(
        fit=fit,
        phase_deg=phase_deg,
        past_jaw_deg=past_deg,
        diagnosis=seen,
        simulated=simulated,
        phase_assumed=phase_deg is not None and not from_index and not _jaw_known(job),
        reasons=(
            *_of_cut(trace.meta, simulated and not practice),
            *unit_doubt(_ront_um(trace), trace.meta, plane=trace.centre_mm is not None),
            *_reasons(fit, header, job, phase_deg),
        ),
        warnings=(*unusable, *_warnings(fit, header, job)),
    )


def with_lobe(job: Job, found: FoundLobe, *, chuck: str, tool: str) -> Job:
    """Return the job with this lobe as its error, found in a cut with its own force, speed and lengths.

    `chuck` and `tool` are their names in the machine, "" where they have none. `found` must have no reasons.
    A condition that the job only assumes stays assumed. The source says whether the part was a simulated one.
    """
    if found.phase_deg is None or found.reasons:
        raise ValueError(found.reasons)
    assumed = {name for name in job.assumed if not name.startswith("lobe_")}
    assumed |= {lobe for lobe, own in CONDITIONS.items() if own in assumed}
    if found.phase_assumed:
        assumed.add("lobe_phase_deg")
    source = job.source.removesuffix(SIMULATED_SOURCE).removesuffix("; ")
    return replace(
        job,
        lobe_error_um_pp=found.fit.error_um_pp,
        lobe_phase_deg=found.phase_deg,
        lobe_past_jaw_deg=found.past_jaw_deg,
        lobe_error_source="fitted",
        lobe_chuck=chuck or None,
        lobe_tool=tool or None,
        assumed=tuple(sorted(assumed)),
        source="; ".join(filter(None, (source, SIMULATED_SOURCE))) if found.simulated else source,
        **{lobe: getattr(job, own) for lobe, own in CONDITIONS.items()},
    )


def _jaw_known(job: Job) -> bool:
    """Whether the job has the spindle angle of jaw 1: a phase found from the index alone is none."""
    fitted_only = job.lobe_past_jaw_deg is None and job.lobe_error_source == "fitted"
    return "lobe_phase_deg" not in job.assumed and not fitted_only


def _on_the_spindle(
    fit: LobeFit, header: TraceHeader, job: Job, from_index: bool
) -> tuple[float | None, float | None]:
    """Return the phase in spindle degrees, and from jaw 1; None for what is unknown."""
    if header.direction is None or not (from_index or header.phase_known):
        return None, None
    sign = -1.0 if header.against_spindle else 1.0
    phase_deg = sign * fit.lobe.phase_deg
    jaw_deg = None if header.jaw_1_deg is None else sign * header.jaw_1_deg
    if jaw_deg is None and _jaw_known(job):
        jaw_deg = job.jaw_1_deg
    if jaw_deg is None:
        return phase_deg % 360.0, None
    lobe_deg = 360.0 / job.jaws
    past_deg = (phase_deg - jaw_deg + 0.5 * lobe_deg) % lobe_deg - 0.5 * lobe_deg
    return ((jaw_deg if from_index else job.jaw_1_deg) + past_deg) % 360.0, past_deg


def _ront_um(trace: Trace) -> float:
    """Return RONt of all points, without a filter: enough to tell one unit from another."""
    return float(np.ptp(centred_profile(trace.angle_deg, trace.deviation_um, None)))


def _of_cut(meta: Mapping[str, str], simulated: bool) -> Iterable[Problem]:
    """Judge how the part was cut: what a compensation has left is not the lobe; unstated means uncompensated."""
    for key in ("strategy", "compensation"):
        if meta.get(key, "none") != "none":
            yield Problem(code="lobe.compensated", key=key, value=printable(meta[key], 60), limit="none")
            break
    if simulated:
        yield Problem(code="lobe.simulated", key="simulated", value="yes", limit="--sim")


def _reasons(fit: LobeFit, header: TraceHeader, job: Job, phase_deg: float | None) -> Iterable[Problem]:
    if header.radius_mm is not None:
        mean_mm = 0.0 if header.size == "relative" else 1e-3 * fit.mean_um
        if doubt := size_doubt(header.radius_mm + mean_mm, job):
            yield doubt
    if header.state == "clamped":
        yield Problem(code="lobe.not_free", key="state", value=header.state, limit="free")
    if header.method not in (None, "radial"):
        yield Problem(code="lobe.method", key="method", value=header.method or "", limit="radial")
    if not fit.lobe.significant:
        value, limit = _um(fit.lobe.amplitude_um), _um(fit.lobe.sd_um)
        yield Problem(code="lobe.not_significant", value=value, limit=limit)
    if phase_deg is None:
        yield Problem(code="lobe.phase_unknown", limit=", ".join(_missing(header)))


def _missing(header: TraceHeader) -> Iterable[str]:
    """Return the lines without which the angles of a trace have no place on the spindle."""
    if header.direction is None:
        yield f"# direction: {' | '.join(DIRECTIONS)}"
    if header.start_mark != INDEX and header.jaw_1_deg is None:
        yield f"# start_mark: {INDEX} | jaw 1 (or # jaw_1_deg: NUMBER)"


def _warnings(fit: LobeFit, header: TraceHeader, job: Job) -> Iterable[Problem]:
    if header.filter_upr is not None:
        lost = 1.0 - float(gaussian_transmission(fit.jaws, header.filter_upr))
        if lost > MOST_FILTERED:
            value, limit = f"{100 * lost:.2g} %", f"{header.filter_upr:g} UPR"
            yield Problem(code="lobe.filtered", key="filter_upr", value=value, limit=limit)
    if fit.left_um > max(UNDECLARED * fit.floor_um, LEAST_UNDECLARED * job.roundness_tolerance_um):
        value, limit = _um(fit.left_um), _um(fit.floor_um)
        yield Problem(code="lobe.undeclared", key=str(fit.left_n), value=value, limit=limit)
    oval_um = seen_oval_um_pp(fit.harmonic(1).amplitude_um, header.radius_of(job))
    if fit.jaws == OVAL and oval_um > MOST_BIAS * fit.error_um_pp:
        value, limit = _um(fit.harmonic(1).amplitude_um), _um(oval_um)
        yield Problem(code="lobe.off_axis", value=value, limit=limit)
    if fit.lobe.significant and fit.lobe.bias_um > max(MOST_BIAS * fit.lobe.amplitude_um, FINEST_UM):
        yield Problem(code="lobe.biased", value=_um(fit.lobe.bias_um), limit=f"{100 * MOST_BIAS:g} %")


def _um(size_um: float) -> str:
    """Return an amplitude to three digits, and to no more decimals than a gauge resolves."""
    if size_um < FINEST_UM:
        return f"< {FINEST_UM:g} um"
    return f"{round(float(f'{size_um:.3g}'), 2):g} um"
