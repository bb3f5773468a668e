"""The heartbeat as a host keeps it: its PLC is on the card and alive, its lease is renewed while something moves.

When the host falls silent the card ends what moves by itself, as the policy says. A host that was held up for as
long as a lease asks the card first: a lease that has run out is not renewed, because what it guarded was ended.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from drivers.clock import Clock
from drivers.controller import REPLY_TIMEOUT_S, Controller
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.link.base import GONE
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.heartbeat.arming import forbidden, heartbeat_problems, permitted, silent
from drivers.pmac.heartbeat.keeper import LOSS_SEEN, NOTHING_GUARDED, EchoWatch, Keeper
from drivers.pmac.heartbeat.plc import OUT_LIMIT_MS, RUN_DOWN_MS, Policy, set_up_lines
from drivers.pmac.heartbeat.reading import PERMISSION, HeartbeatLook, read_heartbeat
from drivers.pmac.heartbeat.registers import ENDING
from drivers.pmac.heartbeat.watchdog import PERIOD_MS, cycles_of, watchdog_condition, watchdog_timer
from drivers.pmac.reserved import ECHO, LOST, OWNER
from profiles.machine import MachineProfile
from profiles.problem import Problem

NOT_OURS = frozenset({"heartbeat.plc_missing", "heartbeat.plc_differs", "heartbeat.definition_differs"})
"""What loading the heartbeat cures."""

SHORTEST_WAIT_S = 0.001

RATE = "heartbeat.lease_rate"
LAPSED = "heartbeat.lapsed"
"""The code of the problem that the card has ended a motion, because this host was silent."""

RENEWAL_TIMEOUT_S = 0.17
"""How long the answer to a renewal is waited for: behind it there has to be time for another one."""

PULSE_TIMEOUT_S = 0.3
PULSE_POLL_S = 0.01
"""How long the PLC may take to count on, and how often it is looked at, before anything moves."""

END_MARGIN_S = 1.0
"""What the card may take beyond the times that it waits for."""

RATE_READINGS = 3
"""How often the rate of the lease is looked at, before a card that is busy counts as one set otherwise."""


def cut_condition(machine: MachineProfile) -> str:
    """Return the condition without which a cutting program ends by itself; "" where it is to go on to its end."""
    finishes = Policy(machine.heartbeat.policy) is Policy.FINISH
    return "" if finishes else watchdog_condition(DIALECTS[machine.controller.family])


class Heartbeat:
    """The lease of one controller. It guards nothing before `prepare` has found everything in order."""

    def __init__(
        self,
        client: Controller,
        clock: Clock,
        machine: MachineProfile,
        policy: Policy | None = None,
        owner_seen: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Without a `policy` that of the machine profile is kept. `owner_seen` is told whose the machine is."""
        self._owner_seen = owner_seen
        self._client = client
        self._clock = clock
        self._machine = machine
        self._dialect = DIALECTS[machine.controller.family]
        self.policy = Policy(machine.heartbeat.policy) if policy is None else policy
        self._keeper: Keeper | None = None
        self._guarding = False
        self._i10 = 0.0
        self._owner = 0.0
        self._echo = EchoWatch()

    def prepare(self) -> None:
        """Make sure that the card would end a motion without a host; load its PLC where it is not there.

        Only with the drives off: nothing of it moves anything, but a PLC that is being exchanged guards nothing.

        Raises:
            RefusedError: everything that is not in order, `heartbeat.*`.
            LinkError: the link broke or is out of step.
        """
        self._keeper = None
        look, problems = self._looked()
        if any(problem.code in NOT_OURS for problem in problems):
            self._client.download(set_up_lines(self._machine, self._dialect, self.policy))
            look, problems = self._looked()
        if problems:
            raise RefusedError(*problems)
        self._i10 = look.i10
        self._keeper = Keeper(dialect=self._dialect, i10=look.i10)

    def problems(self) -> tuple[Problem, ...]:
        """Return what is not in order now with a heartbeat that was prepared; before that nothing is asked of it.

        Raises:
            LinkError: the link broke or is out of step.
        """
        return () if self._keeper is None else self._looked()[1]

    def jog(self, line: str) -> str:
        """Return a line that moves a motor, with its lease in front, to be sent at once."""
        keeper = self._begin()
        return f"{keeper.jog_line()} {line}"

    def cut(self, line: str, retracted_counts: float) -> str:
        """Return a line that starts a cut of the addressed system, with its lease and the way out in front."""
        keeper = self._begin()
        return f"{keeper.cut_line(retracted_counts, self._machine.heartbeat.grace_ms)} {line}"

    def renewal(self) -> str:
        """Return the lease, to be put in front of a line that is sent at once; "" when nothing is guarded.

        Raises:
            DriverError: `heartbeat.lapsed`, as for `pause`.
            LinkError: the link broke or is out of step.
        """
        keeper = self._kept()
        if keeper is None:
            return ""
        self._keeper = keeper.renewed(self._clock.now_s())
        return keeper.line

    @property
    def condition(self) -> str:
        """The condition without which a cutting program ends by itself; none where it is to go on to its end."""
        return "" if self.policy is Policy.FINISH else watchdog_condition(self._dialect)

    @property
    def ends_within_s(self) -> float:
        """How long the card may take to end a motion by itself; a cut that it lets go on has no such time."""
        if self.policy is Policy.FINISH:
            return math.inf
        return (self._machine.heartbeat.grace_ms + RUN_DOWN_MS + OUT_LIMIT_MS) / 1000.0 + END_MARGIN_S

    def is_ending(self) -> bool:
        """Ask the card whether it is about to end something.

        Raises:
            LinkError: the link broke or is out of step.
        """
        return bool(self._client.numbers(f"P{ENDING}", timeout_s=PULSE_TIMEOUT_S, again=True)[0])

    def pause(self, seconds: float, timeout_s: float = RENEWAL_TIMEOUT_S) -> None:
        """Let time pass, and renew the lease when it is due; an answer is waited for so long.

        Raises:
            DriverError: `heartbeat.lapsed`, this host was silent for so long that the card has ended the motion;
                nothing was renewed.
            LinkError: the link broke or is out of step.
        """
        end_s = self._clock.now_s() + seconds
        while True:
            due_s = self._renewed(timeout_s)
            now_s = self._clock.now_s()
            if now_s >= end_s:
                return
            self._clock.wait(max(min(end_s, due_s) - now_s, SHORTEST_WAIT_S))

    def lapse(self) -> DriverError:
        """Guard nothing any more, and return what has to be told: the card has ended what was guarded."""
        self._guarding = False
        return DriverError(Problem(code=LAPSED, where=self._client.link.address))

    def forgo(self) -> None:
        """Guard nothing: the line that was to be guarded was not sent, and the card was told nothing."""
        self._guarding = False

    @property
    def guarding(self) -> bool:
        """Whether something moves on a lease of this host."""
        return self._guarding

    @property
    def silent(self) -> Problem | None:
        """What is wrong with a PLC that does not guard what moves any more: `heartbeat.plc_silent`, or None."""
        return self._echo.problem if self._guarding else None

    def ended(self, timeout_s: float = REPLY_TIMEOUT_S) -> None:
        """What was guarded has come to its end; the lease may run out.

        Raises:
            DriverError: `heartbeat.lapsed`, the card has ended it before.
            LinkError: the link broke or is out of step; the card may not know it.
        """
        if not self._guarding:
            return
        self._client.request(NOTHING_GUARDED, timeout_s)
        self._guarding = False
        (lost,) = self._client.numbers(f"P{LOST}", timeout_s=timeout_s, again=True)
        if lost:
            raise DriverError(Problem(code=LAPSED, where=self._client.link.address))

    def loss_seen(self) -> None:
        """Take back the word that something was ended: an operator has seen it.

        Raises:
            LinkError: the link broke or is out of step.
        """
        self._client.request(LOSS_SEEN)

    def _looked(self) -> tuple[HeartbeatLook, tuple[Problem, ...]]:
        """Read the heartbeat, again where only the rate is off: a host that was held up sees a wrong one, too."""
        for _ in range(RATE_READINGS):
            look = read_heartbeat(self._client, self._clock, self._machine, self._dialect)
            problems = heartbeat_problems(look, self._machine, self._dialect, self.policy)
            if any(problem.code != RATE for problem in problems) or not problems:
                break
        return look, problems

    def _begin(self) -> Keeper:
        if self._keeper is None:
            raise RefusedError(Problem(code="heartbeat.not_prepared", where=self._client.link.address))
        self._refuse_silent()
        self._guarding, self._echo = True, EchoWatch()
        self._keeper = self._keeper.renewed(self._clock.now_s())
        return self._keeper

    def _refuse_silent(self) -> None:
        """Make sure that the PLC runs now: somebody may have switched it off since it was prepared.

        Raises:
            RefusedError: `heartbeat.plcs_forbidden`, `heartbeat.plc_silent`.
            LinkError: the link broke or is out of step.
        """
        items, end_s = (f"I{PERMISSION}", f"P{ECHO}", f"P{OWNER}"), self._clock.now_s() + PULSE_TIMEOUT_S
        permission, first, self._owner = self._client.numbers(*items, again=True)
        self._owner_seen(self._owner)
        if not permitted(permission):
            raise RefusedError(forbidden(permission))
        while self._client.numbers(*items, again=True)[1] == first:
            if self._clock.now_s() > end_s:
                raise RefusedError(silent(first, first))
            self._clock.wait(PULSE_POLL_S)

    def _watchdog_left(self) -> bool:
        """Ask the card whether it still waits for this host, with time enough for a renewal to come.

        Under another owner it is another's lease, whatever there is of it.
        """
        items = (f"P{LOST}", f"P{OWNER}", watchdog_timer(self._dialect).name)
        lost, owner, watchdog = self._client.numbers(*items, timeout_s=PULSE_TIMEOUT_S, again=True)
        return not lost and owner == self._owner and watchdog > cycles_of(PERIOD_MS, self._i10)

    def _kept(self) -> Keeper | None:
        """Return the keeper of what is guarded now, None when nothing is.

        Raises:
            DriverError: `heartbeat.lapsed`; nothing is guarded any more.
        """
        keeper = self._keeper
        if not self._guarding or keeper is None:
            return None
        if keeper.lapsed(self._clock.now_s()) and not self._watchdog_left():
            raise self.lapse()
        return keeper

    def _send(self, line: str, timeout_s: float) -> None:
        """Send a renewal, and ask for the echo with it: looks are too long for a slow line as they are.

        One whose answer does not come is no end yet: the next look, with a lease, is one.

        Raises:
            LinkError: the link is gone.
        """
        asked_s = self._clock.now_s()
        self._echo.asked(asked_s)
        try:
            (echo,) = self._client.request(f"{line} P{ECHO}", timeout_s, lines=1)
            self._echo.see(self._client.number(echo), asked_s)
        except LinkError as error:
            if any(problem.code in GONE for problem in error.problems):
                raise

    def _renewed(self, timeout_s: float) -> float:
        """Renew the lease if it or the echo is due; return when the next renewal is."""
        keeper = self._kept()
        if keeper is None:
            return math.inf
        now_s = self._clock.now_s()
        if now_s >= min(keeper.due_s(now_s), self._echo.due_s):
            self._keeper = keeper = keeper.renewed(now_s)
            self._send(keeper.line, timeout_s)
        return min(keeper.due_s(now_s), self._echo.due_s)
