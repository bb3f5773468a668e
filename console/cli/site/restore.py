"""`console restore`: a data folder from its backup."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.cli.parser import Parser
from console.text.catalogue import Catalogue


def add(parser: Parser, text: Catalogue) -> None:
    """Add the file to read."""
    parser.add_argument("file", metavar="FILE.tar.gz", help=text("help.restore.file"))


def main(options: Namespace, text: Catalogue) -> int:
    """Restore, and print what was restored where."""
    from console.cli.library import data_of
    from console.cli.site.backup_report import show_backup
    from console.session.data.restore import restore

    manifest, left_out = restore(Path(options.file), data_of(options))
    show_backup(options, manifest, left_out, text)
    return 0
