"""A zero that another host sets (HMZ) is not taken for one that was found, nor for the one that was there."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import pytest

from drivers.errors import DriverError
from drivers.lathe.held_positions import HeldPositions
from drivers.lathe.snapshot import AxisName, AxisState
from profiles.machine import MachineProfile
from tests.drivers.test_limits_of_a_cut import polled
from tests.system.lathe_sites import Site, opened


def another_sends_at(site: Site, counts: float, line: bytes) -> None:
    """At the first look that shows the spindle beyond so many counts."""
    from drivers.link.memory import MemoryLink

    assert isinstance(site.client.link, MemoryLink)
    sent: list[bytes] = []

    def see(snapshot: object) -> None:
        position = site.lathe._poller.last.spindle.position if site.lathe._poller.last else 0.0
        if position > counts and not sent:
            sent.append(line)
            site.clock.connect().receive(line)  # type: ignore[attr-defined]

    site.seen.append(see)


def test_a_home_that_is_called_in_mid_search_is_no_home() -> None:
    with opened("memory", "pmac") as site:
        site.lathe.connect()
        site.lathe.claim()
        site.lathe.enable()
        another_sends_at(site, 1000.0, b"#2HMZ\r")
        with pytest.raises(DriverError) as error:
            site.lathe.home()
        assert error.value.problems[0].code == "machine.home_ended"


def test_a_zero_that_is_set_between_two_jogs_is_found_before_the_next_one_moves() -> None:
    with opened("memory", "pmac") as site:
        site.lathe.connect()
        site.lathe.claim()
        site.lathe.enable()
        site.lathe.home()
        site.lathe.jog_to(AxisName.SPINDLE, 1234.0)
        site.clock.connect().receive(b"#2HMZ\r")  # type: ignore[attr-defined]
        site.clock.wait(0.05)
        with pytest.raises(DriverError) as error:
            site.lathe.jog_to(AxisName.CARRIAGE, 5000.0)
        found = error.value.problems[0]
        assert (found.code, found.key) == ("controller.zero_shifted", "spindle")
        site.lathe.home()
        site.lathe.jog_to(AxisName.CARRIAGE, 500.0)


@pytest.mark.parametrize(
    ("places_mm", "shifted"),
    [
        ((5.0, 5.0, 0.0), True),
        ((5.0, 5.0, 5.005, 0.0), True),  # a poll reads that much askew
        ((5.0, 5.0, 4.0), False),  # moved by hand
        ((5.0, 3.0, 0.0), False),  # moved by hand to its zero
        ((0.8, 0.8, 0.0), False),  # so may a hand, from one poll to the next
        ((0.0, 0.0, 5.0, 5.0), False),
    ],
)
def test_a_zero_that_is_set_on_an_axis_that_nothing_holds_is_found_and_a_hand_is_not_taken_for_it(
    machine: MachineProfile, places_mm: tuple[float, ...], shifted: bool
) -> None:
    held = HeldPositions(machine)
    for place_mm in (places_mm[0], *places_mm):  # the first one only says that nothing holds it
        counts = place_mm * machine.carriage.counts_per_mm
        axis = AxisState(position=counts, following_error=0.0, flags=frozenset({"activated", "home_complete"}))
        assert not axis.closed
        held.judged(replace(polled(carriage=axis), program_running=False), ours=True)
    assert (set(held.shifted) == {AxisName.CARRIAGE}) is shifted


@pytest.mark.parametrize(("by", "shifted"), [("us", False), ("the controller", False), ("somebody", True)])
def test_what_this_console_moves_or_the_controller_ends_is_no_shift(
    machine: MachineProfile, by: str, shifted: bool
) -> None:
    """A lost cut was taken out of the part by the controller itself."""
    held = HeldPositions(machine)
    flags = frozenset({"activated", "amplifier_enabled", "home_complete", "desired_velocity_zero"})

    def see(place_mm: float, lost: int = 0) -> None:
        axis = AxisState(place_mm * machine.carriage.counts_per_mm, following_error=0.0, flags=flags)
        held.judged(replace(polled(carriage=axis), program_running=False, lost=lost), ours=True)

    for _ in range(3):
        see(5.0)
    with held.commanding() if by == "us" else nullcontext():
        see(3.0, lost=2 if by == "the controller" else 0)
    assert (AxisName.CARRIAGE in held.shifted) is shifted
