"""Key bindings, each defined once: action, pages, and whether it can move the machine.

A key is bound by its Textual name ("f5", "up") or, where it writes something, by its character, so that a Hangul
layout works, too: a letter has the jamo of its key beside it. No motion is on a letter or on Enter. Stop is no
ordinary binding: it is decided first, in `gate.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum, auto
from functools import cache

from console.rings import is_installed
from console.session.appearance import OwnKeys

STOP_KEYS = ("space", "escape", "f12")
"""Space and F12 anywhere but in free text, where it is F12; Escape second: a terminal may lose it.

Escape closes the list of keys where one is open and nothing moves.
"""

KILL_KEYS = ("f9",)


class PageName(StrEnum):
    """Pages in order. `console.tui.pages.run` has the `RunPage`."""

    JOBS = "jobs"
    SETUP = "setup"
    PREVIEW = "preview"
    ALIGN = "align"
    RUN = "run"
    INSPECT = "inspect"
    RECORDS = "records"
    ALARMS = "alarms"
    MORE = "more"
    SETTINGS = "settings"
    LOG = "log"
    TRAIN = "train"
    TUNE = "tune"
    CALIBRATE = "calibrate"
    CONTROLLER = "controller"
    SCOPE = "scope"


NUMBERED = tuple(PageName)[: tuple(PageName).index(PageName.MORE)]
"""Pages with a digit of their own, which is their position, from 1."""

MODULES = {PageName.TRAIN: "console.school.page.train"}
"""Modules of the pages that stand elsewhere than those of the core."""

ABSENT = frozenset(page for page, module in MODULES.items() if not is_installed(module))

FURTHER = tuple(page for page in tuple(PageName)[tuple(PageName).index(PageName.MORE) + 1 :] if page not in ABSENT)
"""Pages that the page More (0) lists, and opens by their letter."""

_PAGES = {str(page): page for page in PageName}

DIGITS = {**{page: str(number) for number, page in enumerate(NUMBERED, start=1)}, PageName.MORE: "0"}


class StoppableMotion(Enum):
    """Kinds of motion that a key stops first, as a change of mind: none, a jog step, any."""

    NOTHING = auto()
    JOG = auto()
    MOTION = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """One action. `shown` is the key in the help, with the words `key_help.<id>` of the catalogues.

    The key row writes `row` where that differs, "" leaves the action out there, with the words `key.<id>`.
    `once`: holding the key down does it once. `stops`: the motion that the key stops. `beside`: the help names it
    in the words of the key before.
    """

    id: str
    keys: tuple[str, ...]
    shown: str
    row: str | None = None
    moves: bool = False
    once: bool = False
    stops: StoppableMotion = StoppableMotion.NOTHING
    beside: bool = False

    @property
    def page(self) -> PageName | None:
        """The page of the key, by which its id begins; None for a key of every page."""
        name, dot, _ = self.id.partition(".")
        return _PAGES.get(name) if dot else None


@dataclass(frozen=True, slots=True, kw_only=True)
class RowKey:
    """A key in the key row: its action, how it is written, and the key of its words in the catalogues.

    One of the operator's own is beside it where it is `doubled`, else in its place.
    """

    action: str
    shown: str
    words: str
    doubled: bool = False


CLOSE = Action(id="close", keys=("backspace",), shown="⌫")
PALETTE = Action(id="palette", keys=(":", "colon", "ctrl+p"), shown=": ^P", row="")

_JAMO = dict(
    zip("qwertyuiopasdfghjklzxcvbnm", "ㅂㅈㄷㄱㅅㅛㅕㅑㅐㅔㅁㄴㅇㄹㅎㅗㅓㅏㅣㅋㅌㅊㅍㅠㅜㅡ", strict=True)
)
"""What the key of each letter writes in a Hangul layout."""

_NAMES = {
    **{letter: (letter, jamo) for letter, jamo in _JAMO.items()},
    **{"↑": ("up",), "↓": ("down",), "←": ("left",), "→": ("right",), "PgUp": ("pageup",), "PgDn": ("pagedown",)},
    "+": ("+", "="),
}
"""Textual's names of the keys that are written otherwise, or have more than one."""


def _keys(
    page: str,
    *rows: str,
    moves: bool = False,
    once: bool = False,
    stops: StoppableMotion = StoppableMotion.NOTHING,
) -> Iterator[Action]:
    """Yield the actions of a page from the rows of its help, each "name key", with further ones after commas.

    After the key stands what the key row writes where that differs, "." for nothing. Further ones are `beside`.
    """
    for row in rows:
        for beside, (name, shown, *written) in enumerate(each.split() for each in row.split(", ")):
            yield Action(
                id=f"{PageName(page)}.{name}",
                keys=_NAMES.get(shown, (shown.lower(),)),
                shown=shown,
                row="" if beside or written == ["."] else written[0] if written else None,
                moves=moves,
                once=once,
                stops=stops,
                beside=beside > 0,
            )


_LETTERS = {
    **{PageName.SETTINGS: "0 s", PageName.LOG: "0 l", PageName.TRAIN: "9", PageName.TUNE: "0 u"},
    **{PageName.CALIBRATE: "0 c", PageName.CONTROLLER: "0 d", PageName.SCOPE: "0 o"},
}
"""Keys of the further pages; those of two are keys of the page More."""

_ACTIONS = (
    *(
        Action(
            id=f"page.{page}",
            keys=(digit,),
            shown=digit,
            stops=StoppableMotion.JOG,
            beside=page is PageName.ALARMS,
        )
        for page, digit in DIGITS.items()
    ),
    *(
        Action(id=f"page.{page}", keys=("9",) if shown == "9" else (), shown=shown, beside=True)
        for page, shown in _LETTERS.items()
    ),
    Action(id="recover", keys=("f2",), shown="F2"),
    Action(id="acknowledge", keys=("k", "ㅏ"), shown="k"),
    Action(id="take_over", keys=("t", "ㅅ"), shown="t", row="", once=True),
    Action(id="messages", keys=("w", "ㅈ"), shown="w", row=""),
    Action(id="help", keys=("?", "f1"), shown="?"),
    PALETTE,
    Action(id="quit", keys=("ctrl+q",), shown="^Q"),
    CLOSE,
    *_keys("jobs", "up ↑ ↑↓, down ↓", "open Enter", "new n", "copy c", "search /", "sort s"),
    *_keys("jobs", "page_up PgUp ., page_down PgDn, first Home, last End", "back ← .", "rename r ."),
    *_keys("jobs", "note e ., tags g"),
    *_keys("jobs", "delete d .", once=True),
    Action(id="jobs.undo", keys=("u", "ㅕ"), shown="u", row="", beside=True),
    *_keys("jobs", "import i ., path p", "export x ."),
    Action(id="setup.next", keys=("tab", "down"), shown="↓ Tab", row="↑↓"),
    Action(id="setup.previous", keys=("shift+tab", "up"), shown="↑", row=""),
    *_keys("setup", "page_up PgUp ., page_down PgDn", "first Home ., last End", "edit Enter", "undo u"),
    *_keys("setup", "save_as s"),
    *_keys("preview", "strategy c", "learned l", "response i", "stage s", "program p", "map m"),
    Action(id="preview.up", keys=("up", "pageup"), shown="↑", row="↑↓"),
    Action(id="preview.down", keys=("down", "pagedown"), shown="↓", row=""),
    *_keys("preview", "first Home ., last End"),
    *_keys("align", "step F4", moves=True, once=True),
    *_keys("align", "take Enter", once=True),
    *_keys("align", "enable j"),
    *_keys("align", "in ↓ .", "out ↑ ↑↓", "chuck ← ←→", "tail → .", moves=True, stops=StoppableMotion.MOTION),
    *_keys("align", "forward PgUp PgUp/Dn", "backward PgDn .", moves=True, stops=StoppableMotion.MOTION),
    *_keys("align", "larger + +-", "smaller - .", stops=StoppableMotion.JOG),
    *_keys("align", "goto g ."),
    *_keys("align", "go F6 .", moves=True, once=True),
    *_keys("align", "flank i .", "skim m .", once=True),
    *_keys("align", "clamping n .", "force f .", "hold h .", "back b ."),
    *_keys("align", "off F3", stops=StoppableMotion.MOTION),
    *_keys("run", "arm F5", once=True),
    *_keys("run", "start F6", "feed_hold F4", "one_turn F10 .", "hold F7", moves=True, once=True),
    *_keys("run", "more + +-", "less - .", moves=True),
    *_keys("run", "choose a ."),
    *_keys("run", "retract F8", moves=True, once=True),
    *_keys("inspect", "measure m", "turned r ."),
    *_keys("inspect", "accept a", "revert v", "offset o .", once=True),
    *_keys("inspect", "import i", "next Enter", "view h", "length l", "beside b .", "circle c .", "filter f ."),
    Action(id="inspect.larger", keys=("+", "="), shown="+ -", row=""),
    Action(id="inspect.smaller", keys=("-",), shown="-", row="", beside=True),
    *_keys("inspect", "whole z .", "export x .", "identify n ."),
    *_keys("inspect", "up ↑ ., down ↓", "page_up PgUp ., page_down PgDn", stops=StoppableMotion.MOTION),
    *_keys(
        "inspect", "first Home ., last End", "path p .", "state s .", "direction d .", stops=StoppableMotion.MOTION
    ),
    *_keys("inspect", "mark j .", "height e .", "together g .", stops=StoppableMotion.MOTION),
    *_keys("records", "up ↑ ↑↓", "down ↓ .", "page_up PgUp ., page_down PgDn", "first Home ., last End"),
    *_keys("records", "open Enter", "back ←", "chart c", "mark b", "search /", "failed f", "job j ."),
    *_keys("records", "machines m .", "program p .", "cut e .", "length l .", "figure d ."),
    *_keys("alarms", "up ↑ ↑↓", "down ↓ .", "page_up PgUp ., page_down PgDn", "first Home ., last End", "all a"),
    *_keys("alarms", "log l"),
    *_keys("more", "up ↑ ↑↓, down ↓", "open Enter", "settings s .", "log l ."),
    *_keys("settings", "up ↑ ↑↓, down ↓", "change Enter", "next → .", "previous ←", "remove d"),
    *_keys("settings", "page_up PgUp ., page_down PgDn, first Home, last End"),
    *_keys("log", "up ↑ ↑↓, down ↓", "search /", "export x", "take Enter ."),
    *_keys("log", "page_up PgUp ., page_down PgDn, first Home, last End"),
    *_keys("train", "up ↑ ., down ↓"),
    *_keys("train", "end Enter", once=True),
    *_keys("more", "train n .", "tune u .", "calibrate c ."),
    *_keys("tune", "view v", "up ↑ ↑↓, down ↓", "page_up PgUp ., page_down PgDn", "first Home ., last End"),
    *_keys("tune", "read r", "kind x"),
    *_keys("tune", "arm F5", once=True),
    *_keys("tune", "start F6", moves=True, once=True),
    *_keys("tune", "apply a", "revert b", once=True),
    *_keys("calibrate", "kind v", "view p", "up ↑ ↑↓, down ↓", "page_up PgUp ., page_down PgDn"),
    *_keys("calibrate", "first Home ., last End", "new n", "take Enter .", "import i", "offset o .", "undo u ."),
    *_keys("calibrate", "drop d .", "keep a", once=True),
    *_keys("more", "controller d .", "scope o ."),
    *_keys("controller", "left ← ←→, right →", "up ↑ ., down ↓", "page_up PgUp ., page_down PgDn"),
    *_keys("controller", "first Home ., last End", "enter Enter", "all a", "pause p", "repeat r .", "remove x ."),
    *_keys("controller", "verify v", "backup b", "diff f", once=True),
    *_keys("controller", "cancel c ."),
    *_keys("scope", "up ↑ ., down ↓"),
    Action(id="scope.more", keys=("enter", "+", "="), shown="Enter +", row="↑↓+-"),
    Action(id="scope.less", keys=("-",), shown="-", row="", beside=True),
    *_keys("scope", "gather g", once=True),
    *_keys("scope", "cancel c", "left ← ←→, right →", "far_left PgUp ., far_right PgDn", "first Home ., last End"),
    *_keys("scope", "cursor Tab .", "channel n", "angle v"),
    *_keys("scope", "keep x", once=True),
    *_keys("scope", "list o"),
)
ACTIONS: tuple[Action, ...] = tuple(each for each in _ACTIONS if ABSENT.isdisjoint(each.id.split(".")))

READING = (
    Action(id="list.up", keys=("up", "pageup"), shown="↑"),
    Action(id="list.down", keys=("down", "pagedown"), shown="↓"),
    Action(id="list.first", keys=("home",), shown="Home"),
    Action(id="list.last", keys=("end",), shown="End"),
)
"""Actions of these keys while a list is in place of the page, instead of those on the page."""

TAKE = Action(id="list.take", keys=("enter",), shown="Enter", once=True)
"""What Enter does in the palette: it shows the page of an action, or performs one that moves nothing."""

NO_KEYS: OwnKeys = {}
MOTION_PAGES = frozenset(action.page for action in ACTIONS if action.moves)
_BY_ID: Mapping[str, Action] = {action.id: action for action in ACTIONS}


def action_of(key: str, character: str | None, page: PageName, own: OwnKeys = NO_KEYS) -> Action | None:
    """Return the action of a key on a page, None where it has none; `own` keys are keys as well."""
    of_page = (action for action in ACTIONS if action.page in (None, page))
    found = next((action for action in of_page if key in action.keys or character in action.keys), None)
    if found is not None or not own:
        return found
    pressed = {key, *(letter for letter, jamo in _JAMO.items() if jamo in (key, character))}
    mine = (_BY_ID[name] for name, each in own.items() if each in pressed and name in _BY_ID)
    return next((action for action in mine if action.page in (None, page)), None)


@cache
def actions_of(page: PageName) -> tuple[Action, ...]:
    """Return the actions of one page alone."""
    return tuple(action for action in ACTIONS if action.page is page)


@cache
def row_keys(page: PageName) -> tuple[RowKey, ...]:
    """Return the keys that the row shows of a page."""
    return tuple(
        RowKey(
            action=action.id,
            shown=action.shown if action.row is None else action.row,
            words=f"key.{action.id}",
            doubled=bool(action.row),
        )
        for action in actions_of(page)
        if action.row != ""
    )
