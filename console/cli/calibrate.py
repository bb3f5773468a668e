"""`console calibrate`: the chuck from measurements at it, the lobe of a job from the trace of a part."""

from __future__ import annotations

from argparse import Namespace

from console.session.data.dates import utc_now
from console.text.catalogue import Catalogue


def main(options: Namespace, text: Catalogue) -> int:
    """Fit what was measured and print it with its confidence; keep it where that was asked for."""
    date = utc_now()
    if options.action == "chuck":
        from console.cli.calibrate_chuck import calibrate_chuck

        return calibrate_chuck(options, text, date)
    from console.cli.calibrate_lobe import calibrate_lobe

    return calibrate_lobe(options, text, date)
