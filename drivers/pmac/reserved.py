"""The variables and PLCs of a controller that belong to the console; nothing else may use them.

They are above those that programs of the console calculate with (P11 to P94, P100 to P621), and exist in both
families. Besides them the heartbeat has P1006 to P1010, M71 and M1000 to M1014 (`heartbeat/watchdog.py`), on a
Turbo I5112 as a second timer; a cut on the spindle's time base has M199, one on a table the M-variable of the
tool's correction.
"""

from __future__ import annotations

HEARTBEAT_PLC = 20  # The PLC that ends jogs and cuts on a watchdog timeout

WITNESS_PLC = 21  # The PLC that witnesses a cut (`witness.py`)
PLCS = frozenset((HEARTBEAT_PLC, WITNESS_PLC))
WITNESS, WITNESS_POINTERS = range(971, 1000), range(1016, 1020)
"""P- and M-variables of the witness."""

STRATEGY_PROGRAMS = frozenset((1, 2, 3, 4))  # what the strategies load (`drivers.pmac.programs`)
PROGRAMS = STRATEGY_PROGRAMS | {998, 999}
"""Those and what identification and the commissioning tests write and erase."""

WATCHDOG_TIMER = 70
"""M-variable that points at a timer of the controller, where the family has none among its I-variables."""

END_FLAG = 26  # M-variable: 1 ends a cut at the end of its turn
OWNER = 1000  # P-variable: the console in control, a random number drawn by each console; 0 none
MARKER = 1001  # P-variable: a fresh number is written and read back to prove that link and host are in step again
ECHO = 1002  # P-variable: counted up by the heartbeat PLC in each of its scans
ACTIVITY = 1003  # P-variable: what the watchdog guards now, 0 nothing, 1 a jog, 2 a cut

LOST = 1004
"""P-variable: set by the heartbeat PLC when it has ended something, to the value of `ACTIVITY` at that time."""

RETRACTED = 1005  # P-variable: target of the tool when a cut is ended, counts of its motor

STOPPED_BY = 1011
"""P-variable: the number of a monitoring console that has stopped the machine; written after its stop."""

SIGNATURE = 1012
"""P-variables up to P1023: who controls the machine, in words (`drivers/lathe/ownership.py`)."""

OWN_VARIABLES = range(WITNESS.start, 1024)
"""P-variables: those, and those of the heartbeat and of the witness."""
