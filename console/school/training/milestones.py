"""What a lesson may ask for: things that happen at the lathe, told from two states of the station in a row.

A milestone stays reached, whatever is lost again afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from console.session.stages import Stage
from console.session.station.state import Activity, StationState
from drivers.lathe.standing import Standing


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """Two states, one after the other; `stage` is that of the cut that was armed last.

    `answered` is whether the question of the lesson is.
    """

    before: StationState
    now: StationState
    stage: Stage | None = None
    answered: bool = False

    def ended(self, activity: Activity) -> bool:
        """Whether the station was busy with this, and is no longer."""
        return self.before.activity is activity is not self.now.activity


Reached = Callable[[Change], bool]
_CUT = "cut"  # of `CutStage`, which is not there for the first page


def _cut(stage: Stage) -> Reached:
    """Return whether a cut of this stage has come to its end."""

    def reached(change: Change) -> bool:
        cut, whole = change.now.cut, change.now.stop is None
        return (
            change.ended(Activity.CUTTING)
            and whole
            and change.stage is stage
            and cut is not None
            and cut.fraction >= 1.0
        )

    return reached


def _by_indicator(change: Change) -> bool:
    jaw = change.now.alignment.jaw
    return jaw is not None and jaw.spread_deg is not None


def _skimmed(change: Change) -> bool:
    touch_off = change.now.alignment.touch_off
    return touch_off is not None and touch_off.skimmed


def _in_cut(change: Change) -> bool:
    cut = change.now.cut
    return change.now.activity is Activity.CUTTING and cut is not None and cut.stage == _CUT


def _clamped_lighter(change: Change) -> bool:
    clamping, plain = change.now.alignment.clamping, change.now.uncompensated
    return clamping is not None and plain is not None and clamping.force_n < plain.job.chucking_force_n


def _measured_rounder(change: Change) -> bool:
    before, now = change.before.uncompensated, change.now.uncompensated
    if before is None or now is None or now is before:
        return False
    return now.result.ront_um < before.result.ront_um


def _acknowledged(change: Change) -> bool:
    new = [alarm for alarm in change.before.alarms if not alarm.acknowledged]
    return bool(new) and all(alarm.acknowledged for alarm in change.now.alarms)


MILESTONES: Mapping[str, Reached] = MappingProxyType(
    {
        "clamped": lambda change: change.now.alignment.clamping is not None,
        "drives_on": lambda change: change.now.alignment.drives_on,
        "homed": lambda change: change.now.alignment.homed,
        "jaw_found": lambda change: change.now.alignment.jaw is not None,
        "jaw_by_indicator": _by_indicator,
        "touched_off": lambda change: change.now.alignment.touch_off is not None,
        "skimmed": _skimmed,
        "armed": lambda change: change.now.armed is not None,
        "in_cut": _in_cut,
        "air_cut": _cut(Stage.AIR),
        "half_cut": _cut(Stage.PARTIAL),
        "full_cut": _cut(Stage.FULL),
        "measured": lambda change: change.now.measured is not None,
        "measured_plain": lambda change: change.now.uncompensated is not change.before.uncompensated,
        "held": lambda change: change.now.paused,
        "resumed": lambda change: change.before.paused and not change.now.paused and change.now.moving,
        "stopped": lambda change: change.now.stop is not None,
        "stopped_in_cut": lambda change: change.now.stop is not None and change.now.stop.of_cut,
        "retracted": lambda change: change.ended(Activity.RETRACTING) and change.now.stop is None,
        "recovered": lambda change: change.before.stop is not None and change.now.stop is None,
        "link_lost": lambda change: change.now.activity is Activity.LOST or change.now.lost_link is not None,
        "reconnected": lambda change: change.before.lost_link is not None and change.now.lost_link is None,
        "acknowledged": _acknowledged,
        "clamped_lighter": _clamped_lighter,
        "measured_rounder": _measured_rounder,
        "ousted": lambda change: change.now.standing is Standing.OUSTED,
        "control_back": lambda change: change.before.standing is not Standing.OWNER and change.now.controls,
        "answered": lambda change: change.answered,
    }
)
"""Every milestone by the name that lessons use, in the order in which they usually come."""
