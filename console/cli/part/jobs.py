"""`console jobs`: the saved jobs, and what differs from the commit of a data folder under git."""

from __future__ import annotations

from argparse import Namespace

from console.cli.arguments import add_shared
from console.cli.library import data_of
from console.cli.output import fields_of, show
from console.cli.parser import Parser
from console.cli.part.listed import Listed, fields_of_entry, listed, sentences
from console.session.data.kept_files import jobs_folder
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.lobe import lobe_number
from profiles.files import printable
from profiles.job import NO_LOBE
from profiles.lobe.lobe_conditions import lobe_source
from profiles.store import LoadedJob, list_jobs, load_job

STATUS = "status"


def add(parser: Parser, text: Catalogue) -> None:
    """Add what is to be shown, and the machine on which changed jobs are judged."""
    parser.add_argument("action", metavar="status", nargs="?", choices=(STATUS,), help=text("help.jobs.status"))
    add_shared(parser, text, "machine")


def main(options: Namespace, text: Catalogue) -> int:
    """List every job by the name that other commands take, an unreadable one with its reason; or what differs."""
    if options.action == STATUS:
        from console.cli.part.jobs_status import show_status

        show_status(options, text)
        return 0
    found = listed(list_jobs(jobs_folder(data_of(options))), load_job)
    show(options, lambda: {"jobs": [_fields(each, text) for each in found]}, lambda: _lines(found, text))
    return 0


def _fields(each: Listed[LoadedJob], text: Catalogue) -> dict[str, object]:
    _, loaded = each
    fields = fields_of_entry(each, text)
    if not isinstance(loaded, LoadedJob):
        return fields
    job = loaded.job
    return {
        **fields,
        "title": job.name,
        "sha256": loaded.sha256,
        **fields_of(job, "material", "diameter_mm", "wall_thickness_mm", "overhang_mm", "jaws"),
        **fields_of(job, "chucking_force_n", "depth_of_cut_mm", "feed_mm_per_rev", "spindle_speed_rpm"),
        **fields_of(job, "cut_length_mm", "lobe_error_um_pp", "lobe_phase_deg"),
        "lobe_error_source": lobe_source(job),
        **fields_of(job, "roundness_tolerance_um", "lobe_frequency_hz"),
        "assumed": list(job.assumed),
        "note": job.note,
        "tags": list(job.tags),
        **fields_of(job, "source", "copied_from"),
    }


def _lines(found: list[Listed[LoadedJob]], text: Catalogue) -> list[str]:
    """Return a row for each job, then why some cannot be read."""
    rows = [tuple(text(f"jobs.{name}") for name in ("name", "material", "size", "lobe", "speed", "source"))]
    rows += [_row(each, text) for each in found]
    return [*table(rows), *sentences(found, text)]


def _row(each: Listed[LoadedJob], text: Catalogue) -> tuple[str, ...]:
    entry, loaded = each
    if not isinstance(loaded, LoadedJob):
        return (printable(entry.name), text("jobs.unreadable"), "", "", "", "")
    job = loaded.job
    return (
        printable(entry.name),
        job.material,
        f"D {job.diameter_mm:.1f} x {job.wall_thickness_mm:.1f} mm",
        lobe_number(job) if job.lobe_error_source == NO_LOBE else f"{lobe_number(job)} um p-p",
        f"{job.spindle_speed_rpm:.0f} rpm",
        text("jobs.bundled" if entry.bundled else "jobs.own"),
    )
