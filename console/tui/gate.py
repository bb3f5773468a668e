"""First decision about every key: a stop, a character of a field, or a key of the page; also held keys.

Pure, and used twice: in the thread that reads the terminal, which stops the machine without waiting for the
screen, and in the application, which does the rest.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from enum import Enum, auto

from textual._keyboard_protocol import FUNCTIONAL_KEYS, MODIFIER_FUNCTIONAL_KEYS

from console.session.appearance import OwnKeys
from console.session.station.state import Activity, StationState
from console.tui.keymap import (
    CLOSE,
    KILL_KEYS,
    PALETTE,
    READING,
    STOP_KEYS,
    TAKE,
    Action,
    PageName,
    StoppableMotion,
    action_of,
)

NUMBER_CHARACTERS = frozenset("0123456789+-.,")
FIELD_KEYS = frozenset({"backspace", "delete", "left", "right", "home", "end"})
LISTS = ("help", "messages")  # actions that open a list in place of the page, also during the entry of a number
UNREADABLE, PASTED, UNCONFIRMED = "unreadable", "paste", "unconfirmed"
"""Keys for terminal input that is no key, or perhaps another one: unbound, so that they stop any motion."""

UNCLEAR = {UNREADABLE: "screen.unreadable", UNCONFIRMED: "screen.unconfirmed"}
"""What is said at rest of input that does nothing."""

WRITTEN = {"pageup": "PgUp", "pagedown": "PgDn"}  # keys written otherwise than by their Textual names
INERT_KEYS = frozenset(MODIFIER_FUNCTIONAL_KEYS) | {
    name
    for name in FUNCTIONAL_KEYS.values()
    if name.startswith("media_") or name.endswith(("_lock", "_volume")) or name == "print_screen"
}
"""Keys that mean nothing to a machine, by the names that newer terminals report: modifiers, locks, media keys."""

SETTLED_S = 1.0  # time after the last command until a poll shows whether it causes motion
REPEAT_S = 0.8  # presses of one key that come sooner than this are the terminal's repeats of a held key


class FieldKind(Enum):
    """Focus of the keys: no field, a field of numbers, or one of free text."""

    NONE = auto()
    NUMBER = auto()
    TEXT = auto()


class KeyDecision(Enum):
    """Decision about a key."""

    STOP = auto()
    KILL = auto()
    FIELD = auto()
    ACTION = auto()
    NOTHING = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class KeySituation:
    """What a key is judged by. `small`: the terminal is too small for a page, nothing may be moved.

    `reading`: a list is in place of the page, and the keys that scroll it do nothing else. `jogging` is
    whether the motion is a jog step, `jog` the action that requested the last one. `at_rest`: it is known that
    nothing moves, nor is about to. `seeking`: the list is the palette, into which words are typed; its `field` is
    text only while it is known that nothing moves. `own` are the keys of the operator's own.
    """

    page: PageName
    field: FieldKind = FieldKind.NONE
    moving: bool = False
    small: bool = False
    reading: bool = False
    jogging: bool = False
    jog: str | None = None
    at_rest: bool = False
    seeking: bool = False
    own: OwnKeys = dataclasses.field(default_factory=dict)


def known_at_rest(state: StationState, now_s: float, acted_s: float, *, queued: bool) -> bool:
    """Whether nothing moves, nor will by a command of `acted_s` that the machine has not begun yet.

    `queued`: steps of a jog are still to be made.
    """
    if state.activity is Activity.CONNECTING:
        return True
    settled = now_s - acted_s > SETTLED_S and not state.is_stale(now_s)
    return settled and not (state.seen_moving or state.may_move or queued)


def stops_at_once(key: str, now: KeySituation) -> bool:
    """Return whether a key stops in any state: not Space in free text, nor Escape that closes a list at rest."""
    if key == "space":
        if now.seeking:
            return now.moving or now.small or not now.at_rest or now.field is not FieldKind.TEXT
        # Nothing can be typed while a list is open, so Space is no space there.
        return now.reading or now.field is not FieldKind.TEXT
    return key in STOP_KEYS and not _closes_list(key, now)


def judge(key: str, character: str | None, now: KeySituation) -> tuple[KeyDecision, Action | None]:
    """Return the decision about a key, with its action.

    While something moves, an unbound key is a stop, and so is an Alt-key, which may hide an Escape. A stop with an
    action is that of a key which requests another motion than the present one.
    """
    if stops_at_once(key, now):
        return KeyDecision.STOP, None
    if key in KILL_KEYS:
        return KeyDecision.KILL, None
    if _closes_list(key, now):
        return KeyDecision.ACTION, CLOSE
    if now.seeking:
        return _sought(key, character, now)
    if _writes(key, character, now.field) and not now.reading:
        return KeyDecision.FIELD, None
    action = _action(key, character, now)
    if action is not None:
        return (KeyDecision.STOP if _changes(action, now) else KeyDecision.ACTION), action
    if now.moving and not is_inert(key):
        return KeyDecision.STOP, None
    return KeyDecision.NOTHING, None


def _sought(key: str, character: str | None, now: KeySituation) -> tuple[KeyDecision, Action | None]:
    """Return the decision about a key while the palette is open: text or a choice; in motion every key stops."""
    if now.moving:
        return (KeyDecision.NOTHING if is_inert(key) else KeyDecision.STOP), None
    of_page = action_of(key, character, now.page, now.own)
    if not now.small:
        chosen = next((each for each in (*READING, TAKE) if key in each.keys), None)
        if chosen is not None:
            return KeyDecision.ACTION, chosen
        if key == "backspace" or (character is not None and character.isprintable()):
            return KeyDecision.FIELD, None
    everywhere = of_page is not None and of_page.page is None and not is_page(of_page)
    if everywhere and (not now.small or key == "ctrl+q"):
        return KeyDecision.ACTION, of_page
    return KeyDecision.NOTHING, None


def is_stray(key: str, character: str | None, now: KeySituation) -> bool:
    """Whether a typed character is no part of a number; it stays, for 1e3 without its e is another number."""
    printable = character is not None and character.isprintable()
    vanishes = key == "space" or judge(key, character, now)[0] is KeyDecision.NOTHING
    return now.field is FieldKind.NUMBER and not now.reading and printable and vanishes


def _action(key: str, character: str | None, now: KeySituation) -> Action | None:
    """Return the action of a key: of the open list or the page, and none that would interrupt a number."""
    if now.reading and (scrolling := next((each for each in READING if key in each.keys), None)):
        return scrolling
    action = action_of(key, character, now.page, now.own)
    if action is None or (now.small and action.id != "quit"):
        return None
    if action is PALETTE and now.field is not FieldKind.NONE:  # it has an entry of its own
        return None
    if now.field is not FieldKind.NONE and now.reading:
        return action if action.page is None and not is_page(action) else None
    printable = character is not None and character.isprintable()
    interrupts = action.page is None and action.id not in LISTS and printable
    return None if interrupts and now.field is FieldKind.NUMBER else action


def stop_reason(key: str, character: str | None, action: Action | None) -> str:
    """Return why a key stops the machine: its name, or a word for the reason and the key's written name."""
    if key in (*STOP_KEYS, *KILL_KEYS, UNREADABLE, PASTED):
        return key
    if key == UNCONFIRMED:
        return UNREADABLE
    if action is not None:
        return f"{'page' if is_page(action) else 'change'} {action.shown}"
    if "+" in key:  # with Alt or Ctrl, whatever character comes with it
        return f"unbound {key}"
    printed = character is not None and character.isprintable()
    return f"unbound {character if printed else WRITTEN.get(key, key.capitalize())}"


def is_page(action: Action) -> bool:
    """Whether an action shows a page."""
    return action.id.startswith("page.")


def is_inert(key: str) -> bool:
    """Whether a key means nothing to a machine, alone or with Shift, Ctrl or Alt."""
    return key.rpartition("+")[2] in INERT_KEYS


def _closes_list(key: str, now: KeySituation) -> bool:
    return key == "escape" and now.reading and now.at_rest and not now.moving and not now.small


def _changes(action: Action, now: KeySituation) -> bool:
    """Whether a key requests another motion than the present one, or leaves the page of a jog step."""
    if not now.moving or action.stops is StoppableMotion.NOTHING:
        return False
    if action.stops is StoppableMotion.JOG:
        return now.jogging and action.id != f"page.{now.page}"
    return not (now.jogging and action.id == now.jog)


def _writes(key: str, character: str | None, field: FieldKind) -> bool:
    if field is FieldKind.NONE:
        return False
    if key in FIELD_KEYS:
        return True
    if field is FieldKind.NUMBER:
        return character in NUMBER_CHARACTERS
    return character is not None and character.isprintable()


class HeldKeys:
    """Last time of each action, to detect held keys."""

    def __init__(self) -> None:
        self._pressed_s: dict[str, float] = {}

    def repeats(self, action: Action, now_s: float) -> bool:
        """Note a press, and return whether it repeats an action that is done once per press."""
        before_s = self._pressed_s.get(action.id, -math.inf)
        self._pressed_s[action.id] = now_s
        return action.once and now_s - before_s < REPEAT_S

    def note_typed_character(self) -> None:
        """Note a character of an entry: no key was held while it was typed, so the next Enter is a new press."""
        self._pressed_s.clear()
