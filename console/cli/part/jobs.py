"""`console jobs`: the saved jobs, which of them a machine can cut, and what differs from the commit."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from importlib import import_module

from console.cli.arguments import add_shared
from console.cli.library import data_of, judged_of
from console.cli.output import fields_of, show
from console.cli.parser import Parser
from console.cli.part.library_list import Listed, fields_of_entry, list_library, sentences
from console.rings import is_installed
from console.session.configuration import SettingOrigin
from console.session.data.kept_files import jobs_folder
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.job_words import lobe_number
from profiles.files import printable
from profiles.findings import refusals
from profiles.job import NO_LOBE
from profiles.lobe.lobe_conditions import lobe_source
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.rules import check
from profiles.store import LoadedJob, list_jobs, load_job

STATUS = "console.site.cli.jobs_status"


def add(parser: Parser, text: Catalogue) -> None:
    """Add what is to be shown, and the machine on which changed jobs are judged."""
    if is_installed(STATUS):
        parser.add_argument(
            "action", metavar="status", nargs="?", choices=("status",), help=text("help.jobs.status")
        )
    add_shared(parser, text, "machine", command="jobs")


def main(options: Namespace, text: Catalogue) -> int:
    """List every job by the name that other commands take, an unreadable one with its reason; or what differs.

    Jobs are judged by the rules on the machine that `--machine` names; a configured one makes the list no longer.
    """
    if getattr(options, "action", None) is not None:
        import_module(STATUS).show_status(options, text)
        return 0
    found = list_library(list_jobs(jobs_folder(data_of(options))), load_job)
    named = options.configuration.settings.get("machine")
    is_named = named is not None and named.origin is SettingOrigin.OPTION
    machine = judged_of(options).machine if is_named else None
    show(
        options,
        lambda: {
            **({} if machine is None else {"judged_on": machine.name}),
            "jobs": [_fields(each, machine, text) for each in found],
        },
        lambda: _lines(found, machine, text),
    )
    return 0


def _find_job_refusals(loaded: LoadedJob, machine: MachineProfile | None) -> tuple[Problem, ...]:
    """Return why a job cannot be cut on a machine, each with the name of its file."""
    found = () if machine is None else refusals(check(loaded.job, machine))
    return tuple(replace(each.problem, where=printable(str(loaded.path))) for each in found)


def _fields(each: Listed[LoadedJob], machine: MachineProfile | None, text: Catalogue) -> dict[str, object]:
    _, loaded = each
    fields = fields_of_entry(each, text)
    if not isinstance(loaded, LoadedJob):
        return fields
    job = loaded.job
    if machine is not None:
        fields["problems"] = [text.problem(problem) for problem in _find_job_refusals(loaded, machine)]
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


def _lines(found: list[Listed[LoadedJob]], machine: MachineProfile | None, text: Catalogue) -> list[str]:
    """Return a row for each job, then why some cannot be read, or not be cut on the machine."""
    rows = [tuple(text(f"jobs.{name}") for name in ("name", "material", "size", "lobe", "speed", "source"))]
    rows += [_row(each, text) for each in found]
    if machine is None:
        return [*table(rows), *sentences(found, text)]
    refused = [
        _find_job_refusals(loaded, machine) if isinstance(loaded, LoadedJob) else None for _, loaded in found
    ]
    said = ["" if why is None else text("jobs.refused" if why else "jobs.fits") for why in refused]
    # In place of the source: a row is wide enough.
    rows = [(*row[:-1], cell) for row, cell in zip(rows, [text("jobs.fitting"), *said], strict=True)]
    reasons = [text.problem(problem) for why in refused if why for problem in why]
    on = text("jobs.all_judged_on", machine=printable(machine.name))
    return [*table(rows), *sentences(found, text), *reasons, on]


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
