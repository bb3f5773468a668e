"""What happens in a shift, as a list of events that a seed draws, and the shortest part of it that fails."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from random import Random

OPERATOR = ("set up", "home", "jog", "enable", "disable", "cut", "retract", "reset", "acknowledge", "stop")
"""What an operator does; each may come at a wrong moment, and is then refused."""

FAULTS = (
    "dropped-ack",
    "extra-line",
    "nul",
    "bare-bel",
    "late-reply",
    "split-segments",
    "hang",
    "cut-cable",
    "amplifier-fault",
    "encoder-loss",
    "index-lost",
    "limit",
    "following-error-trip",
    "spindle-ripple",
    "slow-background",
    "watchdog",
)
"""Of the catalogue of the simulator; none of them moves an axis by itself."""

OF_AXES = ("amplifier-fault", "encoder-loss", "index-lost", "limit", "following-error-trip")
AXES = ("tool", "spindle", "carriage")
LATEST_S, LONGEST_S = 12.0, 6.0


@dataclass(frozen=True, kw_only=True)
class Event:
    """`do` is an act of an operator, `fault`, `mend`, `restart` or `wait`.

    A fault `name` comes `after_s` from then on, in the middle of what is done next, and lasts `for_s` or until it
    is mended; `axis` and `amount` say of what and how much.
    """

    do: str
    name: str = ""
    axis: str = ""
    amount: float = 0.0
    after_s: float = 0.0
    for_s: float = 0.0


Script = tuple[Event, ...]


def drawn(random: Random) -> Event:
    """Draw what comes next."""
    kind = random.random()
    if kind < 0.30:
        name = random.choice(FAULTS)
        return Event(
            do="fault",
            name=name,
            axis=random.choice(AXES) if name in OF_AXES else "",
            after_s=round(random.uniform(0.0, LATEST_S), 3),
            for_s=round(random.choice((0.0, random.uniform(0.05, LONGEST_S))), 3),
        )
    if kind < 0.42:
        return Event(do="mend")
    if kind < 0.46:
        return Event(do="restart")
    if kind < 0.52:
        return Event(do="wait", amount=round(random.uniform(1.0, 120.0), 1))
    if kind < 0.80:
        return Event(do="work")
    do = random.choice(OPERATOR)
    after_s = round(random.uniform(0.0, LATEST_S), 3) if do == "stop" else 0.0
    axis = random.choice(AXES) if do == "jog" else ""
    return Event(do=do, axis=axis, amount=round(random.uniform(-2.0, 2.0), 3), after_s=after_s)


def as_text(script: Script) -> str:
    """Return a script, an event a line."""
    return "".join(f"{json.dumps({k: v for k, v in asdict(each).items() if v})}\n" for each in script)


def from_text(text: str) -> Script:
    """Return the script in a text."""
    return tuple(Event(**json.loads(line)) for line in text.splitlines() if line.strip())


# Shorten a script that fails to one of which no event can be left out (greedy delta debugging).


def shrunk(script: Script, fails: Callable[[Script], bool]) -> Script:
    """Return a part of the script, in its order, that still fails, and no longer does without any of its events.

    `fails` must hold for the script as it is. Whole pieces are left out first, then ever shorter ones.
    """
    size = max(1, len(script) // 2)
    while True:
        start, shorter = 0, False
        while start < len(script):
            part = script[:start] + script[start + size :]
            if part != script and fails(part):
                script, shorter = part, True
            else:
                start += size
        if size > 1:
            size //= 2
        elif not shorter:
            return script
