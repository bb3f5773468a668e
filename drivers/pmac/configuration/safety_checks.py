"""The safety devices of a machine, as its profile says how they are fitted, and as far as the card sees them."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.errors import DriverError
from drivers.pmac.client import PmacClient
from drivers.pmac.configuration.check import Check, Group, Outcome
from drivers.pmac.configuration.reading import number_in
from drivers.safety import FORM, NOT_FITTED, WIRED, inputs_of
from profiles.machine import Safety
from profiles.machine_signature import is_signature


def safety_checks(client: PmacClient, safety: Safety) -> list[Check]:
    """Return one line for each device, and one for each that the card sees. Only those are asked for.

    Raises:
        DriverError: the link broke, or the card answers something that is not asked for.
    """
    return [*_fitted(safety), *_seen(client, safety)]


def _fitted(safety: Safety) -> Iterator[Check]:
    for device, fitted in safety.devices.items():
        if fitted == WIRED:
            yield _check("device_wired", Outcome.HOLDS, device)
        elif fitted == NOT_FITTED and is_signature(safety.signed_by):
            yield _check("device_signed", Outcome.NOTED, device, safety.signed_by)
        elif fitted == NOT_FITTED:
            yield _check("device_unsigned", Outcome.FAILS, device)
        else:
            yield _check("device_unknown", Outcome.FAILS, device, fitted, f"{WIRED} | {NOT_FITTED}")


def _seen(client: PmacClient, safety: Safety) -> Iterator[Check]:
    try:
        inputs = inputs_of(safety)
    except DriverError as error:
        for problem in error.problems:
            yield _check("input_unreadable", Outcome.FAILS, "", problem.value, FORM)
        return
    items = list(dict.fromkeys(each.item for each in inputs))
    found = client.query(*items, again=True) if items else ()
    words = {item: int(number_in(text, client.link.address)) for item, text in zip(items, found, strict=True)}
    for each in inputs:
        good = each.is_good(words[each.item])
        outcome = Outcome.HOLDS if good else Outcome.FAILS
        yield _check("input", outcome, each.device, str(words[each.item] >> each.bit & 1), str(each.good))


def _check(code: str, outcome: Outcome, device: str, found: str = "", wanted: str = "") -> Check:
    return Check(group=Group.SAFETY, code=code, outcome=outcome, subject=device, found=found, wanted=wanted)
