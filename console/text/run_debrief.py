"""The debrief of a recorded run in sentences: the same for the command, the page Records and the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from console.session.data.run_rows import ENDS
from console.session.station.alarms import collision_problems
from console.text.catalogue import Catalogue
from console.text.part_sentences import along_words, place_words
from console.text.recorded_words import order_words, part_words
from profiles.files import printable
from profiles.metrology.conformity import ToleranceKind

if TYPE_CHECKING:
    from console.session.data.run_story import RunEvent
    from console.session.learning.run_debrief import Incident, RunDebrief
    from profiles.compensations.hypotheses import Explanation, FaultDiagnosis
    from profiles.metrology.length_causes import LengthCause

Section = tuple[str, list[str]]
"""A title with its sentences."""

LONGEST = 300
MOST_RATIO = 1000.0
CAUSES = "causes"  # of `Advice`
USUAL = "usual"  # of `LatheFault`, which takes numpy with it
LEAST_NAMED_UM = 0.05  # peak to peak, from which a height is not shown as 0.0
_AMOUNTS = {"angle": "+.1f", "drift": "+.1f", "force": "+.0f"}  # of the others without a sign, in whole numbers
_FORM: dict[tuple[ToleranceKind, bool | None], str] = {
    (ToleranceKind.ROUNDNESS, True): "round",
    (ToleranceKind.ROUNDNESS, False): "not_round",
    (ToleranceKind.CYLINDRICITY, False): "not_cylindrical",
}


def debrief_sections(debrief: RunDebrief, text: Catalogue) -> list[Section]:
    """Return the sections cost, next time, course, and gaps of the record."""
    ends = [told.event for told in debrief.happened if told.event is not None and told.event.kind in ENDS]
    ended = _event_words(ends[-1], text) if ends else text("records_page.ending.stopped")
    words = printable(ended, LONGEST)
    advice = [text(f"debrief.run.next.{each}", words=words) for each in debrief.advice]
    if debrief.diagnosis is not None and CAUSES in debrief.advice:
        place = [each.value for each in debrief.advice].index(CAUSES)
        advice[place] = text("diagnosis.first", test=_test_words(debrief.diagnosis, text))
    found = [
        ("cost", cost_words(debrief, text)),
        ("next", [*(text.problem(each) for each in debrief.worse), *advice]),
        ("happened", [incident_words(each, text) for each in debrief.happened]),
        ("unknown", [text.problem(each) for each in debrief.unknown]),
    ]
    return [(text(f"debrief.run.{name}"), rows) for name, rows in found if rows]


def cost_words(debrief: RunDebrief, text: Catalogue) -> list[str]:
    """Return the cost on the part: roundness with what may be wrong, and diameter."""
    part = debrief.part
    if part is None:
        return []
    rows, found = list[str](), debrief.diagnosis if part.passed is False else None
    likely, others = fault_words(found, debrief.along, text)
    for each in part.judged if part.passed is not None else ():
        if (key := _FORM.get((each.kind, each.passes))) is not None and each.value_um is not None:
            value, over = (text.units.figure(um, "um", 2) for um in (each.value_um, each.value_um - each.limit_um))
            limit, at = text.units.format_short(each.limit_um, "um"), place_words(each.z_mm, text)
            rows.append(text(f"debrief.run.{key}", value=value, limit=limit, over=over, at=at))
    rows += likely
    if rows and others:
        rows[-1] += f" {text('cause.title' if found is None else 'diagnosis.alone')}"
    rows += others
    if debrief.off_um is not None and part.diameter_tolerance_um is not None:
        off, most = (
            text.units.show(debrief.off_um, "um", 1, "+"),
            text.units.format_short(part.diameter_tolerance_um, "um"),
        )
        rows.append(text("debrief.run.diameter", value=off, limit=most))
    return rows


def fault_words(
    found: FaultDiagnosis | None, along: Sequence[LengthCause], text: Catalogue
) -> tuple[list[str], list[str]]:
    """Return the hypotheses in one sentence, none without any, and what else is on the part."""
    others = along_words(along, text)
    if found is None:
        return [], others
    for order, um in found.apart_um.items():
        others.append(text("diagnosis.apart", order=order, um=text.units.figure(um, "um", 1)))
    if found.noise_um is not None and not along:
        others.append(text("diagnosis.noise", um=text.units.figure(found.noise_um, "um", 1)))
    return [diagnosis_words(found, text)], others


def diagnosis_words(found: FaultDiagnosis, text: Catalogue) -> str:
    """Return the likeliest fault and the next; unless it is sure, what measurement would decide."""
    best, other = found.best, found.next
    ratio = f"{found.ratio:.{0 if found.sure else 1}f}" if found.ratio < MOST_RATIO else f"> {MOST_RATIO:.0f}"
    said = {"best": _fault_name(best, text), "next": _fault_name(other, text)}
    amounts = {each.fault.value: _amount(each) for each in found.ranked}
    if best.fault == USUAL:
        lobe = {"height": amounts.get("force"), "turn": amounts.get("angle")}
        said["best"] += f" ({text('diagnosis.lobe', **lobe)})" if all(lobe.values()) else ""
    else:
        share = "share" if best.um_pp >= LEAST_NAMED_UM else "no_share"
        said["best"] += f" ({text(f'diagnosis.{share}', um=text.units.figure(best.um_pp, 'um', 1))})"
    key = "diagnosis.sure" if found.sure else "diagnosis.open"
    return text(key, **said, ratio=ratio, parts=found.parts, test=_test_words(found, text))


def _fault_name(each: Explanation, text: Catalogue) -> str:
    return text(f"diagnosis.name.{each.fault}", amount=_amount(each))


def _amount(each: Explanation) -> str:
    return format(each.amount, _AMOUNTS.get(each.fault, ".0f"))


def _test_words(found: FaultDiagnosis, text: Catalogue) -> str:
    """Return the measurement that decides between the best and the next: that of the fault among them."""
    return text(f"diagnosis.test.{found.next.fault if found.best.fault == USUAL else found.best.fault}")


def diagnosis_fields(found: FaultDiagnosis | None) -> dict[str, object] | None:
    """Return a diagnosis as plain values."""
    if found is None:
        return None
    ranked = [
        {"fault": each.fault.value, "ln": each.log_likelihood, "um_pp": each.um_pp, "amount": each.amount}
        for each in found.ranked
    ]
    apart = [{"n": n, "um_pp": um_pp} for n, um_pp in found.apart_um.items()]
    named = {"best": found.best.fault.value, "next": found.next.fault.value, "parts": found.parts}
    return {**named, "ratio": found.ratio, "sure": found.sure, "ranked": ranked, "apart": apart}


def incident_words(told: Incident, text: Catalogue) -> str:
    """Return an incident with its time from the start."""
    if told.raised is not None:
        words = text("debrief.what.alarm", words=_case(text.problem(told.raised)))
    elif told.seen is not None:
        seen = text("debrief.what.seen", words=_case(text.problem(told.seen)))
        words = f"{seen} ({told.unseen_s:.0f} s)"
    else:
        words = "" if told.event is None else _event_words(told.event, text)
    sign = "-" if told.at_s < 0.0 else ""
    seconds = int(abs(told.at_s))
    return f"{sign}{seconds // 60}:{seconds % 60:02d}  {printable(words, LONGEST)}"


def _event_words(event: RunEvent, text: Catalogue) -> str:
    data = event.data
    match event.kind:
        case "command":
            return order_words(str(data.get("command", "")), text)
        case "stopped" | "ended":
            reason = str(data.get("reason", ""))
            told = text("records.how.killed") if reason == "killed" else text.reason(reason)
            stopped = event.kind == "stopped" or data.get("stopped")
            words = text("debrief.what.stop", words=told) if stopped else told
        case "collision":
            return text("debrief.what.met", words=_describe_collision(str(data.get("met", "")), text))
        case "fault":
            name = str(data.get("line", "")).split()[1:2]
            return text("debrief.what.fault", words=text(f"fault.{name[0]}") if name else "")
        case "measured" | "part":
            ront_um = data.get("ront_um")
            shown = f"{ront_um:.2f}" if isinstance(ront_um, int | float) else ""
            return _of_part(data, text, text("debrief.what.part", words=f"RONt {shown}"))
        case "step":
            return _of_part(data, text, text(f"step.{data.get('step', '')}"))
        case _:
            words = text(f"report.event.{event.kind}")
    turn = data.get("turn")
    known = isinstance(turn, int | float) and not isinstance(turn, bool)
    return f"{words} ({text('records.turn', turn=f'{turn:.1f}')})" if known else words


def _of_part(data: Mapping[str, Any], text: Catalogue, words: str) -> str:
    """Return the words, with the part before them if the run has several."""
    name = str(data.get("part") or "")
    if not name:
        return words
    return f"{part_words(name, text)}: {words}"


def _describe_collision(kind: str, text: Catalogue) -> str:
    try:
        return _case(text.problem(collision_problems([kind])[0]))
    except (KeyError, ValueError, IndexError):
        return kind


def _case(sentence: str) -> str:
    """Return the case without the remedy, which was for then."""
    return sentence.partition(";")[0]
