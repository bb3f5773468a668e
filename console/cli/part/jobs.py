"""`console jobs`: the saved jobs."""

from __future__ import annotations

from argparse import Namespace

from console.cli.library import data_of
from console.cli.output import print_json
from console.cli.parser import Parser
from console.session.data.kept_files import jobs_folder
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.lobe.lobe_conditions import lobe_source
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry, LoadedJob, list_jobs, load_job


def add(parser: Parser, text: Catalogue) -> None:
    """Add nothing: the command takes what all take."""


def main(options: Namespace, text: Catalogue) -> int:
    """List every job by the name that other commands take; one that cannot be read is listed with its reason."""
    folder = jobs_folder(data_of(options))
    listed = [(entry, _load(entry)) for entry in list_jobs(folder)]
    if options.json:
        print_json({"jobs": [_fields(entry, loaded, text) for entry, loaded in listed]})
        return 0
    rows = [tuple(text(f"jobs.{name}") for name in ("name", "material", "size", "lobe", "speed", "source"))]
    for entry, loaded in listed:
        rows.append(_row(entry, loaded, text))
    print("\n".join(table(rows)))
    for _, loaded in listed:
        if isinstance(loaded, tuple):
            print("\n".join(text.problem(problem) for problem in loaded))
    return 0


def _load(entry: LibraryEntry) -> LoadedJob | tuple[Problem, ...]:
    try:
        return load_job(str(entry.path))
    except ProfileError as error:
        return tuple(error.problems)


def _row(entry: LibraryEntry, loaded: LoadedJob | tuple[Problem, ...], text: Catalogue) -> tuple[str, ...]:
    if not isinstance(loaded, LoadedJob):
        return (printable(entry.name), text("jobs.unreadable"), "", "", "", "")
    job = loaded.job
    return (
        printable(entry.name),
        job.material,
        f"D {job.diameter_mm:.1f} x {job.wall_thickness_mm:.1f} mm",
        f"{job.lobe_error_um_pp:.1f} um p-p",
        f"{job.spindle_speed_rpm:.0f} rpm",
        text("jobs.bundled" if entry.bundled else "jobs.own"),
    )


def _fields(entry: LibraryEntry, loaded: LoadedJob | tuple[Problem, ...], text: Catalogue) -> dict[str, object]:
    fields: dict[str, object] = {"name": entry.name, "path": str(entry.path), "bundled": entry.bundled}
    if not isinstance(loaded, LoadedJob):
        return {**fields, "problems": [text.problem(problem) for problem in loaded]}
    job = loaded.job
    return {
        **fields,
        "title": job.name,
        "sha256": loaded.sha256,
        "material": job.material,
        "diameter_mm": job.diameter_mm,
        "wall_thickness_mm": job.wall_thickness_mm,
        "overhang_mm": job.overhang_mm,
        "jaws": job.jaws,
        "chucking_force_n": job.chucking_force_n,
        "depth_of_cut_mm": job.depth_of_cut_mm,
        "feed_mm_per_rev": job.feed_mm_per_rev,
        "spindle_speed_rpm": job.spindle_speed_rpm,
        "cut_length_mm": job.cut_length_mm,
        "lobe_error_um_pp": job.lobe_error_um_pp,
        "lobe_phase_deg": job.lobe_phase_deg,
        "lobe_error_source": lobe_source(job),
        "roundness_tolerance_um": job.roundness_tolerance_um,
        "lobe_frequency_hz": job.lobe_frequency_hz,
        "assumed": list(job.assumed),
        "source": job.source,
        "copied_from": job.copied_from,
    }
