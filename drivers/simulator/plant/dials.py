"""What a lathe shows to whoever stands before it: an indicator, what is heard, a current, a micrometer. No truth.

An indicator stands at the mark, its stylus at a fixed height: it touches a flank of a jaw that comes near, from
either side. The dial has backlash. Contact of the tool is heard a little late, and seen in the current of its
motor. A micrometer measures the part at the tool, while the spindle stands and the tool is clear of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.workshop_view import Dials, WorkshopView

STYLUS_RADIUS_MM = 50.0  # from the spindle axis
JAW_HALF_WIDTH_MM = 10.0
RANGE_UM = 500.0  # either way from 0
GRADUATION_UM = 2.0
BACKLASH_UM = 6.0
LATEST_HEARD_UM = 3.0  # depth of the tip at which contact is heard at the latest
MICROMETER_SD_UM = 2.0
MICROMETER_STEP_MM = 0.001
CLEAR_MM = 2.0  # between tool and part, for a hand with a micrometer
STANDS_TURNS = 1e-3  # moved between two looks
ABOUT_DEG = 5.0  # to which the place of a jaw is judged by eye
IDLE_PERCENT, CONTACT_PERCENT, NOISE_PERCENT = 3.0, 12.0, 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AtTheChuck:
    """What is so: the view with the truth, and the turns of the spindle.

    `diameter_mm` is the mean one of the clamped surface before the tool, None where there is no part; `tip_mm` is
    the radius of the tool tip.
    """

    view: WorkshopView
    jaws: int
    diameter_mm: float | None
    tip_mm: float
    turns: float


class ShopDials:
    """The dials of one lathe. They remember: an indicator its play, an ear and a micrometer their last reading."""

    def __init__(self, true: TrueParameters) -> None:
        self._chance = true.chance_of_part("dials")
        self._play_um: float | None = None
        self._heard_um = 0.0  # depth at which the present contact is heard
        self._met_mm: float | None = None  # radius of the surface before the tool, last seen clear of it
        self._turns = math.nan  # of the last look
        self._measured: tuple[float, float] | None = None  # diameter, and what was read of it

    def blind(self, now: AtTheChuck) -> WorkshopView:
        """Return what is seen and read without the truth."""
        view = now.view
        about_deg = round(view.jaw_1_past_mark_deg / ABOUT_DEG) * ABOUT_DEG
        depth_um = self._depth_um(now)
        dials = Dials(
            indicator_um=self._indicator_um(view.jaw_1_past_mark_deg, now.jaws),
            contact=depth_um is not None and depth_um >= self._heard_um,
            tool_current_percent=self._current_percent(depth_um or 0.0),
            micrometer_mm=self._micrometer_mm(now),
        )
        return replace(view, jaw_1_past_mark_deg=about_deg, tool_gap_mm=None, dials=dials)

    def _indicator_um(self, past_mark_deg: float, jaws: int) -> float | None:
        """Return the reading, positive pushed in; None while the stylus is free."""
        pitch_deg = 360.0 / jaws
        nearest_deg = math.remainder(past_mark_deg, pitch_deg)
        off_mm = abs(STYLUS_RADIUS_MM * math.sin(math.radians(nearest_deg)))
        pushed_um = 1000.0 * (JAW_HALF_WIDTH_MM - off_mm)
        if pushed_um < -RANGE_UM:
            self._play_um = None
            return None
        pushed_um = min(pushed_um, RANGE_UM)
        half = 0.5 * BACKLASH_UM
        before = pushed_um - half if self._play_um is None else self._play_um
        self._play_um = min(max(before, pushed_um - half), pushed_um + half)
        return GRADUATION_UM * round(self._play_um / GRADUATION_UM)

    def _depth_um(self, now: AtTheChuck) -> float | None:
        """Return how deep the tip is below the surface that it has met; None while it is clear of it.

        A part that it touches is worn away by the least turn of the spindle: what counts is where it was met.
        """
        gap_mm = now.view.tool_gap_mm
        if gap_mm is None or gap_mm > 0.0:
            self._met_mm = None if gap_mm is None else now.tip_mm - gap_mm
            self._heard_um = self._chance.uniform(0.0, LATEST_HEARD_UM)
            return None
        if self._met_mm is None:  # it came from beside the part
            self._met_mm = now.tip_mm - gap_mm
        return max(1000.0 * (self._met_mm - now.tip_mm), 0.0)

    def _current_percent(self, depth_um: float) -> float:
        grown = CONTACT_PERCENT * -math.expm1(-depth_um / 10.0)
        return round(max(IDLE_PERCENT + grown + self._chance.gauss(0.0, NOISE_PERCENT), 0.0), 1)

    def _micrometer_mm(self, now: AtTheChuck) -> float | None:
        """Return a reading of the diameter before the tool; the same until the part is another one there."""
        gap_mm = now.view.tool_gap_mm
        turning = not abs(now.turns - self._turns) < STANDS_TURNS
        self._turns = now.turns
        if turning or now.diameter_mm is None or gap_mm is None or gap_mm < CLEAR_MM:
            return None
        if self._measured is None or self._measured[0] != now.diameter_mm:
            read_mm = now.diameter_mm + self._chance.gauss(0.0, MICROMETER_SD_UM / 1000.0)
            self._measured = now.diameter_mm, round(read_mm / MICROMETER_STEP_MM) * MICROMETER_STEP_MM
        return round(self._measured[1], 3)
