"""Pass changes of a running cut on to its program, between two polls, and note them in the record of the run."""

from __future__ import annotations

from dataclasses import replace

from console.session.data.made_parts import MadeWith
from console.session.station.adjusting.refusals import beyond, stepped
from console.session.station.commands import Adjust
from console.session.station.context import StationContext
from drivers.cutting.bounds import REAL_TIME, UNTRIMMED, Adjustable, Adjusted, Bounds, Changed, Trim
from drivers.cutting.cut_program import CutProgram
from drivers.errors import RefusedError
from profiles.problem import Problem


class Adjusting:
    """The changes of one cut. `changed_mm` is where the first was made, mm behind the face; None without any."""

    def __init__(self, context: StationContext, bounds: Bounds) -> None:
        self.changed_mm: float | None = None
        self._context, self._bounds = context, bounds
        self._last = Adjusted(bounds=bounds)
        self._applied = UNTRIMMED
        self._told: Problem | None = None

    @property
    def adjusted(self) -> Adjusted:
        """What was commanded, and the trim that the controller reports."""
        program = self._context.lathe.program
        return Adjusted(
            override_percent=program.override.commanded,
            trim=program.live_trim.asked,
            applied=program.live_trim.applied,
            bounds=self._bounds,
        )

    def pass_on(self) -> None:
        """Pass on what the operator has asked for, in the order of the presses, and note what was applied.

        Raises SessionError: `record.lost`. StoppedError, LinkError: as any command of a cut.
        """
        context = self._context
        while context.adjust_asked:
            self._pass_on(context.adjust_asked.popleft())
        self._note_applied(context.lathe.program)

    def _pass_on(self, asked: Adjust) -> None:
        context, program = self._context, self._context.lathe.program
        value = stepped(asked, self.adjusted.value_of(asked.what))
        refused = beyond(asked.what, value, self._bounds)
        if refused is not None:  # several presses between two polls
            self._refuse((refused,))
            return
        cut = context.state.cut
        z_mm = 0.0 if cut is None else cut.z_mm
        try:
            if asked.what is Adjustable.OVERRIDE:
                program.override.command(round(value))
            else:
                program.live_trim.ask(_with(program.live_trim.asked, asked.what, value))
        except RefusedError as error:  # another console controls the machine: nothing was sent
            self._refuse(tuple(error.problems))
            return
        if self.changed_mm is None:
            self.changed_mm = z_mm
        self._last = self.adjusted
        context.note("adjusted", what=asked.what.value, value=value, z_mm=z_mm)

    def _refuse(self, problems: tuple[Problem, ...]) -> None:
        self._context.log_refusal(problems)
        self._context.tell(refusals=problems)

    def _note_applied(self, program: CutProgram) -> None:
        trim = program.live_trim
        if trim.applied == trim.asked != self._applied:
            self._applied = trim.applied
            cut = self._context.state.cut
            z_mm = 0.0 if cut is None else cut.z_mm
            self._context.note(
                "trimmed", gain_percent=trim.applied.gain_percent, phase_deg=trim.applied.phase_deg, z_mm=z_mm
            )
        if trim.problem is not None and trim.problem != self._told:
            self._refuse((trim.problem,))
        self._told = trim.problem

    def made(self, made: MadeWith) -> MadeWith:
        """Return how the part was made, with what was changed while it was cut."""
        changed = self.changed
        return made if changed is None else replace(made, changed=_words(changed))

    @property
    def changed(self) -> Changed | None:
        """What was changed by now; None where nothing was."""
        if self.changed_mm is None:
            return None
        return Changed(override_percent=self._last.override_percent, trim=self._last.trim, from_mm=self.changed_mm)


def _with(trim: Trim, what: Adjustable, value: float) -> Trim:
    if what is Adjustable.GAIN:
        return replace(trim, gain_percent=value)
    return replace(trim, phase_deg=value)


def _words(changed: Changed) -> str:
    """Return the last values in the notation of the record, and from where on something was changed."""
    trim = changed.trim
    last = f"override {changed.override_percent} %, gain {trim.gain_percent:+g} %, phase {trim.phase_deg:+g} deg"
    return f"{last}, changed from Z {changed.from_mm:.1f} mm on"


def left_behind(context: StationContext) -> float | None:
    """Take over an override that was left on the controller, as by a lost link; return it, None for real time.

    A controller that is held (0 %) is not ours to release.
    """
    snapshot = context.state.snapshot
    if snapshot is None or not snapshot.at_rest or snapshot.override_percent < 1.0:
        return None
    percent = snapshot.override_percent
    if abs(percent - REAL_TIME) <= 0.5:
        return None
    context.lathe.program.override.commanded = round(percent)
    return percent
