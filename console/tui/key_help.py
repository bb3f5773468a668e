"""Keys as the screens write them, and the lists of `?` that say what each does."""

from __future__ import annotations

from console.session.appearance import OwnKeys
from console.text.catalogue import Catalogue
from console.tui.keymap import ACTIONS, CLOSE, NO_KEYS, Action, PageName, actions_of
from console.tui.lines import BLANK, Line, dim, fit_text, hanging, line
from console.tui.theme import Token

KEY_WIDTH = 8
LISTS = 2  # lists of keys


def written_key(key: str) -> str:
    """Return a letter or a function key as the screens write it: "q", "F10"."""
    return key.upper() if len(key) > 1 else key


def shown_key(action: Action, own: OwnKeys) -> str:
    """Return the keys of an action in the lists: an own one first, alone where both have no room."""
    mine = own.get(action.id)
    if mine is None:
        return action.shown
    both = f"{written_key(mine)} {action.shown}"
    return both if len(both) < KEY_WIDTH else written_key(mine)


def words_of(text: Catalogue, action: Action) -> str:
    """Return what the help says of an action; one without a row of its own has the words of the key before."""
    key = f"key_help.{action.id}"
    if not action.beside or text(key) != key:
        return text(key)
    before = ACTIONS[: ACTIONS.index(action)]
    return text(f"key_help.{next(each.id for each in reversed(before) if not each.beside)}")


def help_lines(text: Catalogue, page: PageName, number: int, width: int, own: OwnKeys = NO_KEYS) -> list[Line]:
    """Return the list `number`, from 1 to `LISTS`; a long sentence continues in the next row."""
    if number == 1:
        rows = [line((text(f"page.{page}"), Token.TITLE))]
        for action in actions_of(page):
            if not action.beside or action.id in own:
                rows += _row(shown_key(action, own), words_of(text, action), width)
        return [*rows, BLANK, line(dim(text("help.more")))]
    rows = [line((text("help.everywhere"), Token.TITLE))]
    for shown, said in (("Space", text("help.stop")), ("F9", text("help.kill")), ("", text("help.unbound"))):
        rows += _row(shown, said, width)
    for action in ACTIONS:
        if action.page is None and action is not CLOSE and (not action.beside or action.id in own):
            rows += _row(shown_key(action, own), words_of(text, action), width)
    return [*rows, line(dim(text("help.terms")))]


def _row(shown: str, said: str, width: int) -> list[Line]:
    return hanging((fit_text(shown, KEY_WIDTH), Token.KEY), said, width)


TERM_WIDTH = 17

TERMS = {
    page: tuple(names.split())
    for page, names in {
        PageName.JOBS: "lobe lobe_error ront lsc upr free overhang depth force",
        PageName.SETUP: "lobe lobe_error frequency overhang depth force margin window wrench",
        PageName.PREVIEW: "ront lsc free pvt cam timebase paper target command servo window",
        PageName.ALIGN: "verified clamped homed jaw mark indicator flank spread touch_off skim jog following "
        "travel stop_distance",
        PageName.RUN: "armed lobe tool_error following_run phase synchronised ripple target",
        PageName.INSPECT: "ront ronp lsc mzc mcc mic upr free harmonic from_jaw gain noise",
        PageName.RECORDS: "run ended ront chart cpk",
        PageName.TUNE: "gain_margin phase_margin delay_margin sensitivity bandwidth resonance rise settle trial",
        PageName.CALIBRATE: "wrench_line offset stiffness alpha residual",
        PageName.CONTROLLER: "status_bit status_poll query watch backup configuration_hash stop_performance",
        PageName.SCOPE: "gathering scope_error servo_output cursor trigger level deviation",
    }.items()
}
"""Terms of each page, explained by the third list of `?`; the words are `term.<name>` and `glossary.<name>`."""


def glossary_lines(text: Catalogue, page: PageName, width: int) -> list[Line]:
    """Return the terms of a page, one line each where the terminal is wide enough."""
    rows = [line((text("glossary.title", page=text(f"page.{page}")), Token.TITLE))]
    for term in TERMS.get(page, ()):
        rows += hanging((fit_text(text(f"term.{term}"), TERM_WIDTH), Token.KEY), text(f"glossary.{term}"), width)
    return [*rows, BLANK, line(dim(text("help.close")))]
