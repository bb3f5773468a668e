"""Where jaw 1 is: seen at the simulated lathe, else by the angle that was found; small enough for 24 rows."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

from console.session.cut.jaw_by_indicator import between_deg
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, dim, line, width_of
from console.tui.pages.jog_lines import chuck_lines
from console.tui.theme import Token
from profiles.machine import MachineProfile

PICTURE_COLUMNS, BESIDE_COLUMNS, PICTURE_ROWS, LEAST_ROWS = 14, 14, 5, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class JawSeen:
    """Jaw 1 past the mark, degrees in the direction of the cut; `simulated` where it is seen, not computed.

    `angle_deg` is the spindle's, None before its index is known. `about`: it is judged by eye.
    """

    past_deg: float
    angle_deg: float | None
    simulated: bool
    about: bool = False

    @property
    def angle(self) -> str:
        """The angle of the spindle as it is shown."""
        return f"C {NOTHING}" if self.angle_deg is None else f"C {self.angle_deg:.2f}°"


def jaw_seen(state: StationState, machine: MachineProfile) -> JawSeen | None:
    """Return where jaw 1 is now; None where that is not known."""
    snapshot, jaw = state.snapshot, state.alignment.jaw
    if state.activity is Activity.LOST or snapshot is None:
        return None
    angle_deg = 360.0 * (snapshot.spindle.position / machine.spindle.counts_per_rev % 1.0)
    if state.simulated:
        past = None if state.seen is None else state.seen.jaw_1_past_mark_deg
    else:
        past = None if jaw is None or not snapshot.homed else between_deg(jaw.angle_deg, angle_deg)
    if past is None:
        return None
    about = state.seen is not None and state.seen.dials is not None
    known = "home_complete" in snapshot.spindle.flags
    return JawSeen(past_deg=past, angle_deg=angle_deg if known else None, simulated=state.simulated, about=about)


def picture_lines(text: Catalogue, seen: JawSeen | None, jaws: int, rows: int, width: int) -> list[Line]:
    """Return the chuck beside its figures, nothing where there is no room for it."""
    if seen is None or rows < LEAST_ROWS or width < PICTURE_COLUMNS + BESIDE_COLUMNS:
        return []
    drawn = chuck_lines(PICTURE_COLUMNS, min(rows, PICTURE_ROWS), jaws, seen.past_deg)
    beside: list[Line] = [
        line(seen.angle),
        line(
            text("align_page.jaw_at", angle=f"≈{seen.past_deg:+.0f}°" if seen.about else f"{seen.past_deg:+.2f}°")
        ),
        line(("◂ ", Token.MARK), dim(text("align_page.mark"))),
        line(("SIM", Token.SIM)) if seen.simulated else BLANK,
    ]
    pairs = zip_longest(drawn, beside[: len(drawn)], fillvalue=BLANK)
    return [(*ring, dim(" " * (PICTURE_COLUMNS + 1 - width_of(ring))), *words) for ring, words in pairs]
