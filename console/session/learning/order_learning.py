"""Which orders a row of parts learns, with what gain, and the certificate of each.

What a blank does to the tool is seen by its scale: an oval blank bends the soft loop twice a turn, at another
angle each time. It is trimmed away within the cut, and what the trim leaves is taken out of what the part shows
before anything is learned from it. What remains is of the machine and the chuck, and repeats. The tool's error at
the other orders is its own: friction couples each motion to the others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from console.session.learning.learning_beside import CUT_BATCH_S, blank_orders
from console.session.learning.learning_steps import LEAST_FOLLOWED, OVERTONES, scatter_um
from drivers.cutting.sampling import LEAST_SAMPLES_A_LOBE
from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import follows_by_order
from profiles.compensations.certificate import (
    CertifiedOrder,
    OrderEvidence,
    OrderStatus,
    certify_order,
    is_promised,
    promised_orders,
)
from profiles.compensations.change import (
    MARK_SD_DEG,
    MEAN,
    UNCHANGED,
    OrderChange,
    OrderState,
    ShownOrder,
    change_of,
    state_of,
)
from profiles.compensations.learning import REPEATS_SD_UM, SIGNIFICANT, Deviation, HarmonicWatch, coefficient_of
from profiles.compensations.next_version import FIRST_GAIN, LATER_GAIN
from profiles.compensations.optimal_gain import (
    PRIOR_OTHERS_UM,
    PROCESS_LOSS_SD,
    Scatter,
    lobe_prior_um,
    optimal_gain,
)
from profiles.compensations.order_steps import STEP_UM, RepeatHistory
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import OVAL, CutPath
from profiles.job import Job
from profiles.machine import MachineProfile

SAMPLES_A_PERIOD = 3  # of the highest order in a batch
SAMPLES_AN_ORDER = 5  # of a batch, for two unknowns each
ENOUGH_A_TURN = 36
"""Samples a turn that suffice up to 12 UPR: with many jaws those of each lobe would take too long to fetch."""
ALWAYS_FITTED = (1, OVAL)  # run-out and oval of a blank would leak into the others


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnHow:
    """How parts teach: `every_order`, or the lobe and its overtones; by `optimal` gains, or by fixed ones.

    With `fingerprint` an indicator shows the clamping of each part before it is cut; `along` learns from sections;
    `changes` follows steps and drifts. With `band` a trial band of the first part is cut and indicated before its
    rest.
    """

    every_order: bool = True
    optimal: bool = True
    fingerprint: bool = False
    along: bool = True
    changes: bool = True
    band: bool = False


class OrderLearning:
    """The orders that one row of parts learns, and what its parts so far have shown of them."""

    def __init__(self, job: Job, machine: MachineProfile, strategy: Strategy, how: LearnHow) -> None:
        self._lobes, self._how = job.jaws, how
        self._lobe_um = job.lobe_amplitude_um
        self.scatter = scatter_um(job, machine) / self._lobe_um if self._lobe_um else 0.0
        self.follows = follows_by_order(strategy, machine, job.spindle_speed_rpm)
        overtones = (self._lobes * each for each in OVERTONES)
        multiples = {self._lobes, *(n for n in overtones if is_promised(self.follows(n), LEAST_FOLLOWED))}
        promised = promised_orders(self.follows, LEAST_FOLLOWED, _highest(job)) if how.every_order else ()
        self.learned = tuple(sorted({*multiples, *promised}))
        self.fitted = tuple(sorted({*ALWAYS_FITTED, *blank_orders(self._lobes), *self.learned}))
        self.beside = tuple(n for n in self.learned if n not in multiples)
        self.samples_a_turn = min(
            LEAST_SAMPLES_A_LOBE * self._lobes, max(ENOUGH_A_TURN, SAMPLES_A_PERIOD * self.fitted[-1])
        )
        self._steps_um: dict[int, list[float]] = {}
        self._repeating: RepeatHistory | None = None
        self._grown_in_air: frozenset[int] = frozenset()
        self._shown: dict[int, tuple[ShownOrder, ...]] = {}
        self._states: dict[int, OrderState] = {}
        self.varying: frozenset[int] = frozenset()  # orders that do not repeat from part to part

    @property
    def trims_oval(self) -> bool:
        """Whether the oval of a blank is trimmed away within the cut."""
        return self._how.every_order

    def of_blank(self, order: int) -> bool:
        """Whether the tool's error at this order is that of an oval blank, and another one in each part."""
        return order in blank_orders(self._lobes)

    @property
    def of_blanks(self) -> tuple[int, ...]:
        """The learned orders, besides the lobe, at which the tool's error in a cut is also that of the blank."""
        return tuple(n for n in self.learned if self.of_blank(n) and n != self._lobes)

    def of_tool(self, tool_off: Deviation) -> dict[int, complex]:
        """Return the tool's error in a part that the table has to correct for the next one."""
        least_um = SIGNIFICANT * tool_off.sd_um
        return {
            n: c
            for n, c in tool_off.coefficients_um.items()
            if n in self.learned
            and n not in self.varying
            and not self.of_blank(n)
            and (n % self._lobes == 0 or abs(c) > least_um)
        }

    def residual_orders(self, part: PartHarmonics, tool_off: Deviation) -> dict[int, complex]:
        """Return what a part has of each order, without what its own blank has made."""
        blank = {n: c for n, c in tool_off.coefficients_um.items() if self.of_blank(n)}
        found = part.coefficients_um
        return {n: found[n] - blank.get(n, 0j) for n in self.learned if n in found}

    def begin(self, path: CutPath, watch: HarmonicWatch) -> None:
        """Take the path of the first part, and what has grown in air: there is no blank that it could be of."""
        if self._repeating is None:
            self._repeating, self._grown_in_air = RepeatHistory(begun=path), watch.frozen_orders

    def judge_part(
        self, watch: HarmonicWatch, path: CutPath, left_um: Mapping[int, complex], part: PartHarmonics
    ) -> HarmonicWatch:
        """Return the watch after a part that was cut with this path, and find which orders vary from part to part.

        An order that is not back at its best, though that is what was cut, did not grow by learning: it is judged
        anew. Not so the lobe, which is not trimmed either while it is not learned.
        """
        assert self._repeating is not None
        sd_um = self.sd_um(part, path)
        watch = watch.release_orders(watch.not_back(left_um, sd_um) - self._grown_in_air - {self._lobes})
        self._repeating = self._repeating.add_part({n: self._plain_um(n, c, path) for n, c in left_um.items()})
        watch = watch.release_orders(frozenset(n for n in left_um if self.state(n).fresh))
        self.varying = self._repeating.varying(self._lobes, self._states) - watch.frozen_orders
        steady = {n: c for n, c in left_um.items() if n not in self.varying}
        return watch.release_orders(self.varying).judge_pass(path, steady, sd_um)

    def _plain_um(self, order: int, left_um: complex, path: CutPath) -> complex:
        """Return what a part would have left of an order with nothing learned.

        Where a blank moves the tool, what it has left is without the error of the tool: as if that had followed.
        """
        assert self._repeating is not None
        if self.of_blank(order):
            return left_um + self._repeating.target_moved_um(path, order)
        return left_um + self.follows(order).response * self._repeating.command_moved_um(path, order)

    def judge_changes(
        self,
        left_um: Mapping[int, complex],
        path: CutPath,
        part: PartHarmonics,
        tool_off: Deviation,
        known: Callable[[int], complex],
    ) -> None:
        """Find which orders have stepped or drift, by a part that was cut with this path and has left these.

        Both count `known` times, as `LobeLearning.known_now`.
        """
        for n, c in left_um.items():
            off_um = 0j if self.of_blank(n) else tool_off.coefficients_um.get(n, 0j)
            mark_um = n * math.radians(MARK_SD_DEG) * abs(part.coefficients_um[n])
            sd_um = math.hypot(part.sd_um[n], tool_off.sd_um, REPEATS_SD_UM, mark_um)
            now = known(n)
            self._add(n, now * (c - off_um), now * coefficient_of(path.target, n), sd_um, self.scatter)

    def size_step_um(self, left_um: float, path: CutPath, gain: float) -> float:
        """Return how much deeper to cut, after a part that the tool on its path left so much too large, um."""
        had_um = complex(path.target.mean_um)
        self._add(MEAN, left_um + 0j, had_um, REPEATS_SD_UM)
        return (self.state(MEAN).follow(had_um + gain * left_um) - had_um).real

    def _add(self, order: int, left_um: complex, had_um: complex, sd_um: float, clamped: float = 0.0) -> None:
        seen = ShownOrder(shown_um=left_um + had_um, path_um=had_um, sd_um=sd_um, clamped=clamped)
        self._shown[order] = (*self._shown.get(order, ()), seen)
        if self._how.changes:
            self._states[order] = state_of(self._shown[order], order, self._lobes)

    def state(self, order: int) -> OrderState:
        """Return whether an order, 0 for the size, has stepped or drifts."""
        return self._states.get(order, UNCHANGED)

    @property
    def has_stepped(self) -> bool:
        """Whether the last part has shown a step of an order."""
        return any(state.fresh for order, state in self._states.items() if order)

    @property
    def changes(self) -> tuple[OrderChange, ...]:
        """What the last part has shown of steps and drifts."""
        found = (change_of(self.state(n), n) for n in (MEAN, *self.learned))
        return tuple(each for each in found if each is not None)

    def withdrawn(self, path: CutPath) -> CutPath:
        """Return a path without what was learned of the orders that vary."""
        return path if self._repeating is None else self._repeating.withdrawn(path, self.varying)

    def sd_um(self, part: PartHarmonics, path: CutPath) -> Callable[[int], float]:
        """Return the standard deviation of an order of a part: what jaws make is as uncertain as their force."""
        return lambda n: math.hypot(part.sd_um[n], self._clamped_um(n, abs(coefficient_of(path.target, n))))

    def _clamped_um(self, order: int, made_um: float) -> float:
        return self.scatter * (self._lobe_um if order == self._lobes else made_um)

    def teaches(self, order: int, left_um: complex, part: PartHarmonics) -> bool:
        """Whether what a part has left of an order teaches: the first time it has to stand out of the noise.

        From then on its gain weighs it against that noise, so that a small rest of a large step is not left.
        """
        if order in self.varying:
            return False
        begun = self._how.optimal and any(step_um > STEP_UM for step_um in self._steps_um.get(order, ()))
        return begun or self.state(order).is_drifting or abs(left_um) > SIGNIFICANT * part.sd_um[order]

    def gain(self, order: int, error_um: complex, part: PartHarmonics, path: CutPath) -> float:
        """Return the gain for the next step of an order."""
        state = self.state(order)
        steps = self._steps_um.get(order, [])[state.since :]
        if not self._how.optimal:
            return LATER_GAIN if steps else FIRST_GAIN
        made_um = abs(coefficient_of(path.target, order) + error_um)
        lobe = order == self._lobes
        scatter = Scatter(
            prior_um=max(lobe_prior_um(self._lobe_um, order) if lobe else PRIOR_OTHERS_UM, abs(state.stepped_um)),
            part_um=math.hypot(part.sd_um[order], self._clamped_um(order, made_um)),
            response=PROCESS_LOSS_SD,
        )
        return optimal_gain(scatter, steps, abs(error_um))

    def step(self, before: CutPath, after: CutPath) -> None:
        """Take a step of the path."""
        for n in self.learned:
            moved_um = abs(coefficient_of(after.target, n) - coefficient_of(before.target, n))
            self._steps_um.setdefault(n, []).append(moved_um)

    def certificate(
        self,
        left_um: Mapping[int, complex],
        part: PartHarmonics,
        tool_off: Deviation,
        gains: Mapping[int, float],
        frozen: frozenset[int],
    ) -> tuple[CertifiedOrder, ...]:
        """Return the certificate of every order that a part shows, and of the first that is not promised."""
        beyond = self.learned[-1] + 1
        found = []
        for n in (*self.learned, *(() if is_promised(self.follows(beyond), LEAST_FOLLOWED) else (beyond,))):
            shown = OrderEvidence(
                on_part_um=part.coefficients_um.get(n),
                left_um=left_um.get(n),
                tool_off_um=tool_off.coefficients_um.get(n),
            )
            standing = self._standing(n, shown.left_um, part, frozen)
            clamped_um = self._clamped_um(n, abs(shown.on_part_um or 0j))
            how = gains.get(n, 0.0), shown, self.follows(n), standing
            of_order = certify_order(n, *how, clamped_um=clamped_um)
            found.append(replace(of_order, change=change_of(self.state(n), n)))
        return tuple(found)

    def _standing(
        self, n: int, left_um: complex | None, part: PartHarmonics, frozen: frozenset[int]
    ) -> OrderStatus:
        if n not in self.learned:
            return OrderStatus.NO_PROMISE
        if n in frozen:
            return OrderStatus.GREW
        if n in self.varying and left_um is not None and abs(left_um) > SIGNIFICANT * part.sd_um[n]:
            return OrderStatus.VARIES
        return OrderStatus.LEARNED if left_um is not None and self.teaches(n, left_um, part) else OrderStatus.NOISE


def _highest(job: Job) -> int:
    """Return the highest order that a batch of a cut supports."""
    samples = LEAST_SAMPLES_A_LOBE * job.jaws * job.spindle_speed_rpm / 60.0 * CUT_BATCH_S
    return min(LEAST_SAMPLES_A_LOBE * job.jaws // SAMPLES_A_PERIOD, int(samples / SAMPLES_AN_ORDER))
