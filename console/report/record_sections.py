"""Sections on the job, the set-up, the program; hashes and versions, and the gaps of the record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from console.report.markup import (
    Markup,
    element,
    escape_markup,
    facts_table,
    join_markup,
    list_of,
    paragraph,
    section,
)
from console.report.quantities import DEG_DIGITS, MM_DIGITS, UM_DIGITS, exact
from console.session.data.run_facts import origin_facts, program_sha256, setup_facts
from console.session.data.run_rows import RunOutcome
from console.session.learning.opened_run import OpenedRun
from console.text.catalogue import Catalogue
from console.text.recorded_words import Layout, fact_rows, part_words, stage_words
from profiles.job import JOB_FIELDS, NO_LOBE, Job, hash_of_job

PART = ("material", "diameter_mm", "wall_thickness_mm", "overhang_mm", "jaws")
CUT = ("chucking_force_n", "depth_of_cut_mm", "spindle_speed_rpm", "feed_mm_per_rev", "cut_length_mm")
CONDITIONS = (
    "lobe_force_n",
    "lobe_spindle_speed_rpm",
    "lobe_overhang_mm",
    "lobe_wall_thickness_mm",
    "lobe_diameter_mm",
    "lobe_material",
    "lobe_jaws",
    "lobe_chuck",
    "lobe_tool",
    "lobe_past_jaw_deg",
)
_SIGNS = {"um": "µm", "deg": "°"}
_UNITS = {field.key: _SIGNS.get(field.unit, field.unit) for field in JOB_FIELDS}


def write_request(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the part and the cut as the job states them, with the source of its lobe."""
    title, job = text("report.asked"), run.job
    if job is None:
        why = [text.problem(problem) for problem in run.job_problems] or [text("report.no_job_text")]
        return section("asked", title, *(paragraph(each) for each in why))
    diameter = exact(job.finished_diameter_mm, "mm")
    off_um, cylt_um = job.diameter_tolerance_um, job.cylindricity_tolerance_um
    tolerances = [
        (text("report.finished_diameter"), diameter),
        (text("report.roundness_tolerance"), exact(job.roundness_tolerance_um, "µm RONt")),
        *([] if cylt_um is None else [(text("report.cylindricity_tolerance"), exact(cylt_um, "µm CYLt"))]),
        (
            text("report.diameter_tolerance"),
            text("report.none_stated") if off_um is None else f"± {exact(off_um, 'µm')}",
        ),
    ]
    return section(
        "asked",
        title,
        facts_table(text("report.asked_part"), [*_rows(job, PART, text), *tolerances]),
        facts_table(text("report.asked_cut"), _rows(job, CUT, text)),
        facts_table(text("report.asked_lobe"), _lobe(job, text)),
        paragraph(text("report.assumed_means"), class_="note") if job.assumed else None,
        paragraph(text("report.job_source", source=job.source)) if job.source else None,
        paragraph(text("report.job_copied", name=job.copied_from)) if job.copied_from else None,
    )


def _rows(job: Job, keys: tuple[str, ...], text: Catalogue) -> list[tuple[str, str]]:
    """Return the job fields that have a value; assumed ones are marked."""
    rows = []
    for key in keys:
        value = getattr(job, key)
        if value is None:
            continue
        shown = value if isinstance(value, str) else exact(value, _UNITS[key])
        assumed = f" ({text('setup.assumed')})" if key in job.assumed else ""
        rows.append((text.first_sentence(f"report.field.{key}", f"setup.{key}"), shown + assumed))
    return rows


def _lobe(job: Job, text: Catalogue) -> list[tuple[str, str]]:
    source = (text("report.lobe_source"), text(f"source.{job.lobe_error_source}"))
    if job.lobe_error_source == NO_LOBE:
        return [source]
    return [*_rows(job, ("lobe_error_um_pp",), text), source, *_rows(job, ("lobe_phase_deg", *CONDITIONS), text)]


def write_setup(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the alignment and the forces of the cut, with the time of each."""
    setup, title = run.story.setup, text("report.set")
    if not setup:
        return section("set", title, paragraph(text("report.no_setup")))
    rows = fact_rows(setup_facts(run.story), text, Layout.REPORT)
    aligned = setup.get("aligned")
    if isinstance(aligned, bool):
        rows.append((text("report.set_origin"), text("report.aligned" if aligned else "report.from_files")))
    rows += [
        (text("report.calibration", name=str(name)), str(date)) for name, date in _items(setup.get("calibrations"))
    ]
    warnings = setup.get("warnings")
    said = [str(each) for each in warnings] if isinstance(warnings, list | tuple) else []
    return section(
        "set",
        title,
        facts_table(text("report.set_table"), rows),
        join_markup([paragraph(text("report.set_warnings")), list_of(said)]) if said else None,
    )


def _items(value: object) -> list[tuple[object, object]]:
    return list(value.items()) if isinstance(value, Mapping) else []


def write_sent(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the origin of the program, and its hash."""
    story, row = run.story, run.story.row
    version = row.compensation
    stage = text("report.not_recorded") if row.stage is None else stage_words(row.strategy, row.stage, text)
    if version is None:
        learned = text("report.not_recorded")
    elif version == "none":
        learned = text("report.nothing_learned")
    else:
        learned = text("report.version", version=version)
    inverted = run.story.setup.get("inverted")
    lines = len(story.program.splitlines())
    rows = [
        (text("fact.strategy"), text(f"strategy.{row.strategy}.named")),
        (text("report.stage"), stage),
        (text("report.compensation"), learned),
        (text("report.inverted"), _describe_inverted_response(inverted, text)),
        (text("fact.controller"), story.controller or text("report.not_recorded")),
        (text("report.address"), _address(run.story.setup.get("address"), text)),
        (text("report.program"), text("report.program_size", count=lines)),
        (text("fact.program_hash"), program_sha256(story.program)),
    ]
    several = sum(part.product for part in run.parts) > 1
    return section(
        "sent",
        text("report.sent"),
        facts_table(text("report.sent_table"), [row for row in rows if row[1]]),
        paragraph(text("report.first_program")) if several else None,
    )


def _describe_inverted_response(name: object, text: Catalogue) -> str:
    if not name:
        return text("report.not_recorded")
    return text("report.inverted_model") if name == "model" else str(name)


def _address(address: object, text: Catalogue) -> str:
    if address is None:
        return text("report.not_recorded")
    return str(address) or text("report.own_process")


def write_provenance(run: OpenedRun, text: Catalogue) -> Markup:
    """Write versions and hashes, by which everything can be found again, and the rounding of numbers."""
    story = run.story
    rows = [
        *fact_rows(origin_facts(story), text, Layout.REPORT),
        *(
            (text("report.trace_hash", part=part_words(part.part or "part", text)), part.trace_sha256)
            for part in run.parts
            if part.trace_sha256
        ),
    ]
    digits = text("report.digits", um=10**-UM_DIGITS, mm=10**-MM_DIGITS, deg=10**-DEG_DIGITS)
    return section(
        "provenance",
        text("report.provenance"),
        facts_table(text("report.provenance_table"), rows),
        paragraph(_as_filed(run, text)),
        paragraph(digits, class_="note"),
    )


def _as_filed(run: OpenedRun, text: Catalogue) -> str:
    """Return whether the job as cut is that of its file."""
    story = run.story
    if story.job_text is None:
        return text("report.job_not_kept")
    same = hash_of_job(story.job_text.encode("utf-8", "replace")) == story.job_sha256
    return text("report.job_as_filed" if same else "report.job_changed")


def write_gaps(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the gaps of the record: missing or unreadable data."""
    lines = list(list_gaps(run, text))
    body = list_of(lines) if lines else paragraph(text("report.nothing_missing"))
    return section("missing", text("report.missing"), body)


def list_gaps(run: OpenedRun, text: Catalogue) -> Iterator[str]:  # noqa: C901 - one branch a case
    """Yield one sentence for each gap of the record."""
    story, row = run.story, run.story.row
    for what in story.damaged:
        word, _, number = what.partition(" ")
        yield text("report.damaged", what=" ".join((text(f"report.damaged.{word}"), number)).strip())
    if row.damaged and not story.damaged:
        yield text("report.damaged_row")
    if row.operator is None:
        yield text("report.no_operator")
    if story.job_text is None and "job" not in story.damaged:
        yield text("report.job_not_kept")
    if story.machine_text is None and "machine" not in story.damaged:
        yield text("report.machine_not_kept")
    if story.complete is False and row.ended.how is not RunOutcome.OPEN:
        yield text("report.telemetry_incomplete")
    if row.ended.how is RunOutcome.OPEN and "events" not in story.damaged:
        yield text("report.no_end")
    for part in run.parts:
        name = part_words(part.part or "part", text)
        if part.trace is None:
            yield text("report.no_trace", part=name)
        elif run.doubts(part):
            yield text("report.trace_doubtful", part=name)
    for problem in run.job_problems:
        yield text.problem(problem)
    if run.points is None:
        yield text("report.no_points")
    if run.contradicts_itself:
        yield text("report.contradiction")


def write_program(run: OpenedRun, text: Catalogue) -> Markup:
    """Write the program in full; it can be folded, and is printed."""
    content = run.story.program
    if not content.strip():
        return section("program", text("report.program_text"), paragraph(text("report.no_program")))
    summary = text("report.program_summary", count=len(content.splitlines()))
    # A line feed right behind <pre> is no part of the text: one is written, so that none of the program is lost.
    shown = element("pre", escape_markup("\n" + content))
    return section(
        "program",
        text("report.program_text"),
        element("details", element("summary", summary), shown, open="open"),
    )
