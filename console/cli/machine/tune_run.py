"""Actions of `console tune` on the gains of the tool: show the proposal, apply it on trial, revert."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import asdict

from console.cli.library import data_of, refuse_unsigned
from console.cli.machine.card_access import ConnectedController, card_fields, card_line, with_control
from console.cli.output import show
from console.session.errors import SessionError
from console.session.tuning.air_proof import stated_filter_problems
from console.session.tuning.known_loop import known_loop
from console.session.tuning.proposal import LOBE_HZ, GainFacts, gain_facts, with_figures
from console.session.tuning.standing_trial import StandingTrial, differing_words, format_gains
from console.session.tuning.trial import TrialPlace, air_doubts, apply_trial, revert_trial, standing_trial
from console.text.catalogue import Catalogue
from drivers.commissioning.checked_configuration import differing_settings
from drivers.identification.tool_gains import ToolLoop
from profiles.axis.loop_design import GainProposal, scaled_gains
from profiles.axis.margins import LoopMargins, loop_margins
from profiles.machine import MachineProfile
from profiles.problem import Problem

LEAST_FACTOR, MOST_FACTOR = 0.4, 3.0


def _show(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
    place = _place(options, card)
    trial, last = standing_trial(place, settle=False), list[str]()
    if trial is not None and trial.whole:
        kept = place.trial()
        doubts = () if kept is None else air_doubts(place, kept[1], dict(trial.found))
        last = [text.problem(problem) for problem in doubts] or [text("tune.proven")]
    if trial is None:
        found = stated_filter_problems(card.machine, place.data, place.firmware, simulated=place.simulated)
        last = [text.problem(problem) for problem in found]
    read = place.gains.loop("")
    differing = differing_settings(card.machine, read.gains)
    return _print_result(options, card, text, _proposal(options, place, read), trial, last, differing)


def _apply(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
    place = _place(options, card)
    facts = _proposal(options, place, place.gains.loop(""))
    found = facts.proposal
    if found is None:
        raise SessionError(*facts.reasons)
    if not options.yes:
        return _print_result(
            options, card, text, facts, standing_trial(place, settle=False), [text("tune.dry_run")]
        )
    settings = {name: float(value) for name, value in found.settings.items()}
    with_control(card, lambda: apply_trial(place, settings, found.present))
    trial = standing_trial(place, settle=True)
    return _print_result(
        options, card, text, None, trial, [text("tune.applied", gains=format_gains(tuple(settings.items())))]
    )


def _revert(options: Namespace, card: ConnectedController, text: Catalogue) -> int:
    place = _place(options, card)
    trial = standing_trial(place, settle=False)
    if trial is None:
        raise SessionError(Problem(code="trial.none", key=card.machine.name))
    if not options.yes:
        return _print_result(options, card, text, None, trial, [text("tune.dry_run")])
    with_control(card, lambda: revert_trial(place))
    return _print_result(
        options, card, text, None, None, [text("tune.reverted", gains=format_gains(trial.before))]
    )


def _place(options: Namespace, card: ConnectedController) -> TrialPlace:
    if getattr(options, "yes", False) and not card.simulated:
        refuse_unsigned(card.machine)
    firmware = card.version, card.kind
    data = data_of(options)
    return TrialPlace(
        client=card.client, machine=card.machine, data=data, simulated=card.simulated, firmware=firmware
    )


def _proposal(options: Namespace, place: TrialPlace, read: ToolLoop) -> GainFacts:
    """Return the design for the loop that was read, or the gains of a given factor."""
    factor, lobe_hz = options.factor, options.lobe or LOBE_HZ
    if factor is None:
        return gain_facts(
            place.machine, read, place.data, place.firmware, simulated=place.simulated, lobe_hz=lobe_hz
        )
    if not LEAST_FACTOR <= factor <= MOST_FACTOR:
        limit = f"{LEAST_FACTOR:g}..{MOST_FACTOR:g}"
        raise SessionError(Problem(code="trial.range", key="--factor", value=f"{factor:g}", limit=limit))
    here = read.apply_to(place.machine)
    known = known_loop(here, place.data, place.firmware, simulated=place.simulated)
    found = scaled_gains(here, known.loop, factor, loop_margins(known.loop))
    reasons = () if found is not None else (Problem(code="screen.tune_no_proposal"),)
    return with_figures(place.machine, GainFacts(proposal=found, known=known, reasons=reasons), lobe_hz)


def _print_result(
    options: Namespace,
    card: ConnectedController,
    text: Catalogue,
    facts: GainFacts | None,
    trial: StandingTrial | None,
    last: list[str],
    differing: Mapping[str, tuple[float, float]] | None = None,
) -> int:
    found = None if facts is None else facts.proposal
    show(
        options,
        lambda: {
            **card_fields(card),
            "proposal": None if found is None or facts is None else _fields(facts, found),
            "axis": None if facts is None else _axis_fields(facts),
            "reasons": [] if facts is None else [problem.code for problem in facts.reasons],
            "notes": [] if facts is None else [problem.code for problem in facts.notes],
            "differing": {name: {"profile": was, "found": now} for name, (was, now) in (differing or {}).items()},
            "trial": None if trial is None else {**asdict(trial), "problems": [p.code for p in trial.problems]},
        },
        lambda: [
            card_line(card, text),
            "",
            *_unlike(trial, differing, text),
            *_lines(card.machine, facts, trial, text),
            *last,
        ],
    )
    return 0


def _fields(facts: GainFacts, found: GainProposal) -> dict[str, object]:
    margins = {"before": asdict(found.before), "after": asdict(found.after)}
    if facts.stiffness is not None:
        for key, stiff, trips_n in zip(margins, facts.stiffness, facts.trips_n, strict=True):
            margins[key] |= {"stiffness": asdict(stiff), "tripping_friction_n": trips_n}
    return {"factor": found.factor, "present": found.present, "settings": found.settings, **margins}


def _axis_fields(facts: GainFacts) -> dict[str, object]:
    friction_n, off_n = facts.friction_n or (None, None)
    plant = asdict(facts.known.loop.plant)
    return {"date": facts.known.date, **plant, "friction_n": friction_n, "friction_ci_n": off_n}


def _unlike(
    trial: StandingTrial | None, differing: Mapping[str, tuple[float, float]] | None, text: Catalogue
) -> list[str]:
    """Return what is not as in the profile; gains on trial are named by their trial."""
    if not differing or (trial is not None and trial.whole):
        return []
    return [text("tune_page.differing", names=differing_words(differing))]


def axis_lines(machine: MachineProfile, facts: GainFacts, text: Catalogue) -> list[str]:
    """Return what the proposal rests on: the axis behind the responses, or that of the profile."""
    known, fit, friction = facts.known, facts.known.fit, facts.friction_n
    if fit is None or friction is None:
        return [text("tune.axis_profile")]
    plant = known.loop.plant
    mass = f"{machine.tool.loop_gain_n_per_v / plant.acceleration_per_v:.2f}"
    dry, delay = f"{friction[0]:.1f} ± {friction[1]:.1f}", f"{1000.0 * plant.delay_s:.2f}"
    lag = f"{1000.0 * plant.lag_s:.2f}"
    lines = [text("tune.axis", count=fit.hz.size, mass=mass, friction=dry, delay=delay, lag=lag)]
    for mode in plant.modes:
        hz, ratio = f"{mode.hz:.0f}", f"{100.0 * mode.damping_ratio:.1f}"
        lines.append(text("tune.mode", hz=hz, ratio=ratio, fraction=f"{mode.fraction:.2f}"))
    return lines


def _lines(
    machine: MachineProfile, facts: GainFacts | None, trial: StandingTrial | None, text: Catalogue
) -> list[str]:
    lines = [] if trial is None else [text.problem(problem) for problem in trial.problems]
    if facts is None:
        return lines
    lines += [f"  {each}" for each in axis_lines(machine, facts, text)]
    lines += [text.problem(problem) for problem in facts.reasons]
    lines += [text.problem(problem) for problem in facts.notes]
    found = facts.proposal
    if found is None:
        return lines
    lines += [f"  {name}  {was:.11g} -> {value:.11g}" for name, was, value in found.changes]
    margins = (text("tune_page.present"), found.before), (text("tune_page.proposed"), found.after)
    lines += [text("tune.margins", **_margins(each, name)) for name, each in margins]
    for key, stiff, trips_n in zip(("present", "proposed"), facts.stiffness or (), facts.trips_n, strict=False):
        at = ", ".join(f"{um:.2f} @ {hz:.4g} Hz" for hz, um in zip(stiff.hz, stiff.um_per_n, strict=True))
        name, most = text(f"tune_page.{key}"), f"{stiff.most_um_per_n:.2f}"
        lines.append(text("tune.stiffness", which=name, most=most, at=at, trips=f"{trips_n:.1f}"))
    return lines


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
