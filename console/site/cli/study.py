"""`console study`: a table of jobs, machines, plants, strategies and seeds, cut on the simulator."""

from __future__ import annotations

import os
from argparse import Namespace

from console.cli.arguments import number_parser_within, whole_number
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

MOST_WORKERS = 1024


def add(parser: Parser, text: Catalogue) -> None:
    """Add the file, the workers, and where the results go."""
    parser.add_argument("file", metavar="FILE.toml", help=text("help.study.file"))
    parser.add_argument("--out", metavar="FOLDER", help=text("help.study.out"))
    who = parser.add_mutually_exclusive_group()
    workers = number_parser_within(whole_number, 1, MOST_WORKERS, "usage.study_workers", MOST_WORKERS)
    who.add_argument("--workers", metavar="N", type=workers, help=text("help.study.workers"))
    who.add_argument("--scheduler", metavar="ADDRESS", help=text("help.study.scheduler"))
    parser.add_argument("--parquet", action="store_true", help=text("help.study.parquet"))


def main(options: Namespace, text: Catalogue) -> int:
    """Carry the study out, or resume it, and write the results; bad cells are rows of them, and no failure."""
    from console.site.cli.study_report import study

    return study(options, options.workers or os.cpu_count() or 1, text)
