"""Recorded runs for people and for JSON: a list, and one run in full."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from datetime import datetime

from console.cli.library import data_of
from console.cli.measured.roundness_report import judged_rows
from console.cli.output import fields_of, show
from console.session.data.measured_part import SECTION_Z, RecordedPart
from console.session.data.run_facts import origin_facts, setup_facts
from console.session.data.run_reader import RunFilters, runs, story
from console.session.data.run_rows import MODEL, RunRow
from console.session.data.run_story import POLLED, RecordedTelemetry, RunEvent, RunStory
from console.text.along_length import form_words, section_rows, stretch_words
from console.text.catalogue import Catalogue
from console.text.columns import table, wrap_text
from console.text.part_sentences import at_height, place_words, verdict_words
from console.text.recorded_words import (
    Layout,
    ending_words,
    fact_rows,
    local,
    part_words,
    stage_words,
    strategy_words,
    timed_words,
)
from profiles.axis.response import ResponseSource
from profiles.files import printable
from profiles.metrology.cylindricity import cylinder_event
from profiles.metrology.unrolled import PROFILES
from profiles.strict_values import number_or_none

ID_DIGITS = 8
WIDTH = 78
INDENT = 2
FIGURES = ("ront_um", "tolerance_um", "passed", "diameter_mm", "nominal_diameter_mm", "diameter_tolerance_um")


def filters_of(options: Namespace) -> RunFilters:
    """Return the filters given by the arguments."""
    return RunFilters(
        job=options.job,
        machine=options.of_machine,
        since=options.since,
        until=options.until,
        failed=options.failed,
    )


def list_runs(options: Namespace, text: Catalogue) -> None:
    """Print the newest recorded runs that the options select."""
    data, limit = data_of(options), options.limit
    found = runs(data, filters_of(options), limit=limit + 1)
    shown, more = found[:limit], len(found) > limit
    show(
        options,
        lambda: {"runs": [_run_fields(row, options.lathes) for row in shown], "more": more},
        lambda: _list_lines(shown, more, options.lathes, text),
    )


def _run_fields(row: RunRow, lathes: Mapping[str, str]) -> dict[str, object]:
    return {**row_fields(row), **({"lathe": lathes[row.run_id]} if row.run_id in lathes else {})}


def _list_lines(shown: tuple[RunRow, ...], more: bool, lathes: Mapping[str, str], text: Catalogue) -> list[str]:
    if not shown:
        return [text("records.none")]
    lines = [line for row in shown for line in row_lines(row, text, lathes.get(row.run_id, ""))]
    return [text("records.head"), "", *lines, *(["", text("records.more", count=len(shown))] if more else [])]


def row_lines(row: RunRow, text: Catalogue, lathe: str = "") -> list[str]:
    """Return a run: a line with its id, and its result and cut below; nothing is cut off.

    `lathe` is named if the runs are of several.
    """
    sim = [text("sim")] if row.simulated else []
    head = "  ".join([row.run_id[:ID_DIGITS], local(row.started), *sim, row.job])
    ended = ending_words(row.ended, text, Layout.COMMAND)
    cylt = "" if row.cylt_um is None else f"CYLt {row.cylt_um:.2f} um"
    facts = [_result(row, text), cylt, ended, row.machine, strategy_words(row.strategy, text)]
    stage = stage_words(row.strategy, row.stage, text)
    facts += [each for each in (stage, _compensation(row, text), row.operator or "") if each]
    if lathe:
        facts.insert(3, text("records.of_lathe", name=lathe))
    if row.damaged:
        facts.append(text("records.damaged_row"))
    below = wrap_text(" · ".join(filter(None, facts)), WIDTH - INDENT)
    return [head, *(" " * INDENT + line for line in below)]


def _result(row: RunRow, text: Catalogue) -> str:
    """Return RONt of the least round section, where that is, and the verdict of the part."""
    if row.least_round_um is None:
        return text("records.not_measured") if row.cylt_um is None else text("records.no_roundness")
    result = f"RONt {row.least_round_um:.2f} um{place_words(row.worst_z_mm, text)}"
    if row.tolerance_um is None:
        return result
    unjudged = f"records.{'not_proven' if not row.proven else 'unproven' if row.unproven else 'not_judged'}"
    failed = "records.failed" if row.least_round_um > row.tolerance_um else "records.failed_elsewhere"
    verdict = {True: "records.passed", False: failed, None: unjudged}[row.passed]
    return text(verdict, result=result, limit=f"{row.tolerance_um:g}")


def _compensation(row: RunRow, text: Catalogue) -> str:
    if row.compensation is None or row.compensation == MODEL:
        kind = text(f"response.{ResponseSource.IDENTIFIED}")
        return "" if row.inverted is None else f"{kind} {printable(row.inverted, 60)}"
    return text("records.version", version=row.compensation)


def row_fields(row: RunRow) -> dict[str, object]:
    """Return a run for JSON; dates are UTC, null is not recorded."""
    return {
        "run": row.run_id,
        "started": row.started.isoformat(),
        **fields_of(row, "job", "machine", "simulated", "operator", "strategy", "stage", "compensation"),
        "inverted": row.inverted,
        "ended": asdict(row.ended),
        **fields_of(row, *FIGURES, "failed", "proven", "damaged"),
        "CYLt_um": row.cylt_um,
        "worst_RONt_um": row.least_round_um,
        "worst_z_mm": row.worst_z_mm,
    }


def show_run(options: Namespace, text: Catalogue) -> None:
    """Print one run in full."""
    found = story(data_of(options), options.run)
    lathe = options.lathes.get(found.row.run_id, "")
    of_lathe = {"lathe": lathe} if lathe else {}
    show(options, lambda: {**story_fields(found), **of_lathe}, lambda: _story_lines(found, text, lathe))


def debrief_run(options: Namespace, text: Catalogue) -> None:
    """Print what a run cost, why, and what to do next time; as JSON with codes beside the sentences."""
    from console.session.learning.run_debrief import run_debrief
    from console.text.run_debrief import debrief_sections, diagnosis_fields, incident_words

    data = data_of(options)
    found = story(data, options.run)
    debrief = run_debrief(found, data)
    sections = debrief_sections(debrief, text)
    facts = table(fact_rows(setup_facts(found), text, Layout.COMMAND))
    told = [line for title, rows in sections for line in ("", title, *_indent_lines(rows))]
    show(
        options,
        lambda: {
            **row_fields(found.row),
            "setup": found.setup,
            "diagnosis": diagnosis_fields(debrief.diagnosis),
            "next": [each.value for each in debrief.advice],
            "happened": [{"at_s": each.at_s, "text": incident_words(each, text)} for each in debrief.happened],
            "unknown": [each.code for each in debrief.unknown],
            "text": dict(sections),
        },
        lambda: [*row_lines(found.row, text), *(["", *facts] if facts else []), *told],
    )


def story_fields(found: RunStory) -> dict[str, object]:
    """Return a run in full for JSON; of traces and telemetry only their sizes."""
    return {
        **row_fields(found.row),
        **fields_of(found, "software", "python", "controller", "family", "job_sha256", "machine_sha256", "setup"),
        "parts": [_part_fields(part) for part in found.parts],
        "commands": [_event_fields(each) for each in found.commands],
        "alarms": [
            {
                **asdict(each.problem),
                "priority": each.priority,
                **{stamp: _iso(getattr(each, stamp)) for stamp in ("raised", "acknowledged", "ended")},
            }
            for each in found.alarms
        ],
        "events": [_event_fields(each) for each in found.events],
        "telemetry": [
            {"part": each.part, "kind": each.kind, "columns": list(each.columns), "rows": len(each.rows)}
            for each in found.telemetry
        ],
        "complete": found.complete,
        "damaged_parts": list(found.damaged),
        **fields_of(found, "job_text", "machine_text", "program"),
    }


def _part_fields(part: RecordedPart) -> dict[str, object]:
    return {
        "at": part.at.isoformat(),
        **fields_of(part, "number", "part", "product", *FIGURES, "lobe_um_pp"),
        **fields_of(part, "trace_name", "trace_sha256"),
        "trace_bytes": None if part.trace is None else len(part.trace),
        "result": cylinder_event(None) | {key: value for key, value in part.data.items() if key != PROFILES},
    }


def _event_fields(event: RunEvent) -> dict[str, object]:
    return {"at": event.at.isoformat(), "at_s": event.at_s, "kind": event.kind, "data": event.data}


def _iso(date: datetime | None) -> str | None:
    return None if date is None else date.isoformat()


def _story_lines(found: RunStory, text: Catalogue, lathe: str) -> list[str]:
    row = found.row
    judged, timed = verdict_words(found.cut_verdict, text), timed_words(found, text)
    planned = _indent_lines([f"{text('run.cut_verdict')}: {judged}"] if judged else [])
    if along := stretch_words(found.cut_verdict, text):
        planned += _indent_lines([f"{text('stretches.title')}: {along}"])
    lines = [*row_lines(row, text, lathe), *planned, "", *table(_facts(found, text))]
    for name, told in (
        ("parts", [line for part in found.parts for line in _part_lines(part, text)]),
        ("telemetry", _telemetry(found, text)),
        ("commands", map("  ".join, timed["commands"])),
        ("alarms", map("  ".join, timed["alarms"])),
        ("learned", [_learned_line(each, text) for each in found.accepted_steps]),
    ):
        lines += ["", text(f"records.{name}"), *(_indent_lines(told) or [_describe_missing_records(text)])]
    if found.damaged:
        lines += ["", text("records.damaged", what=", ".join(found.damaged))]
    return lines


def _describe_missing_records(text: Catalogue) -> str:
    return " " * INDENT + text("records.nothing")


def _indent_lines(lines: Iterable[str]) -> list[str]:
    return [" " * INDENT + part for line in lines for part in wrap_text(line, WIDTH - INDENT)]


def _facts(found: RunStory, text: Catalogue) -> list[tuple[str, str]]:
    """Return versions, hashes, set-up and diameter, as far as they are recorded."""
    rows = fact_rows((*origin_facts(found), *setup_facts(found)), text, Layout.COMMAND)
    diameter = _diameter(found.row, text)
    part = found.product
    judged = () if part is None or (part.passed is None and part.is_good is not None) else part.judged
    rows += [(text("roundness.mean_diameter"), diameter)] if diameter else []
    return [*rows, *judged_rows(judged, text)]


def _diameter(row: RunRow, text: Catalogue) -> str:
    if row.diameter_mm is None:
        return ""
    nominal = row.nominal_diameter_mm
    if nominal is None:
        return f"{row.diameter_mm:.3f} mm"
    off = "" if row.diameter_tolerance_um is None else f" ± {row.diameter_tolerance_um:g} um"
    return f"{row.diameter_mm:.3f} mm ({text('records.nominal')} {nominal:.3f}{off})"


def _telemetry(found: RunStory, text: Catalogue) -> list[str]:
    polled = [each for each in found.telemetry if each.kind == POLLED and len(each.rows)]
    said = [_samples(each, found.row.strategy, text) for each in polled]
    return [*said, *([text("records.incomplete")] if found.complete is False else [])]


def _samples(telemetry: RecordedTelemetry, strategy: str, text: Catalogue) -> str:
    seconds = f"{telemetry.column('time_s')[-1]:.1f}"
    part = part_words(telemetry.part, text) or strategy
    return text("records.samples", part=part, rows=len(telemetry.rows), seconds=seconds)


def _part_lines(part: RecordedPart, text: Catalogue) -> list[str]:
    """Return the figures of a part, and its form over the length with its sections."""
    sections = [" · ".join(filter(None, row)) for row in section_rows(part.data, text)]
    return [_part_line(part, text), *([form_words(part.data, text), *sections] if sections else [])]


def _part_line(part: RecordedPart, text: Catalogue) -> str:
    known = part.ront_um is not None
    facts = [part.part, f"RONt {part.ront_um:.2f} um" if known else form_words(part.data, text)]
    if SECTION_Z in part.data:
        facts.append(at_height(number_or_none(part.data[SECTION_Z]), text))
    if part.lobe_um_pp is not None:
        facts.append(text("records.lobe", lobe=f"{part.lobe_um_pp:.2f}"))
    if part.diameter_mm is not None:
        facts.append(f"D {part.diameter_mm:.3f} mm")
    facts += [text("records.reference")] if not part.product else []
    return " · ".join(filter(None, (*facts, part.trace_name, local(part.at))))


def _learned_line(event: RunEvent, text: Catalogue) -> str:
    version, by = event.data.get("version"), event.data.get("by", "")
    return f"{local(event.at)}  {text('records.version', version=version)}  {by}".rstrip()
