"""Write the manual page anew, from the parser of the command line.

python -m docs.manual_page
"""

from __future__ import annotations

import os
from importlib.metadata import version
from pathlib import Path

from argparse_manpage.manpage import Manpage

from console.cli.whole_parser import whole_parser
from console.text.catalogue import load

PAGE = Path(__file__).parent / "man" / "console.1"
COLUMNS = "80"  # argparse breaks its lines at the width of the terminal

MORE = r"""
.SH EXIT STATUS
.TP
0
done
.TP
1
refused or failed; a line on stderr gives the reason and the remedy, with \-\-json also an object on stdout
.TP
2
wrong usage
.TP
3
with \-\-fail\-out\-of\-tolerance: the part is out of the roundness tolerance of its job
.TP
4
console run: the cut is not proven to be the planned one; the part is neither good nor bad

.SH FILES
.TP
/etc/trilobe/config.toml, ~/.config/trilobe/config.toml
settings of the computer and of the account
.TP
~/.local/share/trilobe
the data folder: jobs, machines, records; another one with \-\-data

.SH ENVIRONMENT
.TP
TRILOBE_DATA, TRILOBE_MACHINE, TRILOBE_LINK, TRILOBE_LANGUAGE, TRILOBE_OPERATOR
settings, over those of the files
.TP
TRILOBE_MQTT_USER, TRILOBE_MQTT_PASSWORD
who publishes at the broker of console mqtt
.TP
NO_COLOR
no colours on the screens
"""


def manual_page() -> str:
    """Return the page in the language of man(7)."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = COLUMNS
    try:
        number = version("trilobe")
        facts = {"project_name": "trilobe", "version": number, "manual_section": 1, "manual_title": "trilobe"}
        parser = whole_parser(load("en"))
        parser.man_short_description = "console for a lathe that turns round parts in a jaw chuck"  # type: ignore[attr-defined]
        facts["date"] = f"version {number}"  # no day, so that the same commands make the same page
        page = str(Manpage(parser, format="single-commands-section", _data=facts))
    finally:
        if before is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before
    return page.rstrip("\n") + "\n" + MORE


if __name__ == "__main__":
    PAGE.write_text(manual_page(), encoding="utf-8")
    PAGE.with_name("trilobe.1").write_text(".so man1/console.1\n", encoding="utf-8")
