"""Keys of the operator's own: an action gets one more key. What a key of ours means never changes.

Every message names our keys, and so does every manual and every colleague; therefore they stay what they are, and
an own key may only be one that is free where its action is.
"""

from __future__ import annotations

import re

from console.session.appearance import RESERVED_KEYS, OwnKeys
from console.text.catalogue import Catalogue
from console.tui.key_help import written_key
from console.tui.keymap import ACTIONS, CLOSE, KILL_KEYS, PALETTE, Action
from profiles.problem import Problem

REMAPPABLE = tuple(action for action in ACTIONS if action not in (CLOSE, PALETTE))
"""Actions that may have an own key; the stop keys are no actions, and in lists the keys are fixed."""

_KEY = re.compile(r"[a-z]|f(?:[1-9]|1[0-2])")


def why_not_key(action: Action, key: str, own: OwnKeys, text: Catalogue) -> tuple[Problem, ...]:
    """Return why an action cannot have this key, with the action that has it; empty where it can."""
    shown = written_key(key)
    if key in ("space", "escape", "esc", *KILL_KEYS, *RESERVED_KEYS):
        return (Problem(code="screen.own_key_stops", value=shown),)
    if _KEY.fullmatch(key) is None:
        return (Problem(code="screen.own_key_unknown", value=shown),)
    if action.moves and len(key) == 1:
        return (Problem(code="screen.own_key_moves", key=action_name(text, action), value=shown),)
    for other in ACTIONS:
        meets = action.page is None or other.page in (None, action.page)
        if other is not action and meets and key in (*other.keys, own.get(other.id)):
            names = action_name(text, action), action_name(text, other)
            return (Problem(code="screen.own_key_taken", key=names[0], value=shown, limit=names[1]),)
    return ()


def faults(own: OwnKeys, text: Catalogue) -> tuple[Problem, ...]:
    """Return what is wrong in own keys that were read from the configuration."""
    known = {action.id: action for action in REMAPPABLE}
    found: list[Problem] = []
    for name, key in own.items():
        if name not in known:
            found.append(Problem(code="screen.own_key_of_nothing", value=name))
        else:
            found += why_not_key(known[name], key, own, text)
    return tuple(found)


def action_name(text: Catalogue, action: Action) -> str:
    """Return an action as a message names it: its key, and its page where it is of one ("F5 on Run")."""
    return f"{action.shown} {text('help.everywhere') if action.page is None else text(f'page.{action.page}')}"
