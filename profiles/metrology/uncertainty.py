"""The uncertainty of RONt, CYLt and a mean diameter: a budget after the GUM.

The diameter is linear in its errors (JCGM 100): u = root of the sum of squares, U = 2 u. RONt and CYLt are not
(JCGM 101): errors of each kind are drawn, added to the profile of the part, and evaluated again; U holds 95.45 %
of the changes, either way. A peak to valley is biased upwards by noise, so that these changes are no bell about 0:
the bias is in U (GUM F.2.4.5). The profile to which errors are added is the measured one less the power of such
errors, since the measured one has them already.

CYLt is that of the minimum zone in each draw: about the least squares cylinder it changes by a fifth more, so that
U would hold 98 to 99 %. Amounts are as in `profiles.gauge`; limits are taken as rectangular. A harmonic is its
phasor c, um: deviation = Re c exp(j n angle). Arrays are (D draws, S sections, K orders from 0) or (D, S, angles).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats, floats
from profiles.gauge import GaugeProfile
from profiles.job import Job
from profiles.materials import material_or_none
from profiles.metrology.conformity import COVERAGE_FACTOR, FigureUncertainty
from profiles.metrology.cylindricity import (
    LEAST_SECTIONS,
    PartSection,
    contacts,
    filtered_section,
    section_at,
    zone_columns,
)
from profiles.metrology.points import POINTS_PER_UNDULATION, gaussian_transmission
from profiles.metrology.profile_filters import FilterKind
from profiles.metrology.separation import GaugeError
from profiles.roundness import SMALLEST_MM, RoundnessResult
from profiles.trace_files.header import TraceHeader

Spectra = NDArray[np.complex128]

COVERAGE = 0.9545  # of k = 2
DRAWS, ROW_DRAWS = 400, 150  # of the whole, and of a row of the table
SEED = 14253  # the same part has the same U each time
LOW_ORDERS = (2, 3, 4, 5)  # where a spindle errs that does not say at which order: a choice
CLAMPED = "clamped"  # state of a part that is still held: its form says nothing of the released part
_MOST_UPR = 150.0  # evaluated up to here where there is no filter
_PASSED = 2.5  # cut-offs above which a filter passes next to nothing
_SQRT_3 = math.sqrt(3.0)  # half-width of a rectangular distribution over its standard deviation
_LARGEST_EXPANSION = 24.0  # um/(m K), of aluminium: of a part of unknown material
_BESIDE = 1.5  # ratio of orders within which the power of a profile is taken as a whole: a choice
_DOUBT = (
    2.0  # standard deviations by which errors may be more than they are on average, so that their bias is held
)
_ANGLES_AN_ORDER = 3  # with fewer the peaks of noise fall between angles
_NOTHING = 1e-12
_CLOSE = 1e-6  # fraction of the form to which a zone is found
_FIGURES = ("roundness", "cylindricity", "diameter")
_FORM = _FIGURES[:2]
# Each source of uncertainty, with the figures that it affects and the key that has to state it.
_SOURCES: Mapping[str, tuple[tuple[str, ...], str]] = {
    "spindle": (_FORM, "spindle_error_um"),
    "probe_noise": (_FORM, "probe_noise_um"),
    "probe_gain": (_FORM, "probe_gain_percent"),
    "repeat": (_FORM, "repeat_um"),
    "eccentricity": (_FORM, ""),
    "filter": (_FORM, ""),
    "column": (_FORM[1:], "column_error_um"),
    "size": (_FIGURES[2:], "size_error_um"),
    "temperature": (_FIGURES[2:], "temperature_off_k"),
    "state": (_FIGURES, ""),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownGauge:
    """A gauge as its file states it, and its own error, which is taken off its readings; None: not known."""

    profile: GaugeProfile
    error: GaugeError | None = None

    def order_sd_um(self, phasors_um: Mapping[int, complex], points: int) -> dict[int, float]:
        """Return the standard uncertainty of each order of a part that was read in so many points, um.

        It is that of one component of the phasor, from what is stated: of the spindle, of noise, of the
        amplification and of the start mark. What is stated of RONt is taken as if all of it were at this order.
        """
        own, found = self.profile, dict[int, float]()
        spindle = self._spindle_sd_um()
        of_ront_um = (own.repeat_um or 0.0) / 2.0
        noise_um = (own.probe_noise_um or 0.0) * math.sqrt(2.0 / points)
        for n, phasor_um in phasors_um.items():
            gain_um = 0.01 * (own.probe_gain_percent or 0.0) / _SQRT_3 * abs(phasor_um)
            turned_um = n * math.radians(own.set_up_angle_deg or 0.0) * abs(phasor_um)
            if own.roundness_u_um is not None:
                found[n] = math.hypot(own.roundness_u_um / COVERAGE_FACTOR / 2.0, turned_um)
            else:
                found[n] = math.hypot(spindle.get(n, 0.0), noise_um, of_ront_um, gain_um, turned_um)
        return found

    def _spindle_sd_um(self) -> dict[int, float]:
        """Return that of the spindle, at the orders where it is not 0 or not known."""
        own, sd_um = self.profile, {} if self.error is None else _order_sd_um(self.error)
        stated = LOW_ORDERS if own.spindle_error_upr is None else (own.spindle_error_upr,)
        places = stated if self.error is None else [n for n, um in sd_um.items() if not math.isfinite(um)]
        stated_um = (own.spindle_error_um or 0.0) / math.sqrt(2.0 * len(places)) if places else 0.0
        return sd_um | dict.fromkeys(places, stated_um)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FormSpectrum:
    """What a gauge has measured: the phasors of S filtered sections, (S, K), um, and their heights (S,), mm.

    Each section had so many `points`. `radius_mm` is that of the part, None: not known. `off_axis_um` is how far
    off the axis it was evaluated by the limacon. `expansion_um_per_m_k` is that of its material.
    """

    phasors_um: Spectra
    z_mm: Floats
    points: int
    filter_upr: float | None
    radius_mm: float | None
    off_axis_um: float
    state: str
    expansion_um_per_m_k: float

    @property
    def has_length(self) -> bool:
        """Whether it has sections enough for a cylindricity."""
        return np.unique(self.z_mm).size >= LEAST_SECTIONS


def measured_form(
    sections: Sequence[PartSection],
    *,
    filter_upr: float | None,
    filter_kind: FilterKind = FilterKind.GAUSS,
    radius_mm: float | None,
    off_axis_um: float = 0.0,
    state: str = "unknown",
    material: str = "",
) -> FormSpectrum:
    """Return the form of a part from its unfiltered sections, one or several. Raises as `profile_of`."""
    points = min(each.angle_deg.size for each in sections)
    angles = min(math.ceil(POINTS_PER_UNDULATION * min(filter_upr or _MOST_UPR, _MOST_UPR)), points)
    turn = floats(np.arange(angles) * (360.0 / angles))
    stack = np.stack([section_at(filtered_section(each, filter_upr, filter_kind), turn) for each in sections])
    phasors = 2.0 / angles * np.fft.rfft(stack)[:, : (angles + 1) // 2]
    phasors[:, 0] /= 2.0
    known = material_or_none(material)
    return FormSpectrum(
        phasors_um=phasors,
        z_mm=floats([each.z_mm for each in sections]),
        points=points,
        filter_upr=filter_upr,
        radius_mm=radius_mm,
        off_axis_um=off_axis_um,
        state=state,
        expansion_um_per_m_k=_LARGEST_EXPANSION if known is None else known.expansion_um_per_m_k,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetRow:
    """Standard uncertainties from one source, um; None: not known, 0: it does not affect the figure."""

    source: str
    roundness_um: float | None
    cylindricity_um: float | None
    diameter_um: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyBudget:
    """The rows of a budget and the expanded uncertainties; a figure with an unknown source has none.

    `calibrated` is the date of the gauge's calibration (ISO 8601), "" if its file states none.
    """

    gauge: str
    rows: tuple[BudgetRow, ...]
    expanded: FigureUncertainty
    calibrated: str = ""

    def event(self) -> dict[str, object]:
        """Return what records and results in JSON have: U of each figure (k = 2), and the rows (u)."""
        own = self.expanded
        return {
            "gauge": self.gauge,
            "decision_rule": str(own.rule),
            "RONt_U_um": own.roundness_um,
            "CYLt_U_um": own.cylindricity_um,
            "diameter_U_um": own.diameter_um,
            "gauge_calibrated": self.calibrated or None,
            "gauge_expired": own.expired or None,
            "budget": [asdict(each) for each in self.rows],
        }


def part_budget(
    gauge: GaugeProfile,
    sections: Sequence[PartSection],
    result: RoundnessResult | None,
    *,
    filter_upr: float | None,
    header: TraceHeader,
    job: Job | None,
    filter_kind: FilterKind = FilterKind.GAUSS,
    error: GaugeError | None = None,
) -> UncertaintyBudget:
    """Return the budget of a part from its unfiltered sections, one or several, with the header of their file.

    `result` is that of the section that was evaluated in full. Where neither file nor job states the radius, the
    part may be off the axis by what its gauge states. `error` was taken off the sections. A filter of another kind
    passes errors as the Gaussian one of its cut-off.
    """
    radius_mm = header.radius_mm if job is None else header.radius_of(job)
    off_um = 0.0 if radius_mm is not None or gauge.eccentricity_um is None else gauge.eccentricity_um
    if result is not None and not result.recentred:
        off_um = max(off_um, result.eccentricity_um)
    form = measured_form(
        sections,
        filter_upr=filter_upr,
        filter_kind=filter_kind,
        radius_mm=radius_mm,
        off_axis_um=off_um,
        state=header.state,
        material="" if job is None else job.material,
    )
    return uncertainty_budget(gauge, form, None if error is None else _order_sd_um(error))


def _order_sd_um(error: GaugeError) -> dict[int, float]:
    """Return what is not known of each order of an error that was taken off; one that is not proven was not."""
    known = {
        each.upr: each.sd_um if each.proven else math.hypot(each.sd_um, each.cosine_um, each.sine_um)
        for each in error.orders
    }
    return known | dict.fromkeys(error.blind, math.inf)


def points_budget(gauge: GaugeProfile) -> UncertaintyBudget:
    """Return what is known without sections (points, a V-block): what a certificate states of the form."""
    known = FigureUncertainty(
        rule=gauge.rule,
        cylindricity_um=gauge.cylindricity_u_um,
        diameter_um=gauge.diameter_u_um,
        expired=gauge.valid_until if gauge.expired else "",
    )
    return UncertaintyBudget(gauge=gauge.name, rows=(), expanded=known, calibrated=gauge.calibrated)


def uncertainty_budget(
    gauge: GaugeProfile, form: FormSpectrum, order_sd_um: Mapping[int, float] | None = None
) -> UncertaintyBudget:
    """Return the budget of one measurement. Without a length there is no uncertainty of CYLt.

    `order_sd_um` is the standard deviation of cosine and of sine of the gauge's own error at each order, um, where
    that was measured and subtracted; infinite at an order that could not be separated.
    """
    chance = np.random.default_rng(SEED)
    added = _added_errors(gauge, form, order_sd_um, chance)
    power = np.mean(np.abs(_total(added, form)) ** 2, axis=0)
    base = _without_errors(form.phasors_um, power)
    drawn = added | _scaled_errors(gauge, base, form, chance)
    repeat_um = gauge.repeat_um or 0.0
    size_um = (gauge.size_error_um or 0.0) / _SQRT_3
    diameter_m = 2e-3 * (form.radius_mm or 0.0)
    warm_um = form.expansion_um_per_m_k * diameter_m * (gauge.temperature_off_k or 0.0) / _SQRT_3
    rows: dict[str, list[float | None]] = {source: [0.0] * len(_FIGURES) for source in (*_SOURCES, "certificate")}
    for source, each in drawn.items():
        rows[source][:2] = [_expanded(um) / COVERAGE_FACTOR for um in _changes(base, each[:ROW_DRAWS], form)]
    rows["repeat"][:2], rows["size"][2], rows["temperature"][2] = [repeat_um] * 2, size_um, warm_um
    again_um = chance.normal(0.0, repeat_um, DRAWS)
    whole_um = [_expanded(um + again_um) for um in _changes(base, _total(drawn, form), form)]
    whole_um.append(COVERAGE_FACTOR * math.hypot(size_um, warm_um))
    for source in _unknown_sources(gauge, form, order_sd_um):
        rows[source] = [None if figure in _SOURCES[source][0] else 0.0 for figure in _FIGURES]
    for place, figure in enumerate(_FIGURES):
        if (u_um := getattr(gauge, f"{figure}_u_um")) is not None:
            for source in _SOURCES.keys() - {"state"}:
                rows[source][place] = 0.0
            rows["certificate"][place], whole_um[place] = u_um / COVERAGE_FACTOR, u_um
    if not form.has_length:
        for row in rows.values():
            row[1] = 0.0
    known = [None not in column for column in zip(*rows.values(), strict=True)]
    known = [known[0], known[1] and form.has_length, known[2] and form.radius_mm is not None]
    own = [um if is_known else None for um, is_known in zip(whole_um, known, strict=True)]
    return UncertaintyBudget(
        gauge=gauge.name,
        calibrated=gauge.calibrated,
        rows=tuple(
            BudgetRow(source=source, roundness_um=row[0], cylindricity_um=row[1], diameter_um=row[2])
            for source, row in rows.items()
            if any(each != 0.0 for each in row)
        ),
        expanded=FigureUncertainty(
            rule=gauge.rule,
            roundness_um=own[0],
            cylindricity_um=own[1],
            diameter_um=own[2],
            expired=gauge.valid_until if gauge.expired else "",
        ),
    )


def _unknown_sources(
    gauge: GaugeProfile, form: FormSpectrum, order_sd_um: Mapping[int, float] | None
) -> Iterator[str]:
    """Return the sources that nobody has stated."""
    separated = order_sd_um is not None and all(map(math.isfinite, order_sd_um.values()))
    for source, (_, key) in _SOURCES.items():
        stated = not key or getattr(gauge, key) is not None or (source == "spindle" and separated)
        if not stated and (form.has_length or source != "column"):
            yield source
    if form.state == CLAMPED:
        yield "state"


def _added_errors(
    gauge: GaugeProfile, form: FormSpectrum, order_sd_um: Mapping[int, float] | None, chance: np.random.Generator
) -> dict[str, Spectra]:
    """Return errors that do not depend on the form; those of the spindle are the same in all sections."""
    sections, orders = form.phasors_um.shape
    found: dict[str, Spectra] = {}
    separated = {n: sd_um for n, sd_um in (order_sd_um or {}).items() if n < orders}
    if order_sd_um is not None or gauge.spindle_error_um:
        found["spindle"] = _total({}, form)
    for n, sd_um in separated.items():
        if math.isfinite(sd_um):
            found["spindle"][:, :, n] = chance.normal(0.0, sd_um, (DRAWS, 2)).view(np.complex128)
    stated = LOW_ORDERS if gauge.spindle_error_upr is None else (gauge.spindle_error_upr,)
    places = stated if order_sd_um is None else [n for n, sd_um in separated.items() if not math.isfinite(sd_um)]
    if gauge.spindle_error_um and (there := [n for n in places if n < orders]):
        errors = gauge.spindle_error_um * _turned(chance)
        found["spindle"][np.arange(DRAWS), :, chance.choice(there, DRAWS)] += errors[:, None]
    if gauge.probe_noise_um:
        last = orders if form.filter_upr is None else min(orders, math.ceil(_PASSED * form.filter_upr))
        passed_um = gauge.probe_noise_um * math.sqrt(2.0 / form.points) * _passed(form, form.filter_upr)[2:last]
        found["probe_noise"] = _total({}, form)
        noise = chance.standard_normal((DRAWS, sections, passed_um.size, 2)).view(np.complex128)[..., 0]
        found["probe_noise"][:, :, 2:last] = passed_um * noise
    if form.off_axis_um and orders > 2:
        oval_um = form.off_axis_um**2 / (4000.0 * (form.radius_mm or SMALLEST_MM))
        found["eccentricity"] = _total({}, form)
        found["eccentricity"][:, :, 2] = (oval_um * _turned(chance))[:, None]
    if gauge.column_error_um:
        found["column"] = _total({}, form)
        found["column"][:, :, 0] = gauge.column_error_um * chance.uniform(-1.0, 1.0, (DRAWS, sections))
    return found


def _scaled_errors(
    gauge: GaugeProfile, base: Spectra, form: FormSpectrum, chance: np.random.Generator
) -> dict[str, Spectra]:
    """Return errors in proportion to the form: of the amplification, and of the cut-off of the filter."""
    gain, cutoff = (
        0.01 * (limit or 0.0) * chance.uniform(-1.0, 1.0, (DRAWS, 1))
        for limit in (gauge.probe_gain_percent, gauge.filter_cutoff_percent)
    )
    shaped = base * (np.arange(base.shape[1]) > 0)  # the mean radius is not amplified
    found = {"probe_gain": gain[:, :, None] * shaped} if gauge.probe_gain_percent else {}
    if form.filter_upr is not None and gauge.filter_cutoff_percent:
        passed = np.maximum(_passed(form, form.filter_upr), _NOTHING)
        other = _passed(form, form.filter_upr * (1.0 + cutoff))
        found["filter"] = shaped * np.where(passed > _NOTHING, other / passed - 1.0, 0.0)[:, None]
    return found


def _total(errors: Mapping[str, Spectra], form: FormSpectrum) -> Spectra:
    """Return the sum of errors, (D, S, K)."""
    found = np.zeros((DRAWS, *form.phasors_um.shape), dtype=np.complex128)
    for each in errors.values():
        found += each
    return found


def _turned(chance: np.random.Generator) -> Spectra:
    """Return unit phasors of random phase, (D,)."""
    return np.asarray(np.exp(1j * chance.uniform(0.0, 2.0 * math.pi, DRAWS)))


def _passed(form: FormSpectrum, cutoff_upr: Any) -> Floats:
    """Return what a filter passes at the orders of a form, (K,) of one cut-off, (D, K) of (D, 1); 1 without."""
    orders = np.arange(form.phasors_um.shape[1])
    return np.ones(orders.size) if cutoff_upr is None else gaussian_transmission(orders / cutoff_upr, 1.0)


def _without_errors(phasors_um: Spectra, power: Floats) -> Spectra:
    """Return phasors with as much less power as errors have, (S, K) each; orders 0 and 1 stay.

    An error at a single order may be anything: the power is that of all orders within a factor of `_BESIDE`.
    """
    orders = np.arange(2, power.shape[1])
    first, last = np.ceil(orders / _BESIDE).astype(int), np.floor(orders * _BESIDE).astype(int) + 1
    first, last = np.maximum(first, 2), np.minimum(last, power.shape[1])
    measured, wrong = (
        up_to[last - 1] - up_to[first - 1]
        for up_to in (np.cumsum([0.0, 0.0, *of[:, 2:].mean(axis=0)]) for of in (np.abs(phasors_um) ** 2, power))
    )
    wrong *= 1.0 + _DOUBT / np.sqrt(phasors_um.shape[0] * (last - first))
    kept = np.ones(power.shape[1])
    kept[2:] = np.sqrt(np.maximum(1.0 - wrong / np.maximum(measured, _NOTHING), 0.0))
    return np.asarray(phasors_um * kept)


def _changes(base: Spectra, errors: Spectra, form: FormSpectrum) -> tuple[Floats, Floats]:
    """Return by how much errors change RONt of the worst section and CYLt, um, (D,) each; 0 without a length."""
    whole = np.concatenate([base[None], base + errors])
    angles = _ANGLES_AN_ORDER * whole.shape[2]
    level, centre = whole[:, :, 0].real, whole[:, :, 1].copy()
    level = level - level.mean(axis=1, keepdims=True)
    whole[:, :, :2] = 0.0
    turns = np.fft.irfft(whole * (0.5 * angles), angles)
    ront = np.ptp(turns, axis=2).max(axis=1)
    if not form.has_length:
        return ront[1:] - ront[0], np.zeros(errors.shape[0])
    line = np.stack([np.ones_like(form.z_mm), form.z_mm - form.z_mm.mean()])
    centre -= centre @ np.linalg.pinv(line) @ line  # what an axis in any direction leaves of the centres
    turn = np.exp(2j * math.pi * np.arange(angles) / angles)
    turns += level[:, :, None] + (centre[:, :, None] * turn).real
    span_um = float(np.ptp(turns[0])) or 1.0
    points = turns.reshape(len(turns), -1) / span_um
    height = np.repeat(line[1] / np.abs(line[1]).max(), angles)
    round_once = np.tile([turn.real, turn.imag], form.z_mm.size)
    zone = zone_columns(np.vstack([np.ones_like(height), round_once, height * round_once]))
    first = contacts(zone, points[0]).basis
    cylt = span_um * floats([contacts(zone, each, first, _CLOSE).prices[:2].sum() for each in points])
    return ront[1:] - ront[0], cylt[1:] - cylt[0]


def _expanded(changes_um: Floats) -> float:
    """Return the U that holds the changes, either way, with the probability of k = 2."""
    return float(np.quantile(np.abs(changes_um), COVERAGE))
