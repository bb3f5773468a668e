"""`console jobs`: the saved jobs."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from console.cli.parser import Parser
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from console.cli.part.jobs_lines import Listed
    from profiles.store import LibraryEntry


def add(parser: Parser, text: Catalogue) -> None:
    """Add nothing: the command has only the common options."""


def main(options: Namespace, text: Catalogue) -> int:
    """List every job by the name that other commands take; an unreadable one with its reason."""
    from console.cli.library import data_of
    from console.cli.output import print_json
    from console.cli.part.jobs_fields import job_fields
    from console.cli.part.jobs_lines import job_lines
    from console.session.data.kept_files import jobs_folder
    from profiles.store import list_jobs

    listed = [_loaded(entry) for entry in list_jobs(jobs_folder(data_of(options)))]
    if options.json:
        print_json({"jobs": [job_fields(each, text) for each in listed]})
    else:
        print("\n".join(job_lines(listed, text)))
    return 0


def _loaded(entry: LibraryEntry) -> Listed:
    from profiles.problem import ProfileError
    from profiles.store import load_job

    try:
        return entry, load_job(str(entry.path))
    except ProfileError as error:
        return entry, tuple(error.problems)
