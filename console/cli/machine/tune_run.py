"""Actions of `console tune` on the gains of the tool: show the proposal, apply it on trial, revert."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict

from console.cli.library import data_of, refuse_unsigned
from console.cli.machine.card_access import Card, card_fields, card_line, with_control
from console.cli.output import show
from console.session.errors import SessionError
from console.session.trial.proposal import present_loop
from console.session.trial.standing import StandingTrial, listed
from console.session.trial.trial import TrialPlace, apply_trial, revert_trial, standing_trial
from console.text.catalogue import Catalogue
from profiles.axis.gain_proposal import GainProposal, proposed_gains, scaled_gains
from profiles.axis.margins import LoopMargins, loop_margins
from profiles.problem import Problem

LEAST_FACTOR, MOST_FACTOR = 0.4, 3.0


def _show(options: Namespace, card: Card, text: Catalogue) -> int:
    place = _place(options, card)
    found = _proposal(options, place)
    return _told(options, card, text, found, standing_trial(place, settle=False), [])


def _apply(options: Namespace, card: Card, text: Catalogue) -> int:
    place = _place(options, card)
    found = _proposal(options, place)
    if found is None:
        raise SessionError(Problem(code="screen.tune_no_proposal"))
    if not options.yes:
        return _told(options, card, text, found, standing_trial(place, settle=False), [text("tune.dry_run")])
    settings = {name: float(value) for name, value in found.settings.items()}
    with_control(card, lambda: apply_trial(place, settings, found.present))
    trial = standing_trial(place, settle=True)
    return _told(options, card, text, None, trial, [text("tune.applied", gains=listed(tuple(settings.items())))])


def _revert(options: Namespace, card: Card, text: Catalogue) -> int:
    place = _place(options, card)
    trial = standing_trial(place, settle=False)
    if trial is None:
        raise SessionError(Problem(code="trial.none", key=card.machine.name))
    if not options.yes:
        return _told(options, card, text, None, trial, [text("tune.dry_run")])
    with_control(card, lambda: revert_trial(place))
    return _told(options, card, text, None, None, [text("tune.reverted", gains=listed(trial.before))])


def _place(options: Namespace, card: Card) -> TrialPlace:
    if getattr(options, "yes", False) and not card.simulated:
        refuse_unsigned(card.machine)
    firmware = card.version, card.kind
    data = data_of(options)
    return TrialPlace(
        client=card.client, machine=card.machine, data=data, simulated=card.simulated, firmware=firmware
    )


def _proposal(options: Namespace, place: TrialPlace) -> GainProposal | None:
    """Return the proposal for the loop that was read: that with the margins asked for, or of a given factor."""
    here = place.gains.loop("").on(place.machine)
    loop, _ = present_loop(here, place.data, simulated=place.simulated)
    factor = options.factor
    if factor is None:
        return proposed_gains(here, loop)
    if not LEAST_FACTOR <= factor <= MOST_FACTOR:
        limit = f"{LEAST_FACTOR:g}..{MOST_FACTOR:g}"
        raise SessionError(Problem(code="trial.range", key="--factor", value=f"{factor:g}", limit=limit))
    return scaled_gains(here, loop, factor, loop_margins(loop))


def _told(
    options: Namespace,
    card: Card,
    text: Catalogue,
    found: GainProposal | None,
    trial: StandingTrial | None,
    last: list[str],
) -> int:
    show(
        options,
        lambda: {
            **card_fields(card),
            "proposal": None if found is None else _fields(found),
            "trial": None if trial is None else {**asdict(trial), "problems": [p.code for p in trial.problems]},
        },
        lambda: [card_line(card, text), "", *_lines(found, trial, text), *last],
    )
    return 0


def _fields(found: GainProposal) -> dict[str, object]:
    margins = {"before": asdict(found.before), "after": asdict(found.after)}
    return {"factor": found.factor, "present": found.present, "settings": found.settings, **margins}


def _lines(found: GainProposal | None, trial: StandingTrial | None, text: Catalogue) -> list[str]:
    lines = []
    if trial is not None:
        lines += [text.problem(problem) for problem in trial.problems]
    if found is not None:
        lines += [f"  {name}  {value:g} -> {found.settings[name]}" for name, value in found.present.items()]
        lines += [text("tune.margins", **_margins(margins, key)) for key, margins in _both(found, text)]
    return lines


def _both(found: GainProposal, text: Catalogue) -> tuple[tuple[str, LoopMargins], ...]:
    return (text("tune_page.present"), found.before), (text("tune_page.proposed"), found.after)


def _margins(margins: LoopMargins, which: str) -> dict[str, str]:
    def shown(value: float | None) -> str:
        return "-" if value is None or not margins.stable else f"{value:.3g}"

    return {
        "which": which,
        "gain": shown(margins.gain_margin),
        "phase": shown(margins.phase_margin_deg),
        "delay": shown(margins.delay_margin_ms),
        "sensitivity": shown(margins.sensitivity_peak),
    }


WORKS = {"show": _show, "apply": _apply, "revert": _revert}
