"""The host side of the heartbeat: its PLC runs on the controller; the watchdog is renewed while something moves.

When the host falls silent, the controller ends the motion by itself, according to the policy. A host that was
delayed for as long as the watchdog timeout asks the controller first: a watchdog that has expired is not
renewed, because the motion it guarded was ended.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from drivers.clock import Clock
from drivers.controller import REPLY_TIMEOUT_S, Controller
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.link.base import is_gone
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.heartbeat.arming import (
    PERMISSION,
    HeartbeatLook,
    heartbeat_problems,
    lost_problem,
    permission_problem,
    permits_plc,
    read_heartbeat,
    silent,
)
from drivers.pmac.heartbeat.plc import OUT_LIMIT_MS, RUN_DOWN_MS, Policy, set_up_lines
from drivers.pmac.heartbeat.watch import LOSS_SEEN, NOTHING_GUARDED, EchoWatch, Keeper
from drivers.pmac.heartbeat.watchdog import (
    ENDING,
    PERIOD_MS,
    TAKE_OUT,
    cycles_of,
    watchdog_condition,
    watchdog_timer,
)
from drivers.pmac.reserved import ECHO, LOST, OWNER
from profiles.machine import MachineProfile
from profiles.problem import Problem

NOT_OURS = frozenset({"heartbeat.plc_missing", "heartbeat.plc_differs", "heartbeat.definition_differs"})
"""Problems that reloading the heartbeat PLC fixes."""

SHORTEST_WAIT_S = 0.001

RATE = "heartbeat.timer_rate"
LAPSED = "heartbeat.lapsed"  # code: the controller has ended a motion because this host was silent
RENEWAL_TIMEOUT_S = 0.17  # timeout for the reply to a renewal: it must leave time for another one
PULSE_TIMEOUT_S, PULSE_POLL_S = 0.3, 0.01
"""How long the PLC may take to show that it counts, and the polling interval, before anything moves."""

END_MARGIN_S = 1.0  # allowance for the controller beyond the times that it waits for
RATE_READINGS = 3  # of the watchdog, before a busy controller counts as one with other settings


def cut_condition(machine: MachineProfile) -> str:
    """Return the condition without which a cutting program ends by itself; "" if the policy lets it finish."""
    finishes = Policy(machine.heartbeat.policy) is Policy.FINISH
    return "" if finishes else watchdog_condition(DIALECTS[machine.controller.family])


class Heartbeat:
    """The watchdog of one controller. It guards nothing before `prepare` has found everything in order.

    `guarding` is whether something moves under this host's watchdog. Every method that queries or sends raises
    `LinkError` when the link breaks or is out of step.
    """

    def __init__(
        self,
        client: Controller,
        clock: Clock,
        machine: MachineProfile,
        policy: Policy | None = None,
        owner_seen: Callable[[float], None] = lambda _: None,
        held_s: Callable[[], float] | None = None,
    ) -> None:
        """Without a `policy`, that of the machine profile applies. `owner_seen` receives the owner read.

        `held_s` returns by how much a simulated lathe has held its time in all.
        """
        self.policy = Policy(machine.heartbeat.policy) if policy is None else policy
        self._held_s = held_s or (lambda: 0.0)
        self.guarding = False
        self._lapsed: Problem | None = None
        self._client, self._clock, self._machine, self._owner_seen = client, clock, machine, owner_seen
        self._dialect = DIALECTS[machine.controller.family]
        self._keeper: Keeper | None = None
        self._i10 = self._owner = 0.0
        self._echo = EchoWatch()

    def prepare(self) -> None:
        """Make sure that the controller would end a motion without a host; load its PLC where it is missing.

        Only with the drives disabled: it moves nothing, but a PLC that is being replaced guards nothing.
        Raises RefusedError: everything that is not in order, `heartbeat.*`.
        """
        self._keeper = None
        look, problems = self._read_heartbeat()
        if any(problem.code in NOT_OURS for problem in problems):
            self._client.download(set_up_lines(self._machine, self._dialect, self.policy))
            look, problems = self._read_heartbeat()
        if problems:
            raise RefusedError(*problems)
        self._i10 = look.i10
        self._keeper = Keeper(dialect=self._dialect, i10=look.i10)

    def problems(self) -> tuple[Problem, ...]:
        """Return the problems of a prepared heartbeat; before `prepare` nothing is queried."""
        return () if self._keeper is None else self._read_heartbeat()[1]

    def jog(self, line: str) -> str:
        """Return a jog command with its watchdog before it, to be sent at once."""
        return f"{self._begin().jog_line()} {line}"

    def cut(self, line: str, retracted_counts: float) -> str:
        """Return the start of a cut in the addressed system, with its watchdog and retract position before it."""
        return f"{self._begin().cut_line(retracted_counts, self._machine.heartbeat.grace_ms)} {line}"

    def renewal(self) -> str:
        """Return the renewal to prefix to a line sent at once; "" when nothing is guarded. Raises as `pause`."""
        keeper = self._current_keeper()
        if keeper is None:
            return ""
        self._keeper = keeper.record_renewal(self._clock.now_s())
        return keeper.line

    @property
    def condition(self) -> str:
        """The condition without which a cutting program ends by itself; none if the policy lets it finish."""
        return "" if self.policy is Policy.FINISH else watchdog_condition(self._dialect)

    @property
    def ends_within_s(self) -> float:
        """How long the controller may take to end a motion by itself; not for a cut that it lets finish."""
        if self.policy is Policy.FINISH:
            return math.inf
        return (self._machine.heartbeat.grace_ms + RUN_DOWN_MS + OUT_LIMIT_MS) / 1000.0 + END_MARGIN_S

    def is_ending(self) -> bool:
        """Query whether the controller is ending something."""
        return bool(self._client.numbers(f"P{ENDING}", timeout_s=PULSE_TIMEOUT_S, again=True)[0])

    def took_out(self) -> bool:
        """Query whether the controller had to retract a tool that had come to rest in the part.

        False where the program has ended at the end of its turn and retracted it by its path.
        """
        return bool(self._client.numbers(f"P{TAKE_OUT}", timeout_s=PULSE_TIMEOUT_S, again=True)[0])

    def pause(self, seconds: float, timeout_s: float = RENEWAL_TIMEOUT_S) -> None:
        """Let time pass and renew the watchdog when it is due; waiting for an answer is part of that time.

        Raises:
            DriverError: `heartbeat.lapsed`, this host was silent so long that the controller ended the motion;
                nothing was renewed.
        """
        end_s = self._clock.now_s() + seconds
        while True:
            due_s = self._renew_watchdog(timeout_s)
            now_s = self._clock.now_s()
            if now_s >= end_s:
                return
            self._clock.wait(max(min(end_s, due_s) - now_s, SHORTEST_WAIT_S))

    def lapse(self) -> DriverError:
        """Stop guarding, and return the problem to report: the controller has ended the guarded motion."""
        self.guarding, self._lapsed = False, self._lapse_problem
        return DriverError(self._lapsed)

    def loss(self, lost: int) -> Problem | None:
        """Return why something was ended without its host, else None; `lost` is P1004 of the newest poll.

        `heartbeat.lapsed` is of a motion of this console, `heartbeat.lost` of one before it.
        """
        if self._lapsed is None and lost:
            return self._lapse_problem if self.guarding else lost_problem(lost)
        return self._lapsed

    @property
    def _lapse_problem(self) -> Problem:
        return Problem(code=LAPSED, where=self._client.link.address)

    def forgo(self) -> None:
        """Stop guarding: the guarded line was not sent, and the controller received nothing."""
        self.guarding = False

    @property
    def silent(self) -> Problem | None:
        """Return `heartbeat.plc_silent` if the PLC no longer guards what moves, else None."""
        return self._echo.problem if self.guarding else None

    def end_guarding(self, timeout_s: float = REPLY_TIMEOUT_S) -> None:
        """End the guarding of a finished motion; the watchdog may expire.

        Raises:
            DriverError: `heartbeat.lapsed`, the controller ended it before.
            LinkError: the link broke; the controller may not know that the motion is over.
        """
        if not self.guarding:
            return
        self._client.request(NOTHING_GUARDED, timeout_s)
        self.guarding = False
        (lost,) = self._client.numbers(f"P{LOST}", timeout_s=timeout_s, again=True)
        if lost:
            raise self.lapse()

    def loss_seen(self) -> None:
        """Clear the record of an ended motion: an operator has acknowledged it."""
        self._client.request(LOSS_SEEN)

    def _read_heartbeat(self) -> tuple[HeartbeatLook, tuple[Problem, ...]]:
        """Read the heartbeat, and again where only the rate is off: a delayed host also reads a wrong rate.

        No rate is judged while a simulated lathe holds its time.
        """
        for _ in range(RATE_READINGS):
            held_s = self._held_s()
            look = read_heartbeat(self._client, self._clock, self._machine, self._dialect)
            problems = heartbeat_problems(look, self._machine, self._dialect, self.policy)
            if any(problem.code != RATE for problem in problems) or not problems:
                break
            problems = () if self._held_s() > held_s else problems
        return look, problems

    def _begin(self) -> Keeper:
        if self._keeper is None:
            raise RefusedError(Problem(code="heartbeat.not_prepared", where=self._client.link.address))
        self._refuse_silent()
        self.guarding, self._lapsed, self._echo = True, None, EchoWatch()
        self._keeper = self._keeper.record_renewal(self._clock.now_s())
        return self._keeper

    def _refuse_silent(self) -> None:
        """Make sure that the PLC runs now: it may have been disabled since it was prepared."""
        items, end_s = (f"I{PERMISSION}", f"P{ECHO}", f"P{OWNER}"), self._clock.now_s() + PULSE_TIMEOUT_S
        permission, first, self._owner = self._client.numbers(*items, again=True)
        self._owner_seen(self._owner)
        if not permits_plc(permission):
            raise RefusedError(permission_problem(permission))
        while self._client.numbers(*items, again=True)[1] == first:
            if self._clock.now_s() > end_s:
                raise RefusedError(silent(first, first))
            self._clock.wait(PULSE_POLL_S)

    def _current_keeper(self) -> Keeper | None:
        """Return the keeper of what is guarded now, None when nothing is; raise when that has lapsed.

        A late host queries whether the watchdog is still armed, with enough time left for a renewal. Under another
        owner the watchdog is not ours, whatever is left of it.
        """
        keeper = self._keeper
        if not self.guarding or keeper is None:
            return None
        if keeper.has_lapsed(self._clock.now_s()):
            items = (f"P{LOST}", f"P{OWNER}", watchdog_timer(self._dialect).name)
            lost, owner, watchdog = self._client.numbers(*items, timeout_s=PULSE_TIMEOUT_S, again=True)
            armed = not lost and owner == self._owner and watchdog > cycles_of(PERIOD_MS, self._i10)
            if not armed:
                raise self.lapse()
        return keeper

    def _send(self, line: str, timeout_s: float) -> None:
        """Send a renewal and query the echo with it: polls are already long for a slow line.

        A missing answer is not fatal: the next poll carries a renewal too.
        """
        asked_s = self._clock.now_s()
        self._echo.record_query(asked_s)
        try:
            (echo,) = self._client.request(f"{line} P{ECHO}", timeout_s, lines=1)
            self._echo.see(self._client.number(echo), asked_s)
        except LinkError as error:
            if is_gone(error):
                raise

    def _renew_watchdog(self, timeout_s: float) -> float:
        keeper = self._current_keeper()
        if keeper is None:
            return math.inf
        now_s = self._clock.now_s()
        if now_s >= min(keeper.due_s(now_s), self._echo.due_s):
            self._keeper = keeper = keeper.record_renewal(now_s)
            self._send(keeper.line, timeout_s)
        return min(keeper.due_s(now_s), self._echo.due_s)
