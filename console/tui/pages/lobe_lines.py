"""Text of the panel Lobe: what a part cut without compensation says of the lobe of its job."""

from __future__ import annotations

from console.session.guide.measured_part import follows_lobe, is_taken
from console.session.learning.calibrating import PartLobe
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.lines import Line, hanging, wrapped
from console.tui.theme import Token
from profiles.calibration.lobe import FoundLobe

_MARK = ("! ", Token.WARNING)


def lobe_lines(lobe: PartLobe, work: Work | None, text: Catalogue, width: int) -> list[Line]:
    """Return the fitted lobe with its confidence, why the job cannot take it, and what to know before it does."""
    lines = _plain_lines(lobe, work, text, width)
    lines += [] if lobe.found is None else wrapped(_found_words(lobe.found, text), width)
    problems = (*lobe.reasons, *(() if lobe.found is None else lobe.found.warnings))
    for problem in problems:
        lines += hanging(_MARK, text.problem(problem), width, Token.WARNING)
    return lines


def _plain_lines(lobe: PartLobe, work: Work | None, text: Catalogue, width: int) -> list[Line]:
    """Return in plain words what the lobe is for, or that there is none."""
    if lobe.found is None or (lobe.reasons and not is_taken(lobe, work)):
        return wrapped(text("inspect_page.plain.no_lobe"), width, Token.STRONG)
    if is_taken(lobe, work) and work is not None:
        word = "lobe_taken" if follows_lobe(work) else "lobe_in_job"
        words = text(f"inspect_page.{word}", job=work.job.name, strategy=work.strategy)
        return wrapped(words, width, Token.STRONG)
    error = text.units.figure(lobe.found.fit.error_um_pp, "um", 1)
    return wrapped(text("inspect_page.plain.lobe", error=error), width, Token.STRONG)


def _found_words(found: FoundLobe, text: Catalogue) -> str:
    fit = found.fit
    error, ci, noise = (
        text.units.figure(each, "um", 2) for each in (fit.error_um_pp, 2 * fit.lobe.ci_um, fit.noise_um)
    )
    words = text("inspect_page.lobe", n=fit.jaws, error=error, ci=ci)
    if found.past_jaw_deg is not None:
        past = f"{found.past_jaw_deg:+z.1f}"
        words += " · " + text("inspect_page.lobe_at", past=past, ci=f"{fit.lobe.ci_deg:.1f}")
    return words + " · " + text("inspect_page.lobe_noise", noise=noise)
