"""Which harmonics may be learned, with what promise: |1 - L T| of each order with its bound.

A step of learning is L = gain / T_hat, with T_hat the response that is known and T the true one, from the command
to the part. An error of that order becomes 1 - L T of itself. T is g times the response of the tool, with the
process gain g of which only its range is known: an identified response does not see it. With the tool within
r |T_hat| of T_hat that is at most |1 - gain g| + gain g r, at one of the ends of the range: below 1 the error
shrinks whatever tool and cut do within these (norm-optimal learning; Bristow, Tharayil and Alleyne 2006). The
orders from 2 on for which that can be promised are followed without a gap: the first that has no promise is the
end, as of a low-pass (the Q of learning control).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

from profiles.compensations.change import OrderChange
from profiles.compensations.learning import REPEATS_SD_UM, SURE
from profiles.compensations.optimal_gain import PROCESS_LOSS_SD
from profiles.compensations.path import MOST_HARMONICS, OVAL

PROMISED = 0.95
"""The largest bound that counts as a promise: what is left after 14 parts is half. A choice."""


BLANK_OVAL_SD_UM = 0.8
"""Standard deviation of the oval of one blank to the next, by either phase, um. A choice."""

PROCESS_GAINS = (1.0 - 2.0 * PROCESS_LOSS_SD, 1.0)
"""The fraction of the motion of the tool that arrives in the surface, from and to."""


class OrderStatus(StrEnum):
    """Whether an order is learned, or why not."""

    LEARNED = "learned"
    NOISE = "noise"
    NO_PROMISE = "no_promise"
    ONE_PART = "one_part"
    VARIES = "varies"
    GREW = "grew"
    UNSEEN = "unseen"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolResponse:
    """The known response T_hat of the tool at an order, and by which fraction r of that it may be off."""

    response: complex
    spread: float


RIGID = ToolResponse(response=1.0 + 0j, spread=0.0)  # of the mean


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedOrder:
    """One order: its `gain`, |1 - L T| for T = T_hat and its `bound_contraction`, its amplitudes in um, and why.

    `on_part_um` is on the part, `left_um` what the order teaches of that; None where no trace has shown it.
    `tool_off_um` is by how much the tool was off its path, None where that was not seen. `bound_gain_1` decides
    whether an order is promised. `most_um` is what the next part has at most (95 %), if the order is learned.
    `change` is what the part has shown of a step or a drift.
    """

    order: int
    gain: float
    factor: float
    bound: float
    bound_gain_1: float
    on_part_um: float | None
    left_um: float | None
    standing: OrderStatus
    tool_off_um: float | None = None
    axial: int = 0
    known_within_um: float | None = None
    most_um: float | None = None
    change: OrderChange | None = None


def bound_contraction(gain: float, spread: float) -> float:
    """Return the largest |1 - L T| for a tool within `spread` of its response, and any of the process gains."""
    return max(abs(1.0 - gain * arrives) + gain * arrives * spread for arrives in PROCESS_GAINS)


def is_promised(follows: ToolResponse, least_response: float) -> bool:
    """Whether an order may be learned: the tool follows it well enough, and as surely."""
    return abs(follows.response) >= least_response and bound_contraction(1.0, follows.spread) <= PROMISED


def promised_orders(
    follows: Callable[[int], ToolResponse], least_response: float, most: int = MOST_HARMONICS
) -> tuple[int, ...]:
    """Return the orders from 2 on, up to the first that the tool hardly follows or that has no promise."""
    orders = []
    for order in range(2, most + 1):
        if not is_promised(follows(order), least_response):
            break
        orders.append(order)
    return tuple(orders)


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderEvidence:
    """One order on a measured part, um: its amplitude, the learning step from it, the tool's error in its cut."""

    on_part_um: complex | None = None
    left_um: complex | None = None
    tool_off_um: complex | None = None


def certify_order(
    order: int,
    gain: float,
    shown: OrderEvidence,
    follows: ToolResponse,
    standing: OrderStatus,
    *,
    axial: int = 0,
    clamped_um: float = 0.0,
) -> CertifiedOrder:
    """Return the certificate of an order, whose amplitude has the standard deviation `clamped_um` of a clamping.

    Nor does the rest of it repeat better than `REPEATS_SD_UM`, twice a turn than the blanks. That of this part
    is learned with the gain, and the next part has one of its own: it may have both at most.
    """
    learned, left_um = standing is OrderStatus.LEARNED, _height(shown.left_um)
    tried = gain if learned else 1.0  # what a step would do
    bound, most_um = bound_contraction(tried, follows.spread), None
    if learned and left_um is not None:
        blank_um = BLANK_OVAL_SD_UM if order == OVAL else 0.0
        most_um = bound * left_um + SURE * math.hypot(1.0, tried) * math.hypot(clamped_um, REPEATS_SD_UM, blank_um)
    return CertifiedOrder(
        order=order,
        gain=gain,
        factor=abs(1.0 - tried),
        bound=bound,
        bound_gain_1=bound_contraction(1.0, follows.spread),
        on_part_um=_height(shown.on_part_um),
        left_um=left_um,
        most_um=most_um,
        standing=standing,
        tool_off_um=_height(shown.tool_off_um),
        axial=axial,
    )


def certify_push(push_um: float, standing: OrderStatus = OrderStatus.LEARNED) -> tuple[CertifiedOrder, ...]:
    """Return the row of a push of the cut, um at its entry, made up for in full; none of no push.

    It is the term of order 0 that is no polynomial along Z (`axial` 0); its height from entry to end is p-p. How
    much more or less the next blank pushes is not known: nothing is promised of it (`most_um`).
    """
    if not push_um:
        return ()
    shown = OrderEvidence(on_part_um=complex(push_um / 2.0), left_um=complex(push_um / 2.0))
    return (replace(certify_order(0, 1.0, shown, RIGID, standing), most_um=None),)


def refuse_orders(certificate: Iterable[CertifiedOrder]) -> tuple[CertifiedOrder, ...]:
    """Return a certificate of which nothing is learned, since the part or its path was refused."""
    return tuple(
        replace(each, standing=OrderStatus.REFUSED) if each.standing is OrderStatus.LEARNED else each
        for each in certificate
    )


def _height(coefficient_um: complex | None) -> float | None:
    return None if coefficient_um is None else abs(coefficient_um)
