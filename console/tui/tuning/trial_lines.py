"""Text of gains on trial: what stands in the controller, and what a second press of a or b writes."""

from __future__ import annotations

from console.session.trial.standing import StandingTrial, listed
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, dim, fitted, hanging, line, to_the_right, wrapped
from console.tui.theme import Token
from console.tui.tuning.trial_keys import APPLY, AskedGains
from profiles.axis.servo_gains import shown_names
from profiles.files import printable

NAME_WIDTH, VALUE_WIDTH = 10, 14
DATE = len("2001-11-30 14:05")


def asked_lines(asked: AskedGains, text: Catalogue, width: int, left_s: float) -> list[Line]:
    """Return what the next press of the same key writes."""
    key = "apply" if asked.action == APPLY else "revert"
    first = text(f"tune_page.ask.{key}", seconds=f"{left_s:.0f}")
    lines = hanging(("▶ ", Token.ACTION), first, width, Token.ACTION)
    changes = [
        f"{name} {was:.11g} → {value:.11g}"
        for (name, was), (_, value) in zip(asked.before, asked.after, strict=True)
        if was != value
    ]
    lines += hanging(dim("  "), ", ".join(changes) or text("tune_page.ask.nothing"), width)
    return [*lines, *hanging(dim("  "), text("tune_page.ask.how"), width, Token.DIM), BLANK]


def trial_lines(trial: StandingTrial, text: Catalogue, width: int) -> list[Line]:
    """Return what was there before, what was applied, and what stands, where gains are on trial."""
    date, by = printable(trial.date.replace("T", " ")[:DATE]), printable(trial.by, 30)
    token = Token.WARNING
    heading = text("tune_page.on_trial" if trial.whole else "tune_page.trial_broken", date=date, by=by)
    lines = hanging(("! ", token), heading, width, token)
    if not trial.whole:
        lines += [row for each in trial.problems for row in wrapped(text.problem(each), width, token)]
    columns = (text("tune_page.before"), text("tune_page.applied"), text("tune_page.in_controller"))
    lines.append(line(dim(_row("", *columns))))
    before, proposed, found = dict(trial.before), dict(trial.proposed), dict(trial.found)
    for name in shown_names(before, proposed, found):
        other = found[name] not in (before[name], proposed[name])
        row = _row(name, *(f"{each[name]:.11g}" for each in (before, proposed, found)))
        lines.append(line((row, token if other else Token.TEXT)))
    return [*lines, BLANK]


def trial_warning(trial: StandingTrial, text: Catalogue, width: int) -> list[Line]:
    """Return the one sentence for the other views."""
    key = "tune_page.on_trial_short" if trial.whole else "tune_page.trial_broken_short"
    return hanging(("! ", Token.WARNING), text(key, names=listed(trial.found)), width, Token.WARNING)


def _row(name: str, *values: str) -> str:
    return fitted(f"  {name}", NAME_WIDTH) + "".join(to_the_right(value, VALUE_WIDTH) for value in values)
