"""`console deploy`: the files by which services, a serial adapter, a dashboard and a container are set up."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

import console
from console.cli.output import show
from console.cli.parser import Parser
from console.session.data.kept_files import file_error
from console.text.catalogue import Catalogue
from profiles.files import printable, write_atomically
from profiles.problem import refusal_error

PLACES = (Path(console.__file__).parent / "deploy", Path(console.__file__).parents[1] / "docs" / "deploy")
"""In a wheel, and in a checkout."""


def add(parser: Parser, text: Catalogue) -> None:
    """Add the folder."""
    parser.add_argument("folder", metavar="FOLDER", type=Path, help=text("help.deploy_folder"))


def main(options: Namespace, text: Catalogue) -> int:
    """Write all files into a folder, or none: ProfileError `file.exists`, `file.not_writable`."""
    source = next(each for each in PLACES if each.is_dir())
    found = sorted(each for each in source.rglob("*") if each.is_file())
    made = {options.folder / each.relative_to(source): each for each in found}
    try:
        if there := [target for target in made if target.exists()]:
            raise refusal_error("file.exists", key="FOLDER", where=printable(str(there[0])))
        for target, each in made.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(target, each.read_bytes(), overwrite=False)
    except OSError as error:
        raise file_error("file.not_writable", options.folder, error) from error
    names = [str(target) for target in made]
    show(options, lambda: {"files": names}, lambda: [*map(printable, names), text("deploy.next")])
    return 0
