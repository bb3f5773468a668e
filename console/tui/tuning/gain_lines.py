"""Text of the proposed gains: settings and margins, present and proposed, how to use them, what they rest on."""

from __future__ import annotations

from console.session.trial.proposal import GainFacts
from console.text.catalogue import Catalogue
from console.tui.lines import Line, dim, fitted, hanging, line, to_the_right, wrapped
from console.tui.theme import Token
from profiles.axis.loop_design import DESIGN_GAIN_MARGIN, DESIGN_SENSITIVITY
from profiles.axis.margins import LEAST_PHASE_MARGIN_DEG, LoopMargins
from profiles.files import printable

LABEL_WIDTH, VALUE_WIDTH = 26, 14
DATE = len("2001-11-30 14:05")
NOTHING = "–"


def gain_proposal_lines(facts: GainFacts, text: Catalogue, width: int) -> list[Line]:
    """Return everything, the settings first: at 80 columns the last lines are in the list of messages."""
    found, plant = facts.proposal, facts.known.loop.plant
    date = printable(facts.known.date.replace("T", " ")[:DATE])
    of = text("tune_page.plant_measured", date=date) if date else text("tune_page.plant_profile")
    a, b = f"a {plant.acceleration_per_v:.4g} m/s2/V", f"b {plant.damping_per_s:.4g} 1/s"
    rests = hanging(dim("  "), f"{of}: {a}, {b}, {1000 * plant.delay_s:.3g} ms", width)
    asked = text(
        "tune_page.asked",
        gain=f"{DESIGN_GAIN_MARGIN:g}",
        phase=f"{LEAST_PHASE_MARGIN_DEG:g}",
        sensitivity=f"{DESIGN_SENSITIVITY:g}",
    )
    rests += hanging(dim("  "), asked, width, Token.DIM)
    if found is None:
        told = [line for problem in facts.reasons for line in wrapped(text.problem(problem), width, Token.WARNING)]
        return told + rests
    lines = [row for each in facts.notes for row in hanging(("· ", Token.WARNING), text.problem(each), width)]
    lines.append(_row("", text("tune_page.present"), text("tune_page.proposed"), head=True))
    for name, was, value in found.changes:
        lines.append(_row(name, f"{was:.11g}", f"{value:.11g}"))
    gains = found.gains.at_rest
    for key, value in (("kp", gains.kp_v_per_m), ("ki", gains.ki_v_per_m_s), ("kd", gains.kd_v_s_per_m)):
        unit = {"kp": "v_per_m", "ki": "v_per_m_s", "kd": "v_s_per_m"}[key]
        lines.append(_row(f"tool.gain_{key}_{unit}", "", f"{value:.4g}"))
    for key, before, after in _margins(found.before, found.after):
        lines.append(_row(text(f"tune_page.{key}"), before, after))
    lines += _stiffness_rows(facts, text)
    return [*lines, *hanging(("▶ ", Token.ACTION), text("tune_page.how_to_apply"), width), *rests]


def _margins(before: LoopMargins, after: LoopMargins) -> list[tuple[str, str, str]]:
    def shown(margins: LoopMargins) -> dict[str, str]:
        if not margins.stable:
            return {}
        values = {
            "gain_margin": (margins.gain_margin, ""),
            "phase_margin": (margins.phase_margin_deg, "°"),
            "delay_margin": (margins.delay_margin_ms, " ms"),
            "sensitivity": (margins.sensitivity_peak, ""),
            "bandwidth": (margins.bandwidth_hz, " Hz"),
        }
        return {key: f"{value:.3g}{unit}" for key, (value, unit) in values.items() if value is not None}

    keys = ("gain_margin", "phase_margin", "delay_margin", "sensitivity", "bandwidth")
    return [(key, shown(before).get(key, NOTHING), shown(after).get(key, NOTHING)) for key in keys]


def _stiffness_rows(facts: GainFacts, text: Catalogue) -> list[Line]:
    """Return how far a force pushes the tool, um/N, at most and at the lobe, and the friction that trips it."""
    if facts.stiffness is None:
        return []
    before, after = facts.stiffness
    lobe = text("tune_page.compliance_at", hz=f"{before.hz[0]:g}")
    return [
        _row(text("tune_page.compliance"), f"{before.most_um_per_n:.2f} um/N", f"{after.most_um_per_n:.2f} um/N"),
        _row(lobe, f"{before.um_per_n[0]:.2f} um/N", f"{after.um_per_n[0]:.2f} um/N"),
        _row(text("tune_page.trips"), f"{facts.trips_n[0]:.1f} N", f"{facts.trips_n[1]:.1f} N"),
    ]


def _row(label: str, present: str, proposed: str, *, head: bool = False) -> Line:
    values = to_the_right(present, VALUE_WIDTH), to_the_right(proposed, VALUE_WIDTH)
    return line(
        dim(f"  {fitted(label, LABEL_WIDTH)}"), dim(values[0]), (values[1], Token.DIM if head else Token.TEXT)
    )
