"""Trace chooser of the page Inspect: pick the file that a gauge has written, and answer what it does not state."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from textual.containers import Horizontal

from console.session.data.kept_files import newest_files
from console.session.data.learned_store import asked_for
from console.session.data.measured_part import CutPart, newest_part
from console.session.data.trace_folder import FOLDER, trace_folder
from console.session.learning.evaluated_part import QUESTIONS, EvaluatedPart, read_gauge_file
from console.session.learning.gauge_errors import error_in_use
from console.session.learning.provenance import of_this_part
from console.session.station.commands import MeasureTurned, TakeTrace
from console.session.station.state import StationState
from console.tui.entry import EntryLine
from console.tui.keymap import RowKey
from console.tui.lines import Line, Sheet, clip_lines, line, name_in
from console.tui.pages.trace_lines import KEYS, Choice, fact_lines, file_lines, next_words
from console.tui.records.background_reader import BackgroundReader, Problems
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.files import printable
from profiles.job import Job
from profiles.problem import Problem, ProfileError

Found = EvaluatedPart | tuple[Problem, ...]
ANSWERS = {
    "inspect.state": "state",
    "inspect.direction": "direction",
    "inspect.mark": "start_mark",
    "inspect.height": "z_from",
}
"""Question that an action answers."""

OPEN_KEYS = (
    RowKey(action="inspect.up", shown="↑↓", words="key.list.choose", doubled=True),
    RowKey(action="inspect.next", shown="Enter", words="key.list.take"),
    *(
        RowKey(action=action, shown=KEYS[question], words=f"trace_import.key.{question}")
        for action, question in ANSWERS.items()
    ),
    RowKey(action="inspect.together", shown="g", words="trace_import.key.together"),
    RowKey(action="inspect.path", shown="p", words="trace_import.key.path"),
    RowKey(action="inspect.import", shown="i", words="key.list.close"),
)

_ALWAYS = frozenset(
    f"inspect.{name}" for name in ("import", "path", "up", "down", "page_up", "page_down", "first", "last")
)

Changed = tuple[int, int]
"""When a file or a folder was changed, ns, and its size; zeros where it is gone."""

GONE: Changed = (0, 0)
Paths = tuple[Path, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceFolder:
    """What was found: the files, those of typed paths first, the others newest first, and when they were changed.

    `chosen` are those that were asked for. `problems`: why the folder can no longer be read. `part` is the newest
    one in the record at the first look.
    """

    folder: Path
    part: CutPart | None
    listed: Changed
    typed: tuple[Path, ...] = ()
    files: tuple[Path, ...] = ()
    dates_ns: Mapping[Path, int] = field(default_factory=dict)
    chosen: Paths = ()
    changed: tuple[Changed, ...] = ()
    problems: tuple[Problem, ...] = ()


class TraceListing:
    """Polls the folder while it is asked; each poll begins when the one before has ended."""

    def __init__(self, data: Path) -> None:
        self._data = data
        self._looks: BackgroundReader[TraceFolder] = BackgroundReader()
        self._checks: BackgroundReader[bool] = BackgroundReader()
        self._turn = self._check = 0
        self._last: TraceFolder | Problems | None = None

    def begin(self) -> None:
        """Forget what was seen: the list is opened."""
        self._turn, self._last = self._turn + 1, None

    def look(
        self, chosen: Paths, typed: Paths, part: Callable[[], CutPart | None]
    ) -> TraceFolder | Problems | None:
        """Return the newest poll; problems where nothing can be read at all, None before the first one."""
        before = self._last if isinstance(self._last, TraceFolder) else None
        question = (self._turn, chosen, typed)
        found = self._looks.answer(question, lambda: _poll_folder(self._data, before, chosen, typed, part))
        if found is not None:
            self._turn, self._last = self._turn + 1, found
        return self._last

    def check(self) -> None:
        """Begin to find out about a typed path."""
        self._check += 1

    def is_file(self, path: Path) -> bool | None:
        """Return whether there is a file at the typed path, None while that is found out."""
        found = self._checks.answer((self._check, path), path.is_file)
        return found if found is None else found is True


def _poll_folder(
    data: Path,
    before: TraceFolder | None,
    chosen: Paths,
    typed: Paths,
    part: Callable[[], CutPart | None],
) -> TraceFolder:
    """Poll once; the folder is listed again only where something in it has come or gone."""
    at = tuple(map(read_change_date, chosen))
    if before is None:
        folder = trace_folder(data)
        listed = read_change_date(folder)
        first = TraceFolder(folder=folder, part=part(), listed=listed, chosen=chosen, changed=at)
        return _with_files(first, typed, newest_files(folder))
    listed = read_change_date(before.folder)
    if listed == before.listed and typed == before.typed:
        return replace(before, chosen=chosen, changed=at)
    now = replace(before, listed=listed, chosen=chosen, changed=at, problems=())
    try:
        return _with_files(now, typed, newest_files(before.folder))
    except ProfileError as error:
        return _with_files(replace(now, problems=tuple(error.problems)), typed, ())


def _with_files(look: TraceFolder, typed: tuple[Path, ...], found: tuple[Path, ...]) -> TraceFolder:
    files = (*typed, *(each for each in found if each not in typed))
    return replace(look, typed=typed, files=files, dates_ns={each: read_change_date(each)[0] for each in files})


def read_change_date(path: Path) -> Changed:
    """Return when a file or a folder was changed, and its size."""
    try:
        status = os.stat(path)
    except OSError:
        return GONE
    return status.st_mtime_ns, status.st_size


class TraceChooser(Horizontal):
    """The files on the left, the selected one on the right. Nothing of it moves anything."""

    DEFAULT_CSS = """
    TraceChooser {
        height: 1fr;
        layers: base entry;
        #trace-files { width: 50%; height: 1fr; }
        #trace-facts { width: 1fr; height: 1fr; }
        #trace-path { width: 46%; offset: 2 1; }
    }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(id="trace-chooser")
        self._ui = ui
        self._files = Sheet(ui.palette, id="trace-files", classes="panel")
        self._facts = Sheet(ui.palette, id="trace-facts", classes="panel")
        self._entry = EntryLine(id="trace-path")
        self._reader: BackgroundReader[EvaluatedPart] = BackgroundReader(waits=False)
        self._listing = TraceListing(ui.data)
        self._typed: tuple[Path, ...] = ()
        self._checked: Path | None = None
        self._choice: Choice | None = None
        self._look: TraceFolder | None = None
        self._shown: object = None
        self.display = False

    def compose(self) -> list[Sheet | EntryLine]:
        """Return the panels."""
        return [self._files, self._facts, self._entry]

    @property
    def is_open(self) -> bool:
        """Whether the chooser is in the place of the page."""
        return self._choice is not None

    @property
    def is_typing(self) -> bool:
        """Whether a path is being typed."""
        return self._entry.is_open

    def open(self, *, turned: bool = False) -> None:
        """Show the files as they are now, or for a part `turned` on its gauge; read beside the screen."""
        self._listing.begin()
        self._choice = Choice(folder=self._ui.data / FOLDER, turned=turned)
        self._look = self._checked = self._shown = None

    def close(self) -> None:
        """Show the page again."""
        self._entry.close()
        self._choice = None

    @property
    def page_rows(self) -> int:
        """Rows that PgUp and PgDn go."""
        return max(self._files.size.height - 1, 1)

    def step(self, by: int) -> None:
        """Select another file."""
        if self._choice is not None and self._choice.files:
            selected = min(max(self._choice.selected + by, 0), len(self._choice.files) - 1)
            answers = self._choice.answers if self._choice.together else {}
            self._choice = replace(self._choice, selected=selected, answers=answers)

    def mark(self) -> None:
        """Read the selected file together with the marked ones, or no longer."""
        choice = self._choice
        if choice is not None and choice.file is not None:
            marked = frozenset((choice.file,))
            self._choice = replace(choice, together=choice.together ^ marked, answers={})

    def answer(self, action: str) -> None:
        """Step through the answers to a question that the file leaves open."""
        choice, key = self._choice, ANSWERS[action]
        if choice is None or not isinstance(choice.found, EvaluatedPart):
            return
        answers = QUESTIONS[key]
        given = choice.answers.get(key)
        following = answers[0 if given is None else (answers.index(given) + 1) % len(answers)]
        self._choice = replace(choice, answers={**choice.answers, key: following})

    @property
    def keys(self) -> tuple[RowKey, ...]:
        """The keys that can be used now: of the answers those that the file leaves open."""
        if self.is_typing:
            return tuple(each for each in OPEN_KEYS if each.action == "inspect.next")
        return tuple(each for each in OPEN_KEYS if not self.why_not(each.action))

    def why_not(self, action: str) -> tuple[Problem, ...]:
        """Return why a key cannot be used while the chooser is open."""
        choice, key = self._choice, ANSWERS.get(action, "")
        if choice is None or action in _ALWAYS or (action == "inspect.next" and self.is_typing):
            return ()
        if action == "inspect.together":
            return () if len(choice.files) > 1 else (Problem(code="trace.one_file"),)
        if action == "inspect.next":
            taken = isinstance(choice.found, EvaluatedPart) and choice.ready and self._ui.work is not None
            return () if taken else (Problem(code="trace.not_ready"),)
        if not key:
            return (Problem(code="screen.close_traces"),)
        stated = isinstance(choice.found, EvaluatedPart) and key not in choice.found.asked
        return (Problem(code="trace.stated", key=self._ui.text(f"trace_import.{key}")),) if stated else ()

    def type_path(self) -> None:
        """Open the entry of a path."""
        self._entry.begin()

    def take(self) -> None:
        """Take the typed path among the files, or the selected trace for the part."""
        choice = self._choice
        if choice is None:
            return
        if self.is_typing:
            self._take_path(choice)
            return
        work, found = self._ui.work, choice.found
        if work is None or not isinstance(found, EvaluatedPart):
            return
        loaded = None if work.edited else work.loaded
        take = TakeTrace(
            path=found.path,
            others=found.others,
            sha256=found.sha256,
            job=work.job,
            loaded=loaded,
            answers=dict(choice.answers),
        )
        self._ui.control.post(MeasureTurned(second=take) if choice.turned else take)
        self.close()

    def refresh_choice(self, view: View) -> None:
        """Bring the choice up to date with the machine and the reader, and paint what changed."""
        choice, work = self._choice, self._ui.work
        if choice is None:
            return
        self._entry.keep_focus()
        seen = self._with_files_of_now(choice)
        if seen is None:
            return
        choice = self._with_checked(seen)
        found = None if work is None else self._ask(choice, work.job, view.state)
        self._choice = choice = replace(choice, found=found, in_chuck=view.state.cut_done)
        shown = (choice, self.is_typing, self._files.size, self._facts.size)
        if shown != self._shown:
            self._shown = shown
            self._paint(choice)

    def next_step(self) -> Line:
        """Return what to do next."""
        assert self._choice is not None
        words = (
            self._ui.text("trace_import.next.path") if self.is_typing else next_words(self._choice, self._ui.text)
        )
        return line((words, Token.ACTION))

    def in_full(self, width: int) -> list[Line]:
        """Return all that is said of the selected file."""
        return [] if self._choice is None else fact_lines(self._choice, self._ui.text, width)

    def _with_files_of_now(self, choice: Choice) -> Choice | None:
        """Return the choice with the files of the newest poll; the selection stays on its file.

        None where nothing can be read: the answer says why, and the list is closed.
        """
        look = self._listing.look(choice.chosen, self._typed, self._part)
        if look is None or look is self._look:
            return choice
        if not isinstance(look, TraceFolder):
            self._ui.key_answer = look
            self.close()
            return None
        if look.problems and (self._look is None or look.problems != self._look.problems):
            self._ui.key_answer = look.problems
        self._look = look
        together = choice.together & frozenset(look.files)
        choice = replace(choice, listed=True, folder=look.folder, part=look.part, dates_ns=look.dates_ns)
        choice = replace(choice, together=together)
        if look.files == choice.files:
            return choice
        if choice.file in look.files:
            return replace(choice, files=look.files, selected=look.files.index(choice.file))
        return replace(choice, files=look.files, selected=0, answers={})

    def _with_checked(self, choice: Choice) -> Choice:
        """Return the choice with the file of a typed path, once it is known to be one; what is none is refused."""
        path = self._checked
        found = None if path is None else self._listing.is_file(path)
        if path is None or found is None:
            return choice
        self._checked = None
        if not found:
            self._ui.say("trace.unreadable", value=printable(str(path), 60))
            return choice
        self._typed = (path, *(each for each in self._typed if each != path))
        files = (path, *(each for each in choice.files if each != path))
        return replace(choice, files=files, selected=0, answers={})

    def _part(self) -> CutPart | None:
        """Return the newest part of the open job in the record; an edited job has none."""
        work = self._ui.work
        if work is None or work.edited:
            return None
        asked = asked_for(work.loaded, work.machine, "", simulated=self._ui.control.state.simulated)
        return newest_part(self._ui.data, asked)

    def _ask(self, choice: Choice, job: Job, state: StationState) -> Found | None:
        if choice.file is None:
            return None
        look = self._look
        if look is None or look.chosen != choice.chosen:
            return None  # it has just been selected
        data, (path, *others), answers = self._ui.data, choice.chosen, dict(choice.answers)
        simulated, part, machine = state.simulated, look.part, state.machine
        lathe = state.lathe if state.cut_done else "" if part is None else part.lathe
        run_id = None if part is None else part.run_id
        as_it_is = simulated or choice.turned  # a second placement is read with the error of its gauge

        def read() -> EvaluatedPart:
            how: dict[str, Any] = {"simulated": simulated, "lathe": lathe, "others": tuple(others)}
            error = error_in_use(data, machine, simulated=as_it_is)
            return of_this_part(read_gauge_file(path, job, answers, error=error, **how), data, run_id)

        asked = (
            choice.chosen,
            look.changed,
            job,
            tuple(sorted(answers.items())),
            simulated,
            as_it_is,
            lathe,
            run_id,
        )
        return self._reader.answer(asked, read)

    def _take_path(self, choice: Choice) -> None:
        typed = self._entry.close()
        if not typed:
            return
        path = Path(typed).expanduser()
        self._checked = path if path.is_absolute() else choice.folder / path
        self._listing.check()

    def _paint(self, choice: Choice) -> None:
        text, files, facts = self._ui.text, self._files.size, self._facts.size
        rows = file_lines(choice, text, max(files.width, 1), max(files.height, 1))
        if self.is_typing:
            rows = [(), *rows]
        self._files.show(rows[: max(files.height, 1)], text("trace_import.title", count=len(choice.files)))
        shown = printable(choice.file.name) if choice.file is not None else ""
        if choice.together:
            shown = text("trace_import.together", count=len(choice.together))
        name = name_in(shown, max(facts.width - 4, 1))
        rows = fact_lines(choice, text, max(facts.width, 1))
        self._facts.show(clip_lines(rows, facts.height, text("panel.more")), name)
