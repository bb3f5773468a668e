"""What may be applied: gains within the margins, no hidden mode to meet, and a filter that is safe if misread.

The margins are those of the sampled loop with the axis that is known and its delay (`profiles.axis.margins`).
Gains that give the loop more gain than it has need responses in which no flexible mode can hide that they would
make oscillate (`profiles.axis.loop_design`). A proposal asks for more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from console.session.tuning.known_loop import KnownLoop
from console.session.tuning.notch_evidence import misread
from drivers.identification.excitation import most_alone_hz
from drivers.identification.tool_gains import ToolLoop
from profiles.axis.loop_design import MOST_SETTINGS, softer, unseen_hz
from profiles.axis.margins import (
    LEAST_GAIN_MARGIN,
    LEAST_PHASE_MARGIN_DEG,
    MOST_SENSITIVITY,
    LoopMargins,
    loop_margins,
)
from profiles.axis.notch import MOST, SignConvention, is_coefficient
from profiles.axis.notch_design import fails_otherwise
from profiles.axis.sampled_loop import SampledLoop
from profiles.axis.servo_gains import PidGains, gains_from_variables, is_filter, with_variables
from profiles.machine import MachineProfile
from profiles.problem import Problem

SLOW_SWEEP = "--frequencies 25,30,40,50,60,70,80,95 --amplitude 50"
FAST_SWEEP = "--frequencies 60,75,90,105,120,135,150,165,180,195,210,225 --amplitude 35 --periods 60"
HIGH_SWEEP = "--frequencies 240,260,280,300,320,350,400,450,520,600,700,800,900 --amplitude 10 --periods 60"
"""What a design needs: two amplitudes, by which friction shows, and frequencies at which modes do; and what shows
modes above them."""


REACHED = 0.95  # of the highest frequency of a sine alone: softer gains need no other sweep


def bound_problems(
    machine: MachineProfile, read: ToolLoop, settings: Mapping[str, float], known: KnownLoop
) -> tuple[Problem, ...]:
    """Return why gains must not be applied to the loop that was read: their margins, with the limits, and modes.

    No mode is looked for where they are no more than those that were read, or those of the profile.

    Raises ProfileError: the profile lacks a gain.
    """
    if read.unmodelled_settings:
        return (Problem(code="trial.unmodelled", key=", ".join(read.unmodelled_settings)),)
    if beyond := tuple(_find_values_out_of_range(settings)):
        return beyond
    here = read.apply_to(machine)
    tuned = replace(known.loop, gains=gains_from_variables(with_variables(here, settings)))
    stated = replace(known.loop, gains=gains_from_variables(machine))
    hidden = () if softer(stated, tuned.gains) else hidden_problems(here, known, tuned)
    return *margin_problems(loop_margins(tuned)), *hidden


def filter_problems(
    machine: MachineProfile, read: ToolLoop, settings: Mapping[str, float], known: KnownLoop
) -> tuple[Problem, ...]:
    """Return why gains with a notch filter must not be applied, as long as no test has shown how it is read.

    One that is in the controller already may be applied with softer gains.

    Raises ProfileError: the profile lacks a gain.
    """
    gains = gains_from_variables(with_variables(read.apply_to(machine), settings))
    if not gains.notch or known.reading is SignConvention.STATED:
        return ()
    if gains.notch == known.loop.gains.notch and softer(known.loop, gains):
        return ()
    if known.reading is not None:
        names = misread(known.reading, machine.tool.motor)
        return (Problem(code="trial.other_reading", value=names),)
    if known.fit is None:
        return (unmeasured_problem(known),)
    if fails_otherwise(known.loop, gains, (known.fit.plant, *known.fit.others)) is None:
        return ()
    return (Problem(code="trial.notch_unsafe", value=", ".join(name for name in settings if is_filter(name))),)


def _find_values_out_of_range(settings: Mapping[str, float]) -> Iterator[Problem]:
    """Yield the first setting that is no value of its variable."""
    for name, value in settings.items():
        if is_filter(name):
            fits, limit = is_coefficient(value), f">= {-MOST:g}, < {MOST:g}"
        else:
            number = int(name[-2:])
            least, most = 0 if number in (32, 33) else 1, MOST_SETTINGS[number]
            fits, limit = least <= value <= most and float(value).is_integer(), f"{least}..{most}"
        if not fits:
            yield Problem(code="trial.range", key=name, value=f"{value:g}", limit=limit)
            return


def margins_with(
    machine: MachineProfile, read: ToolLoop, settings: Mapping[str, float], known: KnownLoop
) -> LoopMargins:
    """Return the margins of the loop that was read with other gains; ProfileError: the profile lacks a gain."""
    return loop_margins(
        replace(known.loop, gains=gains_from_variables(with_variables(read.apply_to(machine), settings)))
    )


def hidden_problems(here: MachineProfile, known: KnownLoop, tuned: SampledLoop) -> tuple[Problem, ...]:
    """Return why more gain may meet a flexible mode that nothing has shown; none for gains that are not more.

    `here` is the machine of the known loop, with its servo period.
    """
    return () if softer(known.loop, tuned.gains) else unseen_problems(here, known, tuned.gains)


def unseen_problems(here: MachineProfile, known: KnownLoop, gains: PidGains) -> tuple[Problem, ...]:
    """Return why gains may meet a flexible mode that nothing has shown, whatever the present ones are."""
    fit = known.fit
    if fit is None or not fit.holds:
        return (unmeasured_problem(known),)
    hz = unseen_hz(known.loop, gains, fit)
    if hz is None:
        return ()
    value, limit = f"{hz:.0f} Hz", f"{fit.hz.min():.4g} … {fit.hz.max():.4g} Hz"
    if swept_to_the_end(here, known):
        return (Problem(code="trial.unseen_above", key=HIGH_SWEEP, value=value, limit=limit),)
    return (Problem(code="trial.unseen", key=FAST_SWEEP, value=value, limit=limit),)


def swept_to_the_end(here: MachineProfile, known: KnownLoop) -> bool:
    """Whether responses reach about as high as a sine alone can."""
    return known.fit is not None and float(known.fit.hz.max()) >= REACHED * most_alone_hz(here)


def unmeasured_problem(known: KnownLoop) -> Problem:
    """Return that no response tells what the axis is, or that none of its models is what was measured."""
    fit = known.fit
    if fit is None:
        return Problem(code="trial.unmeasured", key=SLOW_SWEEP, value=FAST_SWEEP)
    if fit.denied:
        return Problem(code="trial.denied", where=f"{fit.hz.min():.4g} … {fit.hz.max():.4g} Hz")
    value, limit = f"{100 * fit.worst:.0f} %", f"<= {100 * fit.allowed:.0f} %"
    return Problem(code="trial.misfit", where=f"{fit.worst_hz:.4g} Hz", value=value, limit=limit)


def margin_problems(margins: LoopMargins) -> Iterator[Problem]:
    """Yield each margin that is less than is usual, with its limit."""
    if not margins.stable:
        yield Problem(code="trial.unstable")
        return
    gain, phase, reduction = margins.gain_margin, margins.phase_margin_deg, margins.gain_reduction
    if gain is None or gain < LEAST_GAIN_MARGIN:
        yield Problem(code="trial.gain_margin", value=_number(gain), limit=f">= {LEAST_GAIN_MARGIN:g}")
    if reduction is not None and reduction > 1.0 / LEAST_GAIN_MARGIN:
        limit = f"<= {1.0 / LEAST_GAIN_MARGIN:g}"
        yield Problem(code="trial.gain_reduction", value=_number(reduction), limit=limit)
    if phase is None or phase < LEAST_PHASE_MARGIN_DEG:
        value = _number(phase)
        yield Problem(code="trial.phase_margin", value=f"{value} deg", limit=f">= {LEAST_PHASE_MARGIN_DEG:g} deg")
    if margins.sensitivity_peak > MOST_SENSITIVITY:
        value, limit = f"{margins.sensitivity_peak:.3g}", f"<= {MOST_SENSITIVITY:g}"
        yield Problem(code="trial.sensitivity", value=value, limit=limit)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
