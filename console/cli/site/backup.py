"""`console backup`: the whole data folder in one file."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the file to write."""
    parser.add_argument("file", metavar="FILE.tar.gz", help=text("help.backup.file"))


def main(options: Namespace, text: Catalogue) -> int:
    """Back up, and print what the backup holds; what is not in it is a warning."""
    from console.cli.library import data_of
    from console.cli.site.backup_report import show_backup
    from console.session.data.backup import back_up

    manifest, left_out = back_up(data_of(options), Path(options.file))
    show_backup(options, manifest, left_out, text)
    return 0
