"""`console doctor`: may this machine be moved? Every check with a tick or a cross, and what helps."""

from __future__ import annotations

import sys
from argparse import Namespace

from console.cli.card_access import Card, opened_card
from console.cli.check_lines import check_fields, check_lines, summary
from console.cli.controller import head, identity
from console.cli.output import print_json
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.pmac.configuration.check import Check, Outcome, worst
from drivers.pmac.configuration.proofs.bench import unproven
from drivers.pmac.configuration.verification import Verification, in_order, verify


def main(options: Namespace, text: Catalogue) -> int:
    """Check, and prove if that is asked for; 1 when something fails."""
    with opened_card(options) as card:
        verification = verify(card.client, card.machine, card.dialect)
        agreed = options.prove and _agreed(options, card, text)
        proofs = _proven(card, verification) if agreed else unproven()
    checks = in_order([*verification.checks, *proofs])
    if options.json:
        print_json({**identity(card), "checks": check_fields(checks, text)})
    else:
        lines = [head(card, text), text("card.marks"), *check_lines(checks, text), "", summary(checks, text)]
        print("\n".join(lines))
    refused = options.prove and not agreed
    return 1 if refused or worst(checks) is Outcome.FAILS else 0


def _proven(card: Card, verification: Verification) -> list[Check]:
    """Prove, with every signal that would end the command as a stop."""
    # What gathers loads numerics; nobody waits for them who proves nothing.
    from drivers.pmac.configuration.proofs.proving import prove

    interruption = Interruption()
    interruption.install()
    interruption.guard(card.stop)
    return prove(card.client, card.stop, card.clock, verification)


def _agreed(options: Namespace, card: Card, text: Catalogue) -> bool:
    """Whether somebody at the machine has typed its name. A simulated one is not asked about."""
    if options.yes or card.simulated:
        return True
    if not sys.stdin.isatty():
        print(f"console doctor: {text('doctor.nobody_to_ask')}", file=sys.stderr)
        return False
    print(text("doctor.ask", machine=card.machine.name), end="", file=sys.stderr, flush=True)
    if sys.stdin.readline().strip() == card.machine.name:
        return True
    print(f"console doctor: {text('doctor.not_asked')}", file=sys.stderr)
    return False
