"""Key bindings, each defined once: action, pages, and whether it can move the machine.

A key is bound by its Textual name ("f5", "up") or, where it writes something, by its character, so that a Hangul
layout works, too: a letter has the jamo of its key beside it. No motion is on a letter or on Enter. Stop is no
ordinary binding: it is decided first, in `gate.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
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


class Stops(Enum):
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
    stops: Stops = Stops.NOTHING
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

_ACTIONS = (
    *(
        Action(id=f"page.{page}", keys=(digit,), shown=digit, stops=Stops.JOG, beside=page is PageName.ALARMS)
        for page, digit in DIGITS.items()
    ),
    Action(id="page.settings", keys=(), shown="0 s", beside=True),
    Action(id="page.log", keys=(), shown="0 l", beside=True),
    Action(id="page.train", keys=("9",), shown="9", beside=True),
    Action(id="page.tune", keys=(), shown="0 u", beside=True),
    Action(id="page.calibrate", keys=(), shown="0 c", beside=True),
    Action(id="page.controller", keys=(), shown="0 d", beside=True),
    Action(id="page.scope", keys=(), shown="0 o", beside=True),
    Action(id="recover", keys=("f2",), shown="F2"),
    Action(id="acknowledge", keys=("k", "ㅏ"), shown="k"),
    Action(id="take_over", keys=("t", "ㅅ"), shown="t", row="", once=True),
    Action(id="messages", keys=("w", "ㅈ"), shown="w", row=""),
    Action(id="help", keys=("?", "f1"), shown="?"),
    PALETTE,
    Action(id="quit", keys=("ctrl+q",), shown="^Q"),
    CLOSE,
    Action(id="jobs.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="jobs.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="jobs.open", keys=("enter",), shown="Enter"),
    Action(id="jobs.new", keys=("n", "ㅜ"), shown="n"),
    Action(id="jobs.copy", keys=("c", "ㅊ"), shown="c"),
    Action(id="jobs.search", keys=("/",), shown="/"),
    Action(id="jobs.sort", keys=("s", "ㄴ"), shown="s"),
    Action(id="jobs.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="jobs.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="jobs.first", keys=("home",), shown="Home", row="", beside=True),
    Action(id="jobs.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="jobs.back", keys=("left",), shown="←", row=""),
    Action(id="jobs.rename", keys=("r", "ㄱ"), shown="r", row=""),
    Action(id="jobs.note", keys=("e", "ㄷ"), shown="e", row=""),
    Action(id="jobs.tags", keys=("g", "ㅎ"), shown="g", row="", beside=True),
    Action(id="jobs.delete", keys=("d", "ㅇ"), shown="d", row="", once=True),
    Action(id="jobs.undo", keys=("u", "ㅕ"), shown="u", row="", beside=True),
    Action(id="jobs.import", keys=("i", "ㅑ"), shown="i", row=""),
    Action(id="jobs.path", keys=("p", "ㅔ"), shown="p", row="", beside=True),
    Action(id="jobs.export", keys=("x", "ㅌ"), shown="x", row=""),
    Action(id="setup.next", keys=("tab", "down"), shown="↓ Tab", row="↑↓"),
    Action(id="setup.previous", keys=("shift+tab", "up"), shown="↑", row=""),
    Action(id="setup.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="setup.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="setup.first", keys=("home",), shown="Home", row=""),
    Action(id="setup.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="setup.edit", keys=("enter",), shown="Enter"),
    Action(id="setup.undo", keys=("u", "ㅕ"), shown="u"),
    Action(id="setup.save_as", keys=("s", "ㄴ"), shown="s"),
    Action(id="preview.strategy", keys=("c", "ㅊ"), shown="c"),
    Action(id="preview.learned", keys=("l", "ㅣ"), shown="l"),
    Action(id="preview.response", keys=("i", "ㅑ"), shown="i"),
    Action(id="preview.stage", keys=("s", "ㄴ"), shown="s"),
    Action(id="preview.program", keys=("p", "ㅔ"), shown="p"),
    Action(id="preview.up", keys=("up", "pageup"), shown="↑", row="↑↓"),
    Action(id="preview.down", keys=("down", "pagedown"), shown="↓", row=""),
    Action(id="preview.first", keys=("home",), shown="Home", row=""),
    Action(id="preview.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="align.step", keys=("f4",), shown="F4", moves=True, once=True),
    Action(id="align.take", keys=("enter",), shown="Enter", once=True),
    Action(id="align.enable", keys=("j", "ㅓ"), shown="j"),
    Action(id="align.in", keys=("down",), shown="↓", row="", moves=True, stops=Stops.MOTION),
    Action(id="align.out", keys=("up",), shown="↑", row="↑↓", moves=True, stops=Stops.MOTION),
    Action(id="align.chuck", keys=("left",), shown="←", row="←→", moves=True, stops=Stops.MOTION),
    Action(id="align.tail", keys=("right",), shown="→", row="", moves=True, stops=Stops.MOTION),
    Action(id="align.forward", keys=("pageup",), shown="PgUp", row="PgUp/Dn", moves=True, stops=Stops.MOTION),
    Action(id="align.backward", keys=("pagedown",), shown="PgDn", row="", moves=True, stops=Stops.MOTION),
    Action(id="align.larger", keys=("+", "="), shown="+", row="+-", stops=Stops.JOG),
    Action(id="align.smaller", keys=("-",), shown="-", row="", stops=Stops.JOG),
    Action(id="align.goto", keys=("g", "ㅎ"), shown="g", row=""),
    Action(id="align.go", keys=("f6",), shown="F6", row="", moves=True, once=True),
    Action(id="align.flank", keys=("i", "ㅑ"), shown="i", row="", once=True),
    Action(id="align.skim", keys=("m", "ㅡ"), shown="m", row="", once=True),
    Action(id="align.clamping", keys=("n", "ㅜ"), shown="n", row=""),
    Action(id="align.force", keys=("f", "ㄹ"), shown="f", row=""),
    Action(id="align.hold", keys=("h", "ㅗ"), shown="h", row=""),
    Action(id="align.back", keys=("b", "ㅠ"), shown="b", row=""),
    Action(id="align.off", keys=("f3",), shown="F3", stops=Stops.MOTION),
    Action(id="run.arm", keys=("f5",), shown="F5", once=True),
    Action(id="run.start", keys=("f6",), shown="F6", moves=True, once=True),
    Action(id="run.feed_hold", keys=("f4",), shown="F4", moves=True, once=True),
    Action(id="run.one_turn", keys=("f10",), shown="F10", row="", moves=True, once=True),
    Action(id="run.hold", keys=("f7",), shown="F7", moves=True, once=True),
    Action(id="run.more", keys=("+", "="), shown="+", row="+-", moves=True),
    Action(id="run.less", keys=("-",), shown="-", row="", moves=True),
    Action(id="run.choose", keys=("a", "ㅁ"), shown="a", row=""),
    Action(id="run.retract", keys=("f8",), shown="F8", moves=True, once=True),
    Action(id="inspect.measure", keys=("m", "ㅡ"), shown="m"),
    Action(id="inspect.accept", keys=("a", "ㅁ"), shown="a", once=True),
    Action(id="inspect.revert", keys=("v", "ㅍ"), shown="v", once=True),
    Action(id="inspect.offset", keys=("o", "ㅐ"), shown="o", row="", once=True),
    Action(id="inspect.import", keys=("i", "ㅑ"), shown="i"),
    Action(id="inspect.next", keys=("enter",), shown="Enter"),
    Action(id="inspect.view", keys=("h", "ㅗ"), shown="h"),
    Action(id="inspect.beside", keys=("b", "ㅠ"), shown="b"),
    Action(id="inspect.circle", keys=("c", "ㅊ"), shown="c", row=""),
    Action(id="inspect.filter", keys=("f", "ㄹ"), shown="f", row=""),
    Action(id="inspect.larger", keys=("+", "="), shown="+ -", row=""),
    Action(id="inspect.smaller", keys=("-",), shown="-", row="", beside=True),
    Action(id="inspect.whole", keys=("z", "ㅋ"), shown="z", row=""),
    Action(id="inspect.export", keys=("x", "ㅌ"), shown="x", row=""),
    Action(id="inspect.up", keys=("up",), shown="↑", row="", stops=Stops.MOTION),
    Action(id="inspect.down", keys=("down",), shown="↓", row="", stops=Stops.MOTION, beside=True),
    Action(id="inspect.page_up", keys=("pageup",), shown="PgUp", row="", stops=Stops.MOTION),
    Action(id="inspect.page_down", keys=("pagedown",), shown="PgDn", row="", stops=Stops.MOTION, beside=True),
    Action(id="inspect.first", keys=("home",), shown="Home", row="", stops=Stops.MOTION),
    Action(id="inspect.last", keys=("end",), shown="End", row="", stops=Stops.MOTION, beside=True),
    Action(id="inspect.path", keys=("p", "ㅔ"), shown="p", row="", stops=Stops.MOTION),
    Action(id="inspect.state", keys=("s", "ㄴ"), shown="s", row="", stops=Stops.MOTION),
    Action(id="inspect.direction", keys=("d", "ㅇ"), shown="d", row="", stops=Stops.MOTION),
    Action(id="inspect.mark", keys=("j", "ㅓ"), shown="j", row="", stops=Stops.MOTION),
    Action(id="records.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="records.down", keys=("down",), shown="↓", row=""),
    Action(id="records.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="records.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="records.first", keys=("home",), shown="Home", row=""),
    Action(id="records.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="records.open", keys=("enter",), shown="Enter"),
    Action(id="records.back", keys=("left",), shown="←"),
    Action(id="records.chart", keys=("c", "ㅊ"), shown="c"),
    Action(id="records.mark", keys=("b", "ㅠ"), shown="b"),
    Action(id="records.search", keys=("/",), shown="/"),
    Action(id="records.failed", keys=("f", "ㄹ"), shown="f"),
    Action(id="records.job", keys=("j", "ㅓ"), shown="j", row=""),
    Action(id="records.machines", keys=("m", "ㅡ"), shown="m", row=""),
    Action(id="records.program", keys=("p", "ㅔ"), shown="p", row=""),
    Action(id="records.cut", keys=("e", "ㄷ"), shown="e", row=""),
    Action(id="records.figure", keys=("d", "ㅇ"), shown="d", row=""),
    Action(id="alarms.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="alarms.down", keys=("down",), shown="↓", row=""),
    Action(id="alarms.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="alarms.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="alarms.first", keys=("home",), shown="Home", row=""),
    Action(id="alarms.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="alarms.all", keys=("a", "ㅁ"), shown="a"),
    Action(id="alarms.log", keys=("l", "ㅣ"), shown="l"),
    Action(id="more.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="more.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="more.open", keys=("enter",), shown="Enter"),
    Action(id="more.settings", keys=("s", "ㄴ"), shown="s", row=""),
    Action(id="more.log", keys=("l", "ㅣ"), shown="l", row=""),
    Action(id="settings.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="settings.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="settings.change", keys=("enter",), shown="Enter"),
    Action(id="settings.next", keys=("right",), shown="→", row=""),
    Action(id="settings.previous", keys=("left",), shown="←"),
    Action(id="settings.remove", keys=("d", "ㅇ"), shown="d"),
    Action(id="settings.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="settings.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="settings.first", keys=("home",), shown="Home", row="", beside=True),
    Action(id="settings.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="log.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="log.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="log.search", keys=("/",), shown="/"),
    Action(id="log.export", keys=("x", "ㅌ"), shown="x"),
    Action(id="log.take", keys=("enter",), shown="Enter", row=""),
    Action(id="log.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="log.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="log.first", keys=("home",), shown="Home", row="", beside=True),
    Action(id="log.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="train.up", keys=("up",), shown="↑", row=""),
    Action(id="train.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="train.end", keys=("enter",), shown="Enter", once=True),
    Action(id="more.train", keys=("n", "ㅜ"), shown="n", row=""),
    Action(id="more.tune", keys=("u", "ㅕ"), shown="u", row=""),
    Action(id="more.calibrate", keys=("c", "ㅊ"), shown="c", row=""),
    Action(id="tune.view", keys=("v", "ㅍ"), shown="v"),
    Action(id="tune.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="tune.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="tune.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="tune.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="tune.first", keys=("home",), shown="Home", row=""),
    Action(id="tune.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="tune.read", keys=("r", "ㄱ"), shown="r"),
    Action(id="tune.kind", keys=("x", "ㅌ"), shown="x"),
    Action(id="tune.arm", keys=("f5",), shown="F5", once=True),
    Action(id="tune.start", keys=("f6",), shown="F6", moves=True, once=True),
    Action(id="tune.apply", keys=("a", "ㅁ"), shown="a", once=True),
    Action(id="tune.revert", keys=("b", "ㅠ"), shown="b", once=True),
    Action(id="calibrate.kind", keys=("v", "ㅍ"), shown="v"),
    Action(id="calibrate.view", keys=("p", "ㅔ"), shown="p"),
    Action(id="calibrate.up", keys=("up",), shown="↑", row="↑↓"),
    Action(id="calibrate.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="calibrate.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="calibrate.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="calibrate.first", keys=("home",), shown="Home", row=""),
    Action(id="calibrate.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="calibrate.new", keys=("n", "ㅜ"), shown="n"),
    Action(id="calibrate.take", keys=("enter",), shown="Enter", row=""),
    Action(id="calibrate.import", keys=("i", "ㅑ"), shown="i"),
    Action(id="calibrate.offset", keys=("o", "ㅐ"), shown="o", row=""),
    Action(id="calibrate.undo", keys=("u", "ㅕ"), shown="u", row=""),
    Action(id="calibrate.drop", keys=("d", "ㅇ"), shown="d", row="", once=True),
    Action(id="calibrate.keep", keys=("a", "ㅁ"), shown="a", once=True),
    Action(id="more.controller", keys=("d", "ㅇ"), shown="d", row=""),
    Action(id="more.scope", keys=("o", "ㅐ"), shown="o", row=""),
    Action(id="controller.left", keys=("left",), shown="←", row="←→"),
    Action(id="controller.right", keys=("right",), shown="→", row="", beside=True),
    Action(id="controller.up", keys=("up",), shown="↑", row=""),
    Action(id="controller.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="controller.page_up", keys=("pageup",), shown="PgUp", row=""),
    Action(id="controller.page_down", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="controller.first", keys=("home",), shown="Home", row=""),
    Action(id="controller.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="controller.enter", keys=("enter",), shown="Enter"),
    Action(id="controller.all", keys=("a", "ㅁ"), shown="a"),
    Action(id="controller.pause", keys=("p", "ㅔ"), shown="p"),
    Action(id="controller.repeat", keys=("r", "ㄱ"), shown="r", row=""),
    Action(id="controller.remove", keys=("x", "ㅌ"), shown="x", row=""),
    Action(id="controller.verify", keys=("v", "ㅍ"), shown="v", once=True),
    Action(id="controller.backup", keys=("b", "ㅠ"), shown="b", once=True),
    Action(id="controller.diff", keys=("f", "ㄹ"), shown="f", once=True),
    Action(id="controller.cancel", keys=("c", "ㅊ"), shown="c", row=""),
    Action(id="scope.up", keys=("up",), shown="↑", row=""),
    Action(id="scope.down", keys=("down",), shown="↓", row="", beside=True),
    Action(id="scope.more", keys=("enter", "+", "="), shown="Enter +", row="↑↓+-"),
    Action(id="scope.less", keys=("-",), shown="-", row="", beside=True),
    Action(id="scope.gather", keys=("g", "ㅎ"), shown="g", once=True),
    Action(id="scope.cancel", keys=("c", "ㅊ"), shown="c"),
    Action(id="scope.left", keys=("left",), shown="←", row="←→"),
    Action(id="scope.right", keys=("right",), shown="→", row="", beside=True),
    Action(id="scope.far_left", keys=("pageup",), shown="PgUp", row=""),
    Action(id="scope.far_right", keys=("pagedown",), shown="PgDn", row="", beside=True),
    Action(id="scope.first", keys=("home",), shown="Home", row=""),
    Action(id="scope.last", keys=("end",), shown="End", row="", beside=True),
    Action(id="scope.cursor", keys=("tab",), shown="Tab", row=""),
    Action(id="scope.channel", keys=("n", "ㅜ"), shown="n"),
    Action(id="scope.angle", keys=("v", "ㅍ"), shown="v"),
    Action(id="scope.keep", keys=("x", "ㅌ"), shown="x", once=True),
    Action(id="scope.list", keys=("o", "ㅐ"), shown="o"),
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
_JAMO = dict(
    zip("qwertyuiopasdfghjklzxcvbnm", "ㅂㅈㄷㄱㅅㅛㅕㅑㅐㅔㅁㄴㅇㄹㅎㅗㅓㅏㅣㅋㅌㅊㅍㅠㅜㅡ", strict=True)
)
"""What the key of each letter writes in a Hangul layout."""


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
