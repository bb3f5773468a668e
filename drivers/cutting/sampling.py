"""Measure the real tool motion during a cut, in batches: gathered at servo rate, fetched between two polls.

Tool and spindle of a batch are sampled in the same servo cycles, so that each tool position has its exact
angle; polls are less exact. A batch is fetched in pieces short enough not to delay the watchdog renewal.
Nothing here moves anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.cutting.planning import CutPlan
from drivers.errors import ControllerError, DriverError, LinkTimeoutError
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.gathering.gather_client import LISTING_TIMEOUT_S, DataGathering, GatheredData, GatherPlan
from profiles.machine import MachineProfile
from profiles.problem import Problem

Floats = NDArray[np.float64]
_Result = TypeVar("_Result")

PIECE_LONG_WORDS = 24  # between two polls: 80 ms at 38 400 baud, of a watchdog timeout of 300 ms
POLL_OF_PIECE_S = 0.06  # how long a poll may take for such a piece; pieces are shorter on a slower line
LEAST_PIECE_LONG_WORDS, MOST_PIECE_LONG_WORDS = 4, 96  # the longest is one packet of a network, 1248 characters

ANSWER_S = 0.17  # reply timeout under a watchdog, as for a poll
MOST_LOST = 3  # consecutive batches that may be lost on the line
MARGIN_S = 0.05  # how much longer than its samples a batch is waited for
LEAST_SAMPLES_A_LOBE = 12  # minimum samples per lobe in a batch; the overtones get correspondingly fewer


@dataclass(frozen=True, kw_only=True)
class Batch:
    """A stretch of a cut: spindle angles in deg, infeed of the tip from the surface in um; shape (M,).

    `past_middle_mm` is the approximate carriage position, from the middle of the cut towards the jaws. `thrust_n`
    is what the output of the tool's motor commands, positive into the work; empty where it was not gathered.
    `face_deg` is the spindle angle at which the leading edge of the tool meets the face of the part, by angle and
    carriage of the poll before.
    """

    angle_deg: Floats
    infeed_um: Floats
    past_middle_mm: float
    thrust_n: Floats
    face_deg: float


class BatchGather:
    """Gathers the batches of a cut in turn; `take` receives each after it is fetched, between two polls.

    Every method but `give_back` raises DriverError: `gather.failed`, the controller does not gather as it should;
    the link broke.
    """

    def __init__(
        self, client: Controller, machine: MachineProfile, clock: Clock, round_trip: Callable[[], float]
    ) -> None:
        """`round_trip` returns how long the last poll took, s."""
        self._client, self._machine, self._clock, self._round_trip = client, machine, clock, round_trip
        self._gathering = DataGathering(client=client, dialect=DIALECTS[machine.controller.family])
        self._quick = replace(self._gathering, timeout_s=ANSWER_S)
        self._lost = 0
        self._names = (f"#{machine.tool.motor} actual", f"#{machine.spindle.motor} actual")
        self._output = f"#{machine.tool.motor} output"
        self._from_counts = 0.0
        self._state: _State = None
        self._plan: GatherPlan | None = None
        self._next_plan: GatherPlan | None = None  # that of the first batch may be shorter
        self._cut: CutPlan | None = None
        self._take: Callable[[Batch], None] = lambda _: None

    def prepare(
        self,
        cut: CutPlan,
        samples_a_turn: int,
        seconds: float,
        take: Callable[[Batch], None],
        *,
        thrust: bool = False,
        from_counts: float | None = None,
        first_s: float | None = None,
    ) -> None:
        """Set up the controller, at rest and after the program is loaded: defining a table deletes buffers.

        `samples_a_turn` are gathered at least: few are fetched sooner, so that more batches fit into a cut. With
        `thrust` the output of the tool's motor is gathered, too. Nothing is gathered before the carriage has come
        to `from_counts`; None is a turn after the start of its feed. The first batch is `first_s` long, if given.
        """
        cycle_s = self._machine.controller.servo_period_ms / 1000.0
        sample_s = 60.0 / (samples_a_turn * cut.spindle_speed_rpm)
        period = max(1, math.floor(sample_s / cycle_s))
        self._cut, self._take, self._state, self._plan = cut, take, None, None
        self._from_counts = cut.carriage_start + cut.setup.carriage_per_turn
        if from_counts is not None:
            self._from_counts = max(self._from_counts, from_counts)
        names = (*self._names, self._output) if thrust else self._names
        self._plan = self._next_plan = self._try_step(
            lambda: self._gathering.prepare(
                self._gathering.motor_channels(*names), math.ceil(seconds / (period * cycle_s)), period
            )
        )
        if first_s is not None:
            self._next_plan = replace(self._plan, samples=math.ceil(first_s / (period * cycle_s)))

    def see(self, snapshot: Snapshot) -> None:
        """Process a poll of the machine: begin, end or fetch, with at most one request of any length.

        A batch lost on the line is abandoned for the next one.
        Raises DriverError: `gather.failed`; the link broke.
        """
        try:
            self._state = self._try_step(lambda: self._next(snapshot))
        except LinkTimeoutError:
            self._lost += 1
            if self._lost >= MOST_LOST:
                raise self._gather_error(f"{self._lost} batches in a row were lost on the line") from None
            self._state = None

    def finish(self) -> None:
        """Fetch the rest of a batch in progress, once the machine rests and nothing waits."""
        while isinstance(state := self._state, _Fetching):
            self._state = self._try_step(partial(self._fetch_part, state))

    @property
    def fetching(self) -> bool:
        """Whether a batch was gathered and is not fetched yet."""
        return isinstance(self._state, _Fetching)

    def fetch_at_rest(self, long_words: int) -> None:
        """Fetch a longer piece of a batch, once the machine rests; between two polls, as `see`."""
        if isinstance(state := self._state, _Fetching):
            self._state = self._try_step(partial(self._fetch_part, state, long_words))

    def give_back(self) -> None:
        """Stop gathering and delete the buffer, if it is ours: other work may need the room. Raises nothing."""
        plan, self._plan, self._state = self._plan, None, None
        if plan is None:
            return
        for line in ("ENDGATHER", "DELETE GATHER"):
            with suppress(DriverError):
                self._client.request(line, ANSWER_S)

    def _next(self, snapshot: Snapshot) -> _State:
        state, plan = self._state, self._plan
        if plan is None:
            return None
        if isinstance(state, _Fetching):
            return self._fetch_part(state)
        in_path = self._in_path(snapshot)
        if state is None:
            if not in_path:
                return None
            if self._lost:
                self._quick.stop()  # whether the lost one continues is unknown
            begun, self._next_plan = self._next_plan or plan, plan
            self._quick.start(begun)
            return _Running(
                plan=begun,
                until_s=self._clock.now_s() + begun.duration_ms / 1000.0 + MARGIN_S,
                from_counts=snapshot.carriage.position,
                face_deg=self._face_deg(snapshot),
            )
        if not in_path:
            self._quick.stop()  # the end of the cut is in this batch: none of it is used
            return None
        if self._clock.now_s() < state.until_s:
            return state
        self._quick.stop()
        middle_counts = 0.5 * (state.from_counts + snapshot.carriage.position)
        return _Fetching(plan=state.plan, middle_counts=middle_counts, face_deg=state.face_deg)

    def _face_deg(self, snapshot: Snapshot) -> float:
        """Return the spindle angle at which the leading edge will be at the face of the part."""
        cut, machine = self._cut, self._machine
        assert cut is not None  # nothing is asked before `prepare`
        leading = cut.setup.carriage_face - 0.5 * machine.tool.wiper_land_mm * machine.carriage.counts_per_mm
        turns = (leading - snapshot.carriage.position) / cut.setup.carriage_per_turn
        onwards = math.copysign(1.0, snapshot.spindle.position - cut.spindle_start)
        return 360.0 * (snapshot.spindle.position / machine.spindle.counts_per_rev + onwards * turns)

    def _fetch_part(self, state: _Fetching, at_rest_words: int = 0) -> _Fetching | None:
        if state.complete:
            self._deliver(state)
            return None
        piece = at_rest_words or _piece_long_words(self._round_trip())
        count = min(piece, state.plan.long_words - state.words)
        answer_s = LISTING_TIMEOUT_S if at_rest_words else ANSWER_S
        part = self._client.request(f"LIST GATHER {state.words},{count}", answer_s)
        found = sum(len(line.split()) for line in part)
        words = state.words + found
        complete = found < count or words >= state.plan.long_words
        return replace(state, lines=(*state.lines, *part), words=words, complete=complete)

    def _deliver(self, state: _Fetching) -> None:
        """Pass the batch on once the controller confirms that nobody has changed the gathering meanwhile."""
        machine, cut, plan = self._machine, self._cut, state.plan
        assert cut is not None  # nothing is fetched before `prepare`
        if not self._quick.set_up_as(plan):
            self._plan = None
            raise GatherError("somebody else sets up gathering")
        self._lost = 0
        data = GatheredData.from_listing(state.lines, plan.channels, plan.period_cycles, plan.cycle_ms)
        tool, spindle = (data.values[name] for name in self._names)
        past_middle = state.middle_counts - cut.setup.carriage_middle
        self._take(
            Batch(
                angle_deg=spindle / machine.spindle.counts_per_rev * 360.0,
                infeed_um=(tool - cut.setup.surface) * machine.tool.count_um,
                past_middle_mm=past_middle / machine.carriage.counts_per_mm,
                thrust_n=data.values.get(self._output, np.empty(0)) * self._n_per_bit,
                face_deg=state.face_deg,
            )
        )

    @property
    def _n_per_bit(self) -> float:
        tool = self._machine.tool
        return tool.v_per_bit * tool.loop_gain_n_per_v

    def _in_path(self, snapshot: Snapshot) -> bool:
        """Whether the tool is on its path: at depth, with the carriage feeding towards the end of the cut."""
        cut = self._cut
        assert cut is not None  # nothing is asked before `prepare`
        setup = cut.setup
        there = snapshot.carriage.position
        end = cut.carriage_start + setup.carriage_counts - setup.carriage_per_turn
        fed = self._from_counts < there < end
        return snapshot.program_running and fed and snapshot.tool.position > setup.surface

    def _try_step(self, work: Callable[[], _Result]) -> _Result:
        try:
            return work()
        except (GatherError, ControllerError) as error:
            raise self._gather_error(str(error)) from error

    def _gather_error(self, why: str) -> DriverError:
        return DriverError(Problem(code="gather.failed", where=self._client.link.address, value=why))


def _piece_long_words(round_trip_s: float) -> int:
    """Return how many long words may be fetched between two polls on a line on which one took so long.

    On a slow line the poll itself uses up the watchdog timeout, so a piece shrinks with the square.
    """
    fraction = POLL_OF_PIECE_S / max(round_trip_s, POLL_OF_PIECE_S * PIECE_LONG_WORDS / MOST_PIECE_LONG_WORDS)
    return max(LEAST_PIECE_LONG_WORDS, math.floor(PIECE_LONG_WORDS * min(fraction, fraction**2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Running:
    plan: GatherPlan
    until_s: float
    from_counts: float
    face_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fetching:
    plan: GatherPlan
    middle_counts: float
    face_deg: float
    lines: tuple[str, ...] = ()
    words: int = 0
    complete: bool = False


_State = _Running | _Fetching | None  # of a batch; None while nothing is gathered
