"""`console run`: a whole job, from the saved job to the measured part."""

from __future__ import annotations

import sys
from argparse import Namespace

from console.session.signals import Interruption
from console.text.catalogue import Catalogue

WRONG_USAGE = 2


def main(options: Namespace, text: Catalogue) -> int:
    """Run a job, on a machine or simulated, and print what became of it.

    The exit code is 1 when nobody agreed to move a machine, 2 for words that belong to a simulated one alone.

    Raises:
        ProblemError: a refusal before anything moved, or what ended the cut; the machine is at rest.
    """
    interruption = Interruption()
    interruption.install()
    from console.cli.library import anything_told

    if anything_told(options) and not options.sim:
        print(f"console run: {text('usage.plant_without_sim')}", file=sys.stderr)
        return WRONG_USAGE
    # Numerics take longer to load than the whole command line; the signals are already in hand.
    from console.cli.library import data_of
    from console.cli.output import tell
    from console.cli.run_cut import agreed_to, cut_ordered
    from console.cli.run_order import ordered
    from console.session.data.killed_runs import killed_runs
    from profiles.files import remove_all_left

    order = ordered(options)
    remove_all_left(data_of(options))
    killed = killed_runs(data_of(options), order.machine.machine.name, simulated=order.simulated)
    warnings = tell((*killed, *order.warnings), text)
    if order.address is not None and not agreed_to(options, order, text):
        return 1
    cut_ordered(options, order, interruption, warnings, text)
    return 0
