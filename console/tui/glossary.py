"""Terms of each page, explained by the third list of `?`; the words are `term.<name>` and `glossary.<name>`."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.tui.keymap import PageName
from console.tui.lines import BLANK, Line, dim, fit_text, hanging, line
from console.tui.theme import Token

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


def glossary_lines(text: Catalogue, page: PageName, width: int) -> list[Line]:
    """Return the terms of a page, one line each where the terminal is wide enough."""
    rows = [line((text("glossary.title", page=text(f"page.{page}")), Token.TITLE))]
    for term in TERMS.get(page, ()):
        rows += hanging((fit_text(text(f"term.{term}"), TERM_WIDTH), Token.KEY), text(f"glossary.{term}"), width)
    return [*rows, BLANK, line(dim(text("help.close")))]
