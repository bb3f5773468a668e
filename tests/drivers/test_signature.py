"""Who controls a machine, in words: written by the console that has claimed it, read by those who look on."""

from __future__ import annotations

import pytest

from drivers.clock import Clock
from drivers.lathe.ownership import ITEMS, read_signature, sign
from drivers.lathe.standing import Signature
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from tests.system.lathe_sites import compact


@pytest.fixture(params=["pmac", "turbo"])
def client(request: pytest.FixtureRequest) -> PmacClient:
    sim = SimulatedLathe(compact(request.param))
    clock: Clock = sim
    made = PmacClient(MemoryLink(sim.connect(), sim), clock)
    made.connect()
    return made


# 15 bytes hold five syllables of Hangul; a sixth is left out whole.
@pytest.mark.parametrize(
    ("name", "read"), [("kim", "kim"), ("김철수", "김철수"), ("가나다라마바", "가나다라마"), ("a" * 40, "a" * 15)]
)
def test_it_is_read_as_it_was_written(client: PmacClient, name: str, read: str) -> None:
    sign(client, Signature(number=2**31 - 1, name=name, host="lathe-2", minute=29_900_000))
    assert read_signature(client, 2**31 - 1) == Signature(
        number=2**31 - 1, name=read, host="lathe-2", minute=29_900_000
    )


def test_another_number_has_not_signed(client: PmacClient) -> None:
    sign(client, Signature(number=4711, name="kim", host="lathe-2", minute=29_900_000))
    assert read_signature(client, 4712) is None


def test_what_no_console_has_written_is_no_name(client: PmacClient) -> None:
    client.request(" ".join(f"{item}=0.5" for item in ITEMS[2:]))
    client.request(f"{ITEMS[0]}=4711 {ITEMS[1]}=-3.5")
    assert read_signature(client, 4711) is None
    client.request(f"{ITEMS[1]}=3")
    assert read_signature(client, 4711) is None
