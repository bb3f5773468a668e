"""Whether an order has stepped between two parts, or drifts from part to part, by what the parts show of it.

What a path has to remove is one complex number of an order, nearly the same for each part. It is taken apart into
height and turn, since a force turns nothing. Of each a part shows x and noise; x changes by the rate r from part
to part, and by 0.1 um that no lathe repeats. Kalman's filter (1960) gives the probability of the parts for each of
these histories: r = 0; r is normal with `RATE_SD_UM`; before one of the last parts x has changed by a normal
amount, `STEP_SD_UM`; or the jaws went to other places there, which turns what they make by whole jaws. A wide
amount or rate pays for its width, so that none is believed before the parts say so: by `EVIDENCE`, the logarithm
of the factor of the probability (Kass and Raftery 1995 call one of 150 very strong).

The noise is known: the trace, the scatter of the clamping, the mark at which a part is set to its gauge, and what
of a change of the path does not arrive. The size, the oval, and an order between the multiples of the
jaws may be of the blank, whose scatter is not known: its probability is the mean over `BLANK_UM`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from profiles.compensations.learning import REPEATS_SD_UM
from profiles.compensations.optimal_gain import PROCESS_LOSS_SD, repeats
from profiles.problem import Problem

EVIDENCE = math.log(3000.0)  # a choice; docs/learning.md has what it costs and finds
DOUBTFUL = 1.5  # times as much where a blank may be why, or two parts alone differ: a step, or a drift; a choice
STEP_SD_UM, RATE_SD_UM = 10.0, 1.5  # of the amplitude, in each direction; of the rate, a part; assumed
RATE_CHANGES = (
    0.2  # of a rate from part to part, over its standard deviation, as what warms up slows down; assumed
)
MARK_SD_DEG = 1.0  # with which a part is set to the mark of its gauge by eye; assumed
BLANK_UM = (0.0, 1.0, 3.0, 10.0)  # standard deviations from part to part, each as likely
PLACED_SD = 5.0  # over its noise, from which each part shows the angle of an order
STEADY = 2  # of these are as little as an order may scatter that steps or drifts
RECENT = 3  # the parts before one of which a step may have been
ENOUGH_FOR_RATE = 3  # parts; two show no more than that they differ
MOST_PARTS = 12  # the last ones, from which this is judged
MEAN, OVAL = 0, 2  # the orders of the size and of the form of a blank

Row = Sequence[tuple[float, float]]
"""What the parts show of a component, um, each with its variance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownOrder:
    """An order as a part shows it: what a path has to remove, um, and the path that it was cut with.

    `sd_um` is the standard deviation of each of its components on this part alone, `clamped` that of the force of
    its clamping, a fraction; of a change of the path `lost` may not arrive, as another standard deviation.
    """

    shown_um: complex
    path_um: complex
    sd_um: float
    clamped: float = 0.0
    lost: float = PROCESS_LOSS_SD


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderState:
    """An order after its last part: the same since part `since`, from 0, when it stepped by `stepped_um`.

    `fresh` is a step that the last part has shown. `level_um` is what it had, `rate_um` the change with each part
    where height or turn of it `drifts`. Of a change of the path the fraction `lost` did not arrive before a step.
    `refitted`: the jaws have stepped to other places, so that the parts before tell what the next one has.
    """

    since: int = 0
    stepped_um: complex = 0j
    fresh: bool = False
    level_um: complex = 0j
    rate_um: complex = 0j
    drifts: tuple[bool, bool] = (False, False)
    lost: float = 0.0
    refitted: bool = False

    @property
    def is_drifting(self) -> bool:
        """Whether each part has another amount of it."""
        return any(self.drifts)

    @property
    def is_known(self) -> bool:
        """Whether the next part is known better than by what the last one has left."""
        return self.refitted or self.is_drifting

    def follow(self, path_um: complex) -> complex:
        """Return this path with what is known of the next part."""
        if self.refitted:
            return self.level_um
        ahead_um, (height, turn) = self.level_um + self.rate_um, self.drifts
        if turn:
            return ahead_um if height else cmath.rect(abs(path_um), cmath.phase(ahead_um))
        along = self.level_um / abs(self.level_um) if self.level_um else 1.0 + 0j
        return path_um + ((ahead_um - path_um) / along).real * along if height else path_um

    def is_settled(self, shown_um: Sequence[complex]) -> bool:
        """Whether an order that may be of the blank is not, by all that parts have shown of it.

        What has stepped was the same before, and what drifts is never the same.
        """
        since = shown_um[self.since :]
        return self.is_drifting or (self.since > 0 and len(since) == 1) or repeats(since)


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderChange:
    """A change of an order, for a certificate and for files: a `step` before part `part`, from 1, or a drift.

    `amount_um` is the amplitude of the step, or of the change with each part; `turn_deg` by how much that turns
    the order, degrees of spindle.
    """

    order: int
    step: bool
    part: int
    amount_um: float
    turn_deg: float


UNCHANGED = OrderState()


def state_of(parts: Sequence[ShownOrder], order: int, jaws: int) -> OrderState:
    """Return the state of an order after parts, oldest first."""
    scatters = BLANK_UM if order in (MEAN, OVAL) or order % jaws else BLANK_UM[:1]
    state = UNCHANGED
    turns = [cmath.exp(-2j * math.pi * order * jaw / jaws) for jaw in range(1, jaws)] if order % jaws else []
    for end in range(2, len(parts) + 1):
        first = max(state.since, end - MOST_PARTS)
        if end - first > 1:
            before = replace(state, fresh=False, lost=0.0, refitted=False)
            state = _next_state(parts[first:end], first, before, turns, scatters)
            if state.fresh:
                state = replace(state, lost=_lost(parts[before.since : state.since]))
    return state


def change_of(state: OrderState, order: int, began: int = 0) -> OrderChange | None:
    """Return the change that the last part has shown of an order, None for none; `began` parts are not in it."""
    amount_um = state.stepped_um if state.fresh else state.rate_um
    if not (state.fresh or state.is_drifting):
        return None
    before_um = state.level_um - amount_um
    turned = order and before_um and state.level_um
    turn_deg = -math.degrees(cmath.phase(state.level_um / before_um)) / order if turned else 0.0
    return OrderChange(
        order=order, step=state.fresh, part=began + state.since + 1, amount_um=abs(amount_um), turn_deg=turn_deg
    )


def change_warnings(changes: Iterable[OrderChange]) -> tuple[Problem, ...]:
    """Return the warnings of changes: one for all orders that have stepped before the same part, one a drift.

    `learned.stepped` has orders, amounts p-p and the parts between; `learned.size_stepped` the radius.
    """
    found, stepped = [], dict[int, list[OrderChange]]()
    for each in sorted(changes, key=lambda change: change.order):
        um = f"{each.amount_um if each.order == MEAN else 2.0 * each.amount_um:.1f} um"
        if each.step and each.order != MEAN:
            stepped.setdefault(each.part, []).append(each)
        elif each.step:
            found.append(Problem(code="learned.size_stepped", value=um, limit=f"{each.part - 1} → {each.part}"))
        elif each.order == MEAN:
            found.append(Problem(code="learned.size_drifts", value=um))
        else:
            turn = f"{each.turn_deg:+.1f} deg"
            found.append(Problem(code="learned.drifts", key=f"{each.order}/rev", value=um, limit=turn))
    for part, those in stepped.items():
        key = ", ".join(f"{each.order}/rev" for each in those)
        value = ", ".join(f"{2.0 * each.amount_um:.1f}" for each in those) + " um"
        found.append(Problem(code="learned.stepped", key=key, value=value, limit=f"{part - 1} → {part}"))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Track:
    """A component after its parts: the logarithm of their probability, value and rate, and value before a step."""

    evidence: float
    value: float
    rate: float
    before: float


def _track(row: Row, more: float, rate_sd_um: float, step: int) -> _Track:
    """Filter a component with so much `more` variance of each part; before part `step` it jumps (0: never)."""
    (value, variance), evidence = row[0], 0.0
    before, rate = value, 0.0
    own, both, of_rate = variance + more, 0.0, rate_sd_um**2
    for at, (shown, noise) in enumerate(row[1:], start=1):
        value += rate
        own += 2.0 * both + of_rate + 0.5 * REPEATS_SD_UM**2
        both += of_rate
        of_rate += (RATE_CHANGES * rate_sd_um) ** 2
        if at == step:
            before = value
            own += STEP_SD_UM**2
        expected, error = own + noise + more, shown - value
        evidence -= 0.5 * (math.log(expected) + error**2 / expected)
        value += own / expected * error
        rate += both / expected * error
        of_rate -= both * both / expected
        both -= own * both / expected
        own -= own * own / expected
    return _Track(evidence, value, rate, before)


@dataclass(frozen=True, slots=True)
class _Axes:
    """Height and turn of an order, both um: along `direction` and across it, or magnitude and angle times `size`.

    Angles where all parts show that of the jaws: what turns is a straight line then. `size` 0 is along and across.
    """

    direction: complex
    size: float

    def split(self, shown_um: complex) -> complex:
        """Return height and turn, as real and imaginary part."""
        turned = shown_um / self.direction
        return complex(abs(turned), self.size * cmath.phase(turned)) if self.size else turned

    def join(self, parts: complex) -> complex:
        """Return the order with this height and turn."""
        return self.direction * (cmath.rect(parts.real, parts.imag / self.size) if self.size else parts)

    def rows(self, seen: Sequence[ShownOrder], path_um: complex) -> tuple[Row, Row]:
        """Return height and turn of the parts, for what this path has to remove."""
        height, turn = [], []
        for each in seen:
            shown, noise = self.split(each.shown_um), _noise_um(each, path_um) ** 2
            across = 0.0 if self.size else each.clamped * shown.imag
            height.append((shown.real, noise + (each.clamped * shown.real) ** 2))
            turn.append((shown.imag, noise + across**2))
        return height, turn


def _noise_um(each: ShownOrder, path_um: complex) -> float:
    return math.hypot(each.sd_um, each.lost * abs(each.path_um - path_um))


def _lost(parts: Sequence[ShownOrder]) -> float:
    """Return which fraction of the changes of a path has most likely not arrived on parts that are all alike."""
    for_it, total = 0.0, PROCESS_LOSS_SD**-2
    for one, other in pairwise(parts):
        moved_um, more_um = other.path_um - one.path_um, other.shown_um - one.shown_um
        noise = one.sd_um**2 + other.sd_um**2 + (other.clamped * abs(other.shown_um)) ** 2
        for_it += (more_um * moved_um.conjugate()).real / noise
        total += abs(moved_um) ** 2 / noise
    return min(max(for_it / total, 0.0), 2.0 * PROCESS_LOSS_SD)


def _axes(seen: Sequence[ShownOrder], scatters: bool) -> _Axes:
    total = sum(each.shown_um for each in seen[-RECENT:])
    placed = not scatters and all(
        abs(each.shown_um) > PLACED_SD * _noise_um(each, seen[-1].path_um) for each in seen
    )
    size = sum(abs(each.shown_um) for each in seen) / len(seen) if placed else 0.0
    return _Axes(total / abs(total) if total else 1.0 + 0j, size)


@dataclass(frozen=True, slots=True)
class _History:
    """A history that the parts may have had: the evidence for it less its price, and what it makes of the last."""

    score: float
    step: int
    level_um: complex
    ahead_um: complex
    before_um: complex
    drifts: tuple[bool, bool]
    refitted: bool = False


def _history(
    seen: Sequence[ShownOrder],
    scatters: Sequence[float],
    drifts: tuple[bool, bool],
    step: int,
    price: float,
    *,
    changes: bool,
    path_um: complex | None = None,
) -> _History:
    """Weigh a history for a path, by default the last; one that `changes` is of an order that else repeats."""
    axes = _axes(seen, any(scatters))
    rows = axes.rows(seen, seen[-1].path_um if path_um is None else path_um)
    tries = [
        [_track(row, um**2, RATE_SD_UM * drift, step) for row, drift in zip(rows, drifts, strict=True)]
        for um in (scatters[:STEADY] if changes else scatters)
    ]
    height, turn = max(tries, key=lambda pair: pair[0].evidence + pair[1].evidence)
    most = height.evidence + turn.evidence
    mean = sum(math.exp(a.evidence + b.evidence - most) for a, b in tries) / len(scatters)
    level = complex(height.value, turn.value)
    return _History(
        score=most + math.log(mean) - price,
        step=step,
        level_um=axes.join(level),
        ahead_um=axes.join(level + complex(height.rate, turn.rate)),
        before_um=axes.join(complex(height.before, turn.before)),
        drifts=drifts,
    )


def _turned(
    seen: Sequence[ShownOrder], scatters: Sequence[float], step: int, turn: complex, price: float
) -> _History:
    """Weigh that the jaws were put elsewhere: all parts are alike, but for the places of the jaws.

    So the next part is known by those before. The path was still the one for the old places.
    """
    turned = [replace(each, shown_um=turn * each.shown_um, path_um=turn * each.path_um) for each in seen[:step]]
    kept = [replace(each, path_um=now.path_um) for each, now in zip(turned, seen[:step], strict=True)]
    same, steady = (
        _history([*parts, *seen[step:]], scatters, (False, False), 0, price, changes=True, path_um=path_um)
        for parts, path_um in ((turned, turned[-1].path_um), (kept, None))
    )
    score = max(same.score, steady.score)
    return replace(same, score=score, step=step, before_um=same.level_um / turn, refitted=True)


def _next_state(
    seen: Sequence[ShownOrder],
    first: int,
    before: OrderState,
    turns: Sequence[complex],
    scatters: Sequence[float],
) -> OrderState:
    """Return the state after one more part, the last of those `seen` from part `first` on, since the last step."""
    count = len(seen)
    places = range(max(1, count - RECENT), count)
    few = count < ENOUGH_FOR_RATE
    of_drift = EVIDENCE * (DOUBTFUL if any(scatters) else 1.0)
    of_step = EVIDENCE * (DOUBTFUL if few or any(scatters) else 1.0) + math.log(RECENT)
    found = []
    for drifts in ((False, False), (True, False), (False, True), (True, True)):
        for step in (0, *places):
            price = of_drift * sum(drifts) + (of_step if step else 0.0)
            found.append(_history(seen, scatters, drifts, step, price, changes=price > 0.0))
    price = EVIDENCE * (DOUBTFUL if few else 1.0) + math.log(RECENT * max(1, len(turns)))
    for step in places:
        for turn in turns:
            found.append(_turned(seen, scatters, step, turn, price))
    best = max(found, key=lambda each: each.score)
    if best.step:
        stepped_um, since = best.level_um - best.before_um, first + best.step
        return replace(
            UNCHANGED,
            since=since,
            stepped_um=stepped_um,
            fresh=True,
            level_um=best.level_um,
            refitted=best.refitted,
        )
    drifts = best.drifts if count >= ENOUGH_FOR_RATE else (False, False)
    rate_um = best.ahead_um - best.level_um if any(drifts) else 0j
    return replace(before, level_um=best.level_um, rate_um=rate_um, drifts=drifts)
