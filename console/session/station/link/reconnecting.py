"""Come back after a lost link, in place: by reading, until it is known whose the machine is and what it does.

By itself this console opens the link again and reads: which controller answers, who controls it, what moves. It
claims, enables and moves nothing, and does not renew the watchdog of the motion that was lost: the controller ends
that by itself, tool out first, and is only watched while it does. At rest the stop that the lost link did not take
is delivered, so that the drives are off. It ends as every stop does: F2 resets.

A machine that another console controls meanwhile, or that has forgotten this one (it was switched off), receives
nothing at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from console.session.cut.alignment import Alignment
from console.session.station.alarms import Priority, recover_alarms
from console.session.station.context import StationContext
from console.session.station.gain_trial import trial_problems, verify_controller
from console.session.station.link.lost_link import LostLink, Validity, validity_of
from console.session.station.state import Activity
from console.session.station.stops import MachineStops
from console.session.station.watches import watch_axes
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.snapshot import Snapshot
from drivers.link.base import GONE
from profiles.problem import Problem, ProblemError

SILENT_CODES = ("link.silent", "link.late", "link.not_in_step", "machine.not_at_rest", "machine.rest_unknown")
"""Alarms that are over once the machine was read again."""


@dataclass(frozen=True)
class _Watch:
    """How long the controller is watched while it ends its motion, and how many stops there were before."""

    until_s: float
    stops: int


class Reconnection:
    """The way back of one station. `step` is called instead of a poll while the link is gone."""

    def __init__(self, context: StationContext, stops: MachineStops) -> None:
        self._context, self._stops = context, stops
        self._before = Alignment()
        self._undelivered = 0  # stops up to the loss: they reached nobody
        self._begun = self._dropped = False
        self._watch: _Watch | None = None

    def give_up_connection(self, problem: Problem) -> None:
        """Give up a connection on which a machine has never answered: it may be dead on this side alone."""
        context, reopening = self._context, self._context.reopening
        if reopening is not None:
            now_s = context.clock.now_s()
            reopening.give_up(now_s, problem)
            context.tell(lost_link=LostLink(since_s=now_s, attempts=reopening.attempts, problem=problem))

    def reopen_connection(self) -> bool:
        """Open that connection again; return whether a machine that has never answered may be asked."""
        context, reopening = self._context, self._context.reopening
        if reopening is None or context.state.lost_link is None:
            return True
        opened = reopening.poll(context.clock.now_s())
        self._say(attempts=reopening.attempts, problem=reopening.problem, for_ever=reopening.for_ever)
        return opened

    def step(self) -> None:
        """Try to open the link; once it is open, watch the machine on it."""
        context, reopening = self._context, self._context.reopening
        if reopening is None:
            return
        if self._watch is not None:
            self._watch_ending(self._watch)
            return
        if not self._begun:
            self._lose(silent=False)
        if not self._dropped:
            self._dropped = True
            reopening.begin(context.clock.now_s())
            self._say(silent=False)
        stops = context.lathe.stop.count
        opened = reopening.poll(context.clock.now_s())
        self._say(attempts=reopening.attempts, problem=reopening.problem, for_ever=reopening.for_ever)
        if opened:
            self._return(stops)

    def note_rest(self) -> None:
        """Note the outcome of a wait for rest: on a link that is only silent, it is the way back."""
        state = self._context.state
        if self._stops.gone:
            return
        if state.activity is Activity.LOST:
            if not self._begun:
                self._lose(silent=True)
            lost = self._context.state.lost_link
            self._say(attempts=1 if lost is None else lost.attempts + 1)
        elif self._begun and state.activity is Activity.STOPPED:
            self._back()
            self._judge()

    def _lose(self, *, silent: bool) -> None:
        context = self._context
        state = context.state
        since_s = context.clock.now_s() if state.snapshot is None else state.snapshot.asked_s
        self._begun, self._before, self._undelivered = True, state.alignment, context.lathe.stop.count
        context.tell(lost_link=LostLink(since_s=since_s, silent=silent, returned=self._returning))

    def _say(self, **changes: int | float | str | Problem | None) -> None:
        lost = self._context.state.lost_link
        if lost is not None and (after := replace(lost, **changes)) != lost:  # type: ignore[arg-type]
            self._context.tell(lost_link=after)

    def _return(self, stops: int) -> None:
        """Read the machine at the end of a connection that was just opened."""
        context = self._context
        self._know_again()
        try:
            context.lathe.reconnect()
        except ProblemError as error:
            self._lose_again(error)
            return
        self._back()
        if not context.state.controls:
            self._observe(stops)
            return
        context.tell(activity=Activity.STOPPING)
        until_s = context.clock.now_s() + context.lathe.ends_within_s
        # Somebody who has pressed a stop meanwhile wants it now, wherever the tool is.
        self._watch = _Watch(until_s=until_s, stops=self._undelivered)
        self._watch_ending(self._watch)

    @property
    def _returning(self) -> str:
        training = self._context.training
        known = None if training is None else training.returning
        return "" if known is None else f"{known.name} ({known.at})"

    def _know_again(self) -> None:
        """Where an instructor has gone back to a checkpoint, know of the lathe what was known there."""
        context, training = self._context, self._context.training
        if training is None or training.returning is None:
            return
        self._say(returned=self._returning)
        training.returning.restore()
        context.alarm_once(Problem(code="link.returned", value=self._returning), Priority.MEDIUM)
        self._before, training.returning = context.state.alignment, None
        context.lathe.in_doubt()  # of what the drives do: those stops were another lathe's
        context.lathe.stop.stop("link.returned")

    def _back(self) -> None:
        context = self._context
        self._begun = self._dropped = False
        context.end_alarms(*GONE, *SILENT_CODES)
        self._say(back_s=context.clock.now_s(), problem=None)

    def _watch_ending(self, watch: _Watch) -> None:
        context, stop = self._context, self._context.lathe.stop
        try:
            ended = context.lathe.snapshot().at_rest and not context.lathe.is_ending()
            by_its_path = ended and stop.count <= watch.stops and not context.lathe.took_out()
        except ProblemError as error:
            self._lose_again(error)
            return
        if not context.state.controls:
            self._observe(stop.count)
        elif ended or stop.count > watch.stops or context.clock.now_s() > watch.until_s:
            self._watch, self._stops.gone = None, False
            if by_its_path:
                self._stops.forget_mark()
            self._stops.settle()
            if context.state.activity is Activity.STOPPED:
                self._judge()

    def _lose_again(self, error: ProblemError) -> None:
        context, reopening = self._context, self._context.reopening
        self._watch = None
        if not self._begun:
            context.alarm(error.problems[0])
        self._begun = self._dropped = True
        context.tell(activity=Activity.LOST)
        self._say(back_s=None, problem=error.problems[0])
        if reopening is not None:
            reopening.give_up(context.clock.now_s(), error.problems[0])

    def _observe(self, stops: int) -> None:
        """Leave the machine to whoever controls it: what this console had stopped or armed is over."""
        context = self._context
        self._watch, self._stops.gone = None, False
        context.lathe.stop.withdraw(stops)
        if (snapshot := context.state.snapshot) is not None:
            watch_axes(context, snapshot)
        context.end_record()
        context.change_alarms(recover_alarms)
        over = context.lathe.stop.reason is None
        context.tell(armed=None, stop=None if over else context.state.stop, activity=Activity.READY)
        if context.state.standing is ConsoleRole.OUSTED:
            self._judge()
        else:
            context.tell(lost_link=None)

    def _judge(self) -> None:
        """Publish what is still valid, by the last poll; and compare the settings again, which is only read."""
        context, snapshot = self._context, self._context.state.snapshot
        if snapshot is None:
            return
        try:
            settings = verify_controller(context)
        except ProblemError as error:  # the next poll finds the same
            context.alarm(error.problems[0])
            return
        context.tell(
            alignment=replace(context.state.alignment, settings=settings),
            uncommissioned=(
                *trial_problems(context),
                *(each for each in context.state.uncommissioned if not each.code.startswith("trial.")),
            ),
        )
        lost = context.state.lost_link
        if lost is not None:
            if not lost.silent:
                context.note_anyway("link_back", away_s=lost.away_s, controls=context.state.controls)
            context.tell(lost_link=replace(lost, validity=self._validity(snapshot)))

    def _validity(self, snapshot: Snapshot) -> tuple[Validity, ...]:
        state = self._context.state
        return validity_of(
            self._before,
            state.alignment,
            homed_axes=tuple(axis for axis in snapshot.driven if axis in snapshot.homed_axes),
            unhomed=tuple(axis for axis in snapshot.driven if axis not in snapshot.homed_axes),
            ours=state.controls,
            chuck=snapshot.inputs.get("chuck_closed"),
        )
