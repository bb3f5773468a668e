"""Which cause explains the parts of a job best: hypotheses compared by their likelihood on recorded evidence.

Each part gives what is left on it at twice a turn and at N, 2N, 3N and 5N of its N lobes, the tool's error at N
as its scale has seen it, its size, and how its radius changes from the free end of the cut to the jaws. A part has
left L - W - t - d: the lobe L, the path W, the tool's error t, and d that the scale does not see. All of it is
Gaussian about what a sound lathe makes (`_usual`); a hypothesis adds what its fault would make, of an amount that
is not known: its likelihood is that of the evidence with the amount integrated out. So a cause that could have
made anything is worth less than one that had to make just this (Jeffreys; MacKay 2003, chapter 28).

Where not even the best explains the evidence, the differences count by as much less as it misses. All standard
deviations are choices. A cause is sure from a likelihood ratio of `SURE_RATIO` to the next; two that predict the
same, as an error of the gauge and one of the spindle do, are never; nor is one that leaves much unexplained.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial

import numpy as np

from profiles.arrays import Floats
from profiles.compensations.certificate import BLANK_OVAL_SD_UM
from profiles.compensations.path import OVAL

SURE_RATIO = 20.0
MOST_MISFIT = 1.0
"""Misfit from which something else is wrong, too: then nothing is sure."""

MULTIPLES = (1, 2, 3, 5)
ANY_PHASE = (1.0 + 0j, 1j)
WARM_PARTS = 5.0
CUT_N_PER_UM = 0.12
"""Passive force of a dull edge on its depth: 1.5 of the main cutting force of aluminium at a feed of 0.05 mm."""
PLAYS_UM = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 25.0)
ANGLES_DEG = (2.0, 3.0, 4.5, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 26.0, 34.0, 45.0, 60.0)
RATES_DEG = (0.4, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
WITHIN = 0.15
"""Standard deviation of what a fault makes about a place of these grids, as a fraction."""

WRONG_WAY = 2.0
"""What a tool leaves that moves the wrong way, over its path; its scale shows none of it."""

LEAST_OF_RONT = 0.15
"""Fraction of RONt, peak to peak, from which an order stands out of a part."""


class LatheFault(StrEnum):
    """What may be wrong; `USUAL`: nothing beyond the usual scatter."""

    USUAL = "usual"
    CLAMPING = "clamping"
    FORCE = "force"
    ANGLE = "angle"
    DRIFT = "drift"
    TOOL = "tool"
    SIGN = "sign"
    FRICTION = "friction"
    BACKLASH = "backlash"
    GAUGE = "gauge"
    SPINDLE = "spindle"
    JAW = "jaw"
    BLANK = "blank"
    THERMAL = "thermal"
    ENTRY = "entry"
    HOLD = "hold"


@dataclass(frozen=True, slots=True, kw_only=True)
class PartEvidence:
    """What the record has of one part, um; spindle angles, outwards positive, None where it was not seen.

    `left_um` are the harmonics of the part by order, `path_um` that of its path at the order of the lobe as it was
    cut, `tool_um` the tool against its path there, infeed positive. `size_um` is its mean radius above the nominal
    one, `taper_um` the mean radius at the free end less that at the end of the cut. `held` is whether its feed was
    held. `ront_um` is its roundness. `place` counts the parts from the first of the row, those without evidence
    too.
    """

    left_um: Mapping[int, complex]
    path_um: complex
    tool_um: complex | None = None
    size_um: float | None = None
    taper_um: float | None = None
    held: bool = False
    ront_um: float | None = None
    place: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownLathe:
    """What job and machine say: `lobes`, the lobe of the job, jaw 1, deg of spindle, and what a force does.

    `yields_um_per_n` is the compliance of the tool in its loop by order (`profiles.axis.stiffness`).
    """

    lobes: int
    lobe_um: complex
    jaw_1_deg: float
    yields_um_per_n: Mapping[int, complex]


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """A hypothesis: ln of its likelihood, and what of the last part it explains, um p-p, at most what is left.

    `amount` is what the last part shows, if that is it: of an angle by how many degrees of spindle the lobe is
    past where the job has it, of a drift these a part, of a force by how many percent the lobe is higher, of a
    tool the percentage of its path that arrives, of a jaw its number; else 0.
    """

    fault: LatheFault
    log_likelihood: float
    um_pp: float
    amount: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultDiagnosis:
    """The hypotheses, the likeliest first, on the evidence of so many parts.

    `misfit` is the squared misfit of the best for each number of the evidence: 1 where it explains all.
    `apart_um` are the orders of the last part that stand out and are not of the chuck, um p-p; `noise_um` is its
    RONt where no order stands out, else None.
    """

    ranked: tuple[Explanation, ...]
    parts: int
    misfit: float
    apart_um: Mapping[int, float] = field(default_factory=dict)
    noise_um: float | None = None

    @property
    def best(self) -> Explanation:
        """The likeliest."""
        return self.ranked[0]

    @property
    def next(self) -> Explanation:
        """The one that has to be ruled out first."""
        return self.ranked[1]

    @property
    def ratio(self) -> float:
        """The likelihood of the best over that of the next."""
        return math.exp(min(self.best.log_likelihood - self.next.log_likelihood, 700.0))

    @property
    def sure(self) -> bool:
        """Whether the best may be stated; otherwise it is the likeliest, and a measurement has to decide."""
        return self.ratio >= SURE_RATIO and self.misfit <= MOST_MISFIT


@dataclass(frozen=True, slots=True)
class _Made:
    """One way in which a fault shows: mean and columns (one standard deviation each) of the evidence."""

    mean: Floats
    columns: Floats


Orders = Mapping[int, complex]
OfPart = Callable[[PartEvidence], Orders]
"""What something makes on a part, um by order."""


class _Evidence:
    """The evidence as one vector of real numbers, and vectors of what something makes of it."""

    def __init__(self, parts: Sequence[PartEvidence], lathe: KnownLathe) -> None:
        self.parts, self.lathe = parts, lathe
        self.orders = tuple(sorted({OVAL, *(lathe.lobes * each for each in MULTIPLES)} & {*parts[0].left_um}))
        lobe = {lathe.lobes: lathe.lobe_um}
        self.seen = self._rows(
            lambda p: {n: p.left_um[n] - lobe.get(n, 0j) + p.path_um * (n == lathe.lobes) for n in self.orders},
            lambda p: p.tool_um or 0j,
            lambda p: p.size_um or 0.0,
            lambda p: p.taper_um or 0.0,
        )
        shown = [(p.tool_um, p.tool_um, p.size_um, p.taper_um) for p in parts]
        of_trace = [True] * (2 * len(self.orders))
        self.have = np.array([[*of_trace, *(each is not None for each in part)] for part in shown]).ravel()

    def _rows(
        self,
        left: OfPart,
        tool: Callable[[PartEvidence], complex],
        size: Callable[[PartEvidence], float],
        taper: Callable[[PartEvidence], float],
    ) -> Floats:
        rows = list[float]()
        for part in self.parts:
            made = left(part)
            for each in (*(made.get(n, 0j) for n in self.orders), tool(part)):
                rows += [each.real, each.imag]
            rows += [size(part), taper(part)]
        return np.array(rows)

    def on_part(self, made: OfPart) -> Floats:
        """Return what the scale of the tool does not see."""
        return self._rows(made, lambda _: 0j, lambda _: 0.0, lambda _: 0.0)

    def by_tool(self, made: OfPart) -> Floats:
        """Return what an error of the tool makes, which its scale sees at the order of the lobe."""
        n = self.lathe.lobes
        return self._rows(
            lambda p: {k: -c for k, c in made(p).items()},
            lambda p: made(p).get(n, 0j),
            lambda _: 0.0,
            lambda _: 0.0,
        )

    def polled(self, tool_um: complex) -> Floats:
        """Return what only the polls show."""
        return self._rows(lambda _: {}, lambda _: tool_um, lambda _: 0.0, lambda _: 0.0)

    def size(self, made: Callable[[PartEvidence], float]) -> Floats:
        """Return a change of the size."""
        return self._rows(lambda _: {}, lambda _: 0j, made, lambda _: 0.0)

    def taper(self, made: Callable[[PartEvidence], float]) -> Floats:
        """Return a change of the radius along the cut."""
        return self._rows(lambda _: {}, lambda _: 0j, lambda _: 0.0, made)

    def order(self, n: int, um: complex) -> Floats:
        """Return the same of one order on each part."""
        return self.on_part(lambda _: {n: um})

    def any_phase(self, n: int, um: float) -> list[Floats]:
        """Return the same at any angle."""
        return [self.order(n, um * turned) for turned in ANY_PHASE]

    def alone(self, vectors: Iterable[Floats]) -> list[Floats]:
        """Return what each makes on each part by itself."""
        found = []
        for vector in vectors:
            rows = vector.reshape(len(self.parts), -1)
            for place, row in enumerate(rows):
                found.append(np.zeros_like(rows))
                found[-1][place] = row
        return [each.ravel() for each in found]


def diagnose(parts: Sequence[PartEvidence], lathe: KnownLathe) -> FaultDiagnosis:
    """Return the hypotheses on the evidence of parts of one job, oldest first, at least one of them."""
    evidence = _Evidence(parts, lathe)
    usual = _stack(_usual(evidence))
    found, misses = list[tuple[LatheFault, float, Floats]](), list[float]()
    for fault in LatheFault:
        made = list(_made(fault, evidence))
        if not made:
            continue
        scored = [_score(evidence, usual, each) for each in made]
        best = max(scored, key=lambda each: each[0])
        log = best[0] + math.log(sum(math.exp(each[0] - best[0]) for each in scored) / len(scored))
        found.append((fault, log, best[2]))
        misses.append(best[1])
    place = max(range(len(found)), key=lambda at: found[at][1])
    misfit = misses[place] / int(np.count_nonzero(evidence.have))
    ranked = [
        Explanation(
            fault=fault,
            log_likelihood=log / max(1.0, misfit),
            um_pp=_on_part_um(evidence, made),
            amount=_amount(fault, parts, lathe),
        )
        for fault, log, made in found
    ]
    ront_um = parts[-1].ront_um
    least_um = math.inf if ront_um is None else LEAST_OF_RONT * ront_um
    out_um = {n: 2.0 * abs(c) for n, c in parts[-1].left_um.items() if n > 1 and 2.0 * abs(c) >= least_um}
    return FaultDiagnosis(
        ranked=tuple(sorted(ranked, key=lambda each: -each.log_likelihood)),
        parts=len(parts),
        misfit=misfit,
        apart_um={n: um for n, um in out_um.items() if n != OVAL and n % lathe.lobes},
        noise_um=None if out_um else ront_um,
    )


def _amount(fault: LatheFault, parts: Sequence[PartEvidence], lathe: KnownLathe) -> float:
    """Return how much of a fault the last part shows, as in `Explanation`."""
    lobes, lobe, part = lathe.lobes, lathe.lobe_um, parts[-1]
    had, first = (each.left_um[lobes] + each.path_um + (each.tool_um or 0j) for each in (part, parts[0]))
    match fault:
        case LatheFault.ANGLE:
            return _turn_deg(lobe, had, lobes)
        case LatheFault.DRIFT:
            return _turn_deg(first, had, lobes) / max(1, part.place - parts[0].place)
        case LatheFault.FORCE if lobe:
            return 100.0 * (abs(had / lobe) - 1.0)
        case LatheFault.TOOL if part.path_um:
            off = lobe - part.left_um[lobes] - part.path_um if part.tool_um is None else part.tool_um
            return 100.0 * (1.0 + (off / part.path_um).real)
        case LatheFault.JAW if part.left_um.get(OVAL):
            high_deg = _turn_deg(1.0 + 0j, part.left_um[OVAL], OVAL) - lathe.jaw_1_deg
            off_deg = [abs(math.remainder(high_deg - 360.0 * jaw / lobes, 180.0)) for jaw in range(lobes)]
            return 1.0 + off_deg.index(min(off_deg))
        case _:
            return 0.0


def _turn_deg(before: complex, after: complex, order: int) -> float:
    """Return by how many degrees of spindle an order has turned, the shorter way; 0 where there is none."""
    return -math.degrees(cmath.phase(after / before)) / order if before and after else 0.0


def _stack(columns: Sequence[Floats]) -> Floats:
    return np.array(columns).T


def _score(evidence: _Evidence, usual: Floats, made: _Made) -> tuple[float, float, Floats]:
    """Return ln of the likelihood, the squared misfit, and what the fault most likely has made."""
    have = evidence.have
    columns = np.hstack([usual, made.columns])[have]
    covariance = columns @ columns.T
    off = (evidence.seen - made.mean)[have]
    solved = np.linalg.solve(covariance, off)
    misfit = float(off @ solved)
    _, determinant = np.linalg.slogdet(covariance)
    amounts = made.columns[have].T @ solved
    return -0.5 * (misfit + float(determinant)), misfit, made.mean + made.columns @ amounts


def _on_part_um(evidence: _Evidence, made: Floats) -> float:
    """Return the most that a fault explains of one figure of the last part, um p-p; no more than is left there."""
    part = evidence.parts[-1]
    of_last = made[-made.size // len(evidence.parts) :]
    orders = len(evidence.orders)
    explained = [
        2.0 * min(abs(complex(*of_last[2 * at : 2 * at + 2])), abs(part.left_um[n]))
        for at, n in enumerate(evidence.orders)
    ]
    for value, seen in ((of_last[2 * orders + 2], part.size_um), (of_last[2 * orders + 3], part.taper_um)):
        explained.append(min(abs(float(value)), abs(seen or 0.0)))
    return max(explained)


def _usual(e: _Evidence) -> list[Floats]:
    """Return what a lathe that is looked after makes: one standard deviation in each column."""
    lathe, lobes, lobe = e.lathe, e.lathe.lobes, e.lathe.lobe_um
    turn = -1j * lobes * math.radians(1.0) * lobe
    alone = [*e.any_phase(OVAL, BLANK_OVAL_SD_UM), e.order(lobes, 0.01 * lobe), e.order(lobes, 0.25 * turn)]
    alone += [each for n in e.orders for each in e.any_phase(n, 0.15)]
    alone += [e.by_tool(partial(_tool_off, lobes, 0.3 * t)) for t in ANY_PHASE]
    alone += [*(e.polled(0.3 * t) for t in ANY_PHASE), e.size(lambda _: 1.5), e.taper(lambda _: 0.6)]
    common = [*e.any_phase(OVAL, 1.2), e.order(lobes, 0.04 * lobe), e.order(lobes, turn)]
    common += [each for n in e.orders if n not in (OVAL, lobes) for each in e.any_phase(n, 0.3)]
    common += e.any_phase(2 * lobes, 0.03 * abs(lobe)) if 2 * lobes in e.orders else []
    common += [e.by_tool(partial(_responds, lobes, 0.05 * t)) for t in ANY_PHASE]
    common += [e.by_tool(lambda p: _rubbed(1.0, p.path_um, lathe)), e.size(lambda _: 25.0)]
    common += [0.3 * _pushed(e), e.taper(lambda _: 5.0), e.size(lambda p: 3.0 * _warm(p))]
    return [*common, *e.alone(alone)]


def _warm(part: PartEvidence) -> float:
    return math.expm1(-part.place / WARM_PARTS)  # the tip comes in: the radius falls


def _square(order_um: complex, multiple: int) -> complex:
    """Return a multiple of sign(speed) of a motion at an order: 4 / pi (cos x - cos 3x / 3 + cos 5x / 5)."""
    return (
        math.copysign(4.0 / (math.pi * multiple), 2 - multiple % 4) * (1j * order_um / abs(order_um)) ** multiple
    )


def _rubbed(friction_n: float, path_um: complex, lathe: KnownLathe) -> dict[int, complex]:
    """Return by how much dry friction holds the tool back at the odd multiples of the lobe."""
    orders = {m * lathe.lobes: m for m in MULTIPLES if m % 2}
    return {
        n: -friction_n * lathe.yields_um_per_n[n] * _square(path_um, m) if path_um else 0j
        for n, m in orders.items()
        if n in lathe.yields_um_per_n
    }


def _lagging(play_um: float, path_um: complex, lobes: int) -> dict[int, complex]:
    """Return what a tip that is dragged along with this play, um, is off its scale, by order."""
    angle = np.linspace(0.0, 4.0 * np.pi, 721)[:-1]
    scale, tip = abs(path_um) * np.cos(angle), []
    at = float(scale[0])
    for each in scale.tolist():
        at = min(max(at, each - 0.5 * play_um), each + 0.5 * play_um)
        tip.append(at)
    behind = (np.array(tip) - scale)[360:]
    turned = path_um / abs(path_um) if path_um else 1.0
    spectrum = np.fft.rfft(behind) / 180.0
    return {m * lobes: complex(spectrum[m]) * turned**m for m in MULTIPLES if m % 2}


def _made(fault: LatheFault, e: _Evidence) -> Iterator[_Made]:
    """Yield the ways in which a fault shows, all as likely; none where it cannot be."""
    lathe, lobes, lobe = e.lathe, e.lathe.lobes, e.lathe.lobe_um
    none = np.zeros_like(e.seen)
    match fault:
        case LatheFault.DRIFT if len(e.parts) == 1:
            return
        case LatheFault.ANGLE | LatheFault.DRIFT if lobe:
            degrees = ANGLES_DEG if fault is LatheFault.ANGLE else RATES_DEG
            for deg in (sign * each for each in degrees for sign in (1.0, -1.0)):
                yield _about(e.on_part(_turned(lobe, lobes, deg, drifts=fault is LatheFault.DRIFT)))
        case LatheFault.BACKLASH:
            for play_um in PLAYS_UM:
                yield _about(e.on_part(partial(_left_by_play, lobes, play_um)))
        case LatheFault.SIGN if any(part.path_um for part in e.parts):
            yield _about(e.on_part(lambda part: {lobes: WRONG_WAY * part.path_um}))
        case LatheFault.JAW:
            for jaw in range(lathe.lobes):
                at_rad = math.radians(lathe.jaw_1_deg + 360.0 * jaw / lobes)
                yield _Made(none, _stack([e.order(OVAL, 5.0 * cmath.exp(-1j * OVAL * at_rad))]))
        case _:
            columns = _columns(fault, e)
            if columns is not None:
                yield _Made(none, _stack(columns) if columns else np.zeros((none.size, 0)))


def _columns(fault: LatheFault, e: _Evidence) -> list[Floats] | None:  # noqa: C901  a table
    """Return what one standard deviation of a fault makes; None where the record rules it out."""
    lathe, lobes, lobe = e.lathe, e.lathe.lobes, e.lathe.lobe_um
    match fault:
        case LatheFault.USUAL:
            return []
        case LatheFault.CLAMPING:
            return e.alone([e.order(lobes, 0.12 * lobe)])
        case LatheFault.FORCE:
            return [e.order(lobes, 0.2 * lobe)]
        case LatheFault.TOOL:
            return [e.by_tool(partial(_responds, lobes, 0.3 * t)) for t in ANY_PHASE]
        case LatheFault.FRICTION:
            return [e.by_tool(lambda p: _rubbed(7.0, p.path_um, lathe))]
        case LatheFault.GAUGE | LatheFault.SPINDLE:
            return e.any_phase(OVAL, 4.0)
        case LatheFault.BLANK:
            return e.alone(e.any_phase(OVAL, 4.0))
        case LatheFault.THERMAL:
            return [e.size(lambda p: 40.0 * _warm(p))] if len(e.parts) > 1 else None
        case LatheFault.ENTRY:
            return [_pushed(e), e.taper(lambda _: 4.0), e.size(lambda _: 10.0)]
        case LatheFault.HOLD:
            return [e.taper(lambda p: 4.0 * p.held)] if any(p.held for p in e.parts) else None
        case _:
            return None


def _pushed(e: _Evidence) -> Floats:
    """Return what a cut makes that pushes the tool by a dull edge: out, most at its entry, and by its depth.

    The depth of the cut is that of the path: `CUT_N_PER_UM` times its lobe push the tool at the order of that.
    """
    lobes = e.lathe.lobes
    yields = e.lathe.yields_um_per_n.get(lobes, 0j)
    by_depth = e.by_tool(lambda p: {lobes: -yields * CUT_N_PER_UM * p.path_um})
    return np.asarray(by_depth + e.size(lambda _: 30.0) + e.taper(lambda _: 3.0))


def _turned(lobe: complex, lobes: int, deg: float, *, drifts: bool) -> OfPart:
    """Return what a lobe makes that stands so many degrees further on, or so many more on each part."""

    def made(part: PartEvidence) -> Orders:
        rad = math.radians(deg * (part.place if drifts else 1.0))
        return {lobes: lobe * (cmath.exp(-1j * lobes * rad) - 1.0)}

    return made


def _tool_off(lobes: int, um: complex, _: PartEvidence) -> Orders:
    return {lobes: um}


def _responds(lobes: int, off: complex, part: PartEvidence) -> Orders:
    return {lobes: off * part.path_um}


def _left_by_play(lobes: int, play_um: float, part: PartEvidence) -> Orders:
    moved_um = part.path_um + (part.tool_um or 0j)
    return {n: -c for n, c in _lagging(play_um, moved_um, lobes).items()}


def _about(mean: Floats) -> _Made:
    return _Made(mean, _stack([WITHIN * mean]))
