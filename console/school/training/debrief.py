"""The debrief of a try: what counts, what it cost, and the score. Pure; from what was recorded and what is so."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from console.school.training.attempt import Attempt
from console.school.training.happenings import Happening, HappeningKind
from console.school.training.lesson import Item
from console.session.stop_keys import is_by_key
from drivers.simulator.plant.workshop_view import Truth

FULL = 100
WRONG_ANSWER = 30.0  # more than by chance and without a cut: 30 points, and the steps that were not made
CLEAR_OF_JAWS_MM, GENTLE_MM_PER_S = 1.0, 0.2
"""What is no near miss: this far from the jaws, and as slow at contact as the steps of 0.01 mm are."""

JAW_WITHIN_DEG, TIP_WITHIN_UM, SEEN_WITHIN_S = 0.3, 10.0, 60.0
"""What a careful trainee keeps: jaw 1 by indicator, the tip by touch, an alarm seen and acknowledged."""

BY_ITSELF = frozenset({"stopped", "stopped_in_cut", "link_lost", "ousted"})
"""Steps that a machine may make alone."""

STOPS = frozenset({"stopped", "stopped_in_cut"})
"""Steps that ask for a stop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreItem:
    """One item: what it was and what it should be, as numbers in its unit; the points that it cost.

    `cost_um` is what it leaves on the part, p-p on the radius, where that can be told.
    """

    item: Item
    value: float
    limit: float
    lost: float
    cost_um: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Debrief:
    """The score of a try, 0 to 100, with its marks; those that could not be judged are left out."""

    score: int
    marks: tuple[ScoreItem, ...]

    @property
    def worst(self) -> ScoreItem | None:
        """The mark that cost most, None if nothing was lost."""
        return max((mark for mark in self.marks if mark.lost > 0.0), key=lambda mark: mark.lost, default=None)


def debrief_of(attempt: Attempt, truth: Truth, now_s: float) -> Debrief:
    """Return the debrief of a try that is over, on a lathe of which this is so."""
    found = [mark for item in attempt.lesson.counts for mark in JUDGES[Item(item)](attempt, truth, now_s)]
    marks = tuple(sorted(found, key=lambda mark: tuple(Item).index(mark.item)))
    return Debrief(score=max(round(FULL - sum(mark.lost for mark in marks)), 0), marks=marks)


def _over(value: float, limit: float, points_each: float, most: float) -> float:
    """Return the points for each unit over a limit, at most `most`."""
    return min(max(value - limit, 0.0) * points_each, most)


def _steps(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    steps = len(attempt.lesson.steps)
    yield ScoreItem(item=Item.STEPS, value=attempt.step, limit=steps, lost=FULL * (steps - attempt.step) / steps)


def _score_collisions(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    met = len(attempt.collision_kinds)
    yield ScoreItem(item=Item.MET, value=met, limit=0, lost=min(25.0 * met, 50.0))


def _score_jaw_clearance(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    nearest_mm = truth.nearest_jaws_mm
    if nearest_mm is None or nearest_mm <= 0.0:  # a collision has its own points
        return
    lost = 10.0 * max(1.0 - nearest_mm / CLEAR_OF_JAWS_MM, 0.0)
    yield ScoreItem(item=Item.NEAR, value=nearest_mm, limit=CLEAR_OF_JAWS_MM, lost=lost)


def _contact(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    if truth.contact_mm_per_s is None:
        return
    lost = _over(truth.contact_mm_per_s, GENTLE_MM_PER_S, 5.0, 10.0)
    yield ScoreItem(item=Item.CONTACT, value=truth.contact_mm_per_s, limit=GENTLE_MM_PER_S, lost=lost)


def _round(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    part = attempt.part
    if part is None or not part.full or part.tolerance_um is None:
        return
    limit_um = max(part.tolerance_um, truth.reachable_um)
    # By the fraction of the lobe that is left: what the compensation was there to remove.
    to_remove_um = max((attempt.found.lobe_um_pp or 0.0) - limit_um, limit_um)
    lost = _over(part.ront_um, limit_um, 30.0 / to_remove_um, 30.0)
    yield ScoreItem(
        item=Item.ROUND, value=part.ront_um, limit=limit_um, lost=lost, cost_um=part.ront_um - truth.reachable_um
    )


def _diameter(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    part = attempt.part
    if part is None or part.diameter_passes is None or part.offset_um is None:
        return
    lost = 0.0 if part.diameter_passes else 10.0
    yield ScoreItem(item=Item.DIAMETER, value=2.0 * abs(part.offset_um), limit=0.0, lost=lost)


def _jaw(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    found = attempt.found
    if found.jaw_1_deg is None:
        return
    error_deg = abs((found.jaw_1_deg - truth.jaw_1_deg + 180.0) % 360.0 - 180.0)
    turned = abs(math.sin(math.radians(0.5 * found.jaws * error_deg)))
    cost_um = None if found.lobe_um_pp is None else 2.0 * found.lobe_um_pp * turned
    lost = _over(error_deg, JAW_WITHIN_DEG, 5.0, 20.0)
    yield ScoreItem(item=Item.JAW, value=error_deg, limit=JAW_WITHIN_DEG, lost=lost, cost_um=cost_um)


def _touch_off(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    zero_mm = attempt.found.zero_radius_mm
    if zero_mm is None:
        return
    error_um = 1000.0 * abs(zero_mm - truth.zero_radius_mm)
    lost = _over(error_um, TIP_WITHIN_UM, 0.2, 15.0)
    yield ScoreItem(item=Item.TOUCH_OFF, value=error_um, limit=TIP_WITHIN_UM, lost=lost)


def _answer(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    if attempt.answer is None:
        return
    right = attempt.lesson.right_answer(attempt.seed)
    lost = 0.0 if attempt.answer == right else WRONG_ANSWER
    yield ScoreItem(item=Item.ANSWER, value=attempt.answer + 1, limit=right + 1, lost=lost)


def _stops(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    asked = sum(step in STOPS for step in attempt.lesson.steps) + attempt.faults
    stops = sum(_is_ours(each) for each in attempt.happened)
    yield ScoreItem(item=Item.STOPS, value=stops, limit=asked, lost=_over(stops, asked, 5.0, 15.0))


def _alarms(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    unseen_s = unacknowledged_times_s(attempt, now_s)
    late = sum(each > SEEN_WITHIN_S for each in unseen_s)
    longest_s = max(unseen_s, default=0.0)
    yield ScoreItem(item=Item.ALARMS, value=longest_s, limit=SEEN_WITHIN_S, lost=min(5.0 * late, 15.0))


def _reaction(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    reactions_s = reactions(attempt, now_s)
    if reactions_s:
        longest_s = max(reactions_s)
        lost = _over(longest_s, SEEN_WITHIN_S, 0.1, 10.0)
        yield ScoreItem(item=Item.REACTION, value=longest_s, limit=SEEN_WITHIN_S, lost=lost)


def _time(attempt: Attempt, truth: Truth, now_s: float) -> Iterable[ScoreItem]:
    minutes, limit = attempt.took_s(now_s) / 60.0, attempt.lesson.minutes
    yield ScoreItem(item=Item.TIME, value=minutes, limit=limit, lost=_over(minutes, limit, 2.0, 10.0))


def unacknowledged_times_s(attempt: Attempt, now_s: float) -> tuple[float, ...]:
    """Return for how long each alarm was not acknowledged, s: one that never was, until the lesson ended."""
    raised: dict[str, float] = {}
    found: list[float] = []
    for each in attempt.happened:
        if each.what is HappeningKind.ALARM:
            raised.setdefault(each.word, each.at_s)
        elif each.what is HappeningKind.SEEN and each.word in raised:
            found.append(each.at_s - raised.pop(each.word))
        elif each.what is HappeningKind.LEFT:
            found += [each.at_s - at_s for at_s in raised.values()]
            raised.clear()
    end_s = attempt.ended_s if attempt.ended_s is not None else now_s - attempt.began_s
    return (*found, *(end_s - at_s for at_s in raised.values()))


def reactions(attempt: Attempt, now_s: float) -> tuple[float, ...]:
    """Return how long after each fault something was done about it, s: a stop, an alarm seen, or a step made."""
    end_s = attempt.ended_s if attempt.ended_s is not None else now_s - attempt.began_s
    acts = [each.at_s for each in attempt.happened if _is_act(each) or each.what is HappeningKind.LEFT]
    faults = [each.at_s for each in attempt.happened if each.what is HappeningKind.FAULT]
    return tuple(min((act for act in acts if act > at_s), default=end_s) - at_s for at_s in faults)


def _is_act(each: Happening) -> bool:
    """Whether somebody did something: a step of the machine itself is none."""
    by_itself = each.what is HappeningKind.STEP and each.word in BY_ITSELF
    return _is_ours(each) or (each.what in (HappeningKind.SEEN, HappeningKind.STEP) and not by_itself)


def _is_ours(each: Happening) -> bool:
    """Whether it is a stop by a key: the controller and the console stop by themselves, too."""
    return each.what is HappeningKind.STOP and is_by_key(each.word)


Judge = Callable[[Attempt, Truth, float], Iterable[ScoreItem]]
JUDGES: Mapping[Item, Judge] = MappingProxyType(
    {
        Item.STEPS: _steps,
        Item.MET: _score_collisions,
        Item.NEAR: _score_jaw_clearance,
        Item.CONTACT: _contact,
        Item.ROUND: _round,
        Item.DIAMETER: _diameter,
        Item.JAW: _jaw,
        Item.TOUCH_OFF: _touch_off,
        Item.ANSWER: _answer,
        Item.STOPS: _stops,
        Item.ALARMS: _alarms,
        Item.REACTION: _reaction,
        Item.TIME: _time,
    }
)
"""How each item is judged. An item that the try says nothing about has no mark."""
