"""What the screens do about keys that came too fast for a person, and about the code that they were."""

from __future__ import annotations

from collections.abc import Callable

from console.tui.application.scan_codes import job_named, shown
from console.tui.application.scan_collector import Scan
from console.tui.gate import PASTED
from console.tui.page import Page
from console.tui.ui_context import UiContext
from profiles.problem import Problem


class Scans:
    """Answers to bursts of keys, and to pasted text. `jobs` returns the page that opens a job, or refuses."""

    def __init__(self, ui: UiContext, jobs: Callable[[], Page]) -> None:
        self._ui, self._jobs = ui, jobs

    def pasted(self, *, moving: bool) -> None:
        """Say that pasted text does nothing outside an entry; it was not typed, and stops any motion."""
        self._ui.say_until_key(Problem(code="screen.pasted_stopped" if moving else "screen.pasted"))
        if moving:
            self._ui.stop(PASTED)

    def too_fast(self, *, written: bool, stopped: bool) -> None:
        """Say that keys were not taken, while it is not known yet what they are.

        A stop among keys that wrote into an entry has closed it: what the stop did is the answer to all of them.
        """
        if written and stopped:
            return
        code = "screen.too_fast_stopped" if stopped else "screen.too_fast"
        self._ui.say_until_key(Problem(code="screen.too_fast_entry" if written else code))

    def take(self, scan: Scan, *, small: bool) -> None:
        """Open the job of a code; say what any other code is, and that nothing was done."""
        name = job_named(scan.text)
        if scan.written:  # it stands in the entry, and is nobody's business elsewhere
            self.too_fast(written=True, stopped=scan.stopped)
        elif scan.stopped or small or name is None:
            code = "screen.scanned_stopped" if scan.stopped else "screen.scanned"
            self._ui.say_until_key(Problem(code=code, value=shown(scan.text)))
        else:
            self._ui.said = ()
            self._jobs().open_named(name)
