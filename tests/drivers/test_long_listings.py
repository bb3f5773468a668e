"""Listings that take their time, and those that never end: how long they are waited for, in the card's time."""

from __future__ import annotations

import pytest

from drivers.commissioning.reading import LISTING_TIMEOUT_S, ask_or_none
from drivers.errors import ControllerError, DriverError, LinkError
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC
from tests.drivers.test_link_faults import Bench, Spoil
from tests.drivers.test_link_faults import bench as bench

LOOK_S = 0.001
"""Simulated time from one piece to the next."""

SOON_S = 20.0
"""How long `console doctor` may wait for one listing of a controller that is broken."""


def paced(said: bytes, bytes_s: float) -> list[bytes]:
    """The answer at a rate of its line."""
    gap = [b""] * round(1.0 / bytes_s / LOOK_S)
    return [piece for n in range(len(said)) for piece in (*gap, said[n : n + 1])]


def listed(client: PmacClient) -> tuple[str, ...] | None:
    return ask_or_none(client, "LIST PLC3", LISTING_TIMEOUT_S)


LINES = tuple(f"P{number}=P{number}+{number}" for number in range(101, 191))
"""1.1 kB."""


@pytest.fixture
def with_plc(bench: Bench) -> Bench:
    bench.client.download(("OPEN PLC3 CLEAR", *LINES, "CLOSE"))
    return bench


@pytest.mark.parametrize("baud_rate", [1200, 9600])
def test_a_listing_may_take_as_long_as_its_line_takes(with_plc: Bench, baud_rate: int) -> None:
    with_plc.line.spoil = lambda said: paced(said, baud_rate / 10.0)
    began_s = with_plc.sim.now_s()
    found = listed(with_plc.client)
    assert found is not None
    assert [line.strip() for line in found[: len(LINES)]] == list(LINES)
    took_s = with_plc.sim.now_s() - began_s
    assert took_s > 8.0 if baud_rate == 1200 else took_s < 2.0


BROKEN: dict[str, Spoil] = {
    "silent": lambda _: [],
    "silent in the middle": lambda said: [said[:500]],
    "a byte now and then": lambda said: paced(said, 3.0),
    "without an end": lambda _: [(b"1" * 5999 + b"\r") * 3] * 400,
    "nonsense": lambda _: [b"\xff\xfe" * 20],
}


@pytest.mark.parametrize("bench", [PMAC], indirect=True, ids=["pmac"])
@pytest.mark.parametrize("spoil", BROKEN.values(), ids=BROKEN)
def test_a_controller_that_does_not_finish_is_not_waited_for(with_plc: Bench, spoil: Spoil) -> None:
    """It stays as it is: the way back in step is no longer than that of any other line."""
    line, began_s = with_plc.line, with_plc.sim.now_s()
    take_output = line.take_output

    def spoilt() -> bytes:
        line.spoil = spoil
        return take_output()

    line.take_output = spoilt  # type: ignore[method-assign]
    with pytest.raises(LinkError) as error:
        listed(with_plc.client)
    assert error.value.problems[0].code in ("link.not_in_step", "link.silent", "link.out_of_step")
    assert with_plc.sim.now_s() - began_s < SOON_S


def test_how_long_it_was_waited_for_is_what_is_told(with_plc: Bench) -> None:
    with_plc.line.spoil = lambda _: []
    with pytest.raises(LinkError) as error:
        with_plc.client.request("LIST PLC3", LISTING_TIMEOUT_S)
    assert error.value.problems[0].value == "5 s"


def test_over_a_link_that_is_gone_nothing_is_asked_a_second_time(
    with_plc: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    from profiles.problem import Problem

    def gone(_: float) -> bytes:
        raise LinkError(Problem(code="link.closed"))

    monkeypatch.setattr(with_plc.client.link, "receive", gone)
    with_plc.line.sent.clear()
    with pytest.raises(DriverError) as error:
        listed(with_plc.client)
    assert error.value.problems[0].code == "link.closed"
    assert not any(b"P1001" in sent for sent in with_plc.line.sent)


@pytest.mark.parametrize("number", [0, 1, 19, 20, 63, 999])
def test_every_refusal_has_a_sentence_with_its_number(bench: Bench, number: int) -> None:
    from console.text.catalogue import LANGUAGES, load

    bench.line.spoil = lambda _: [b"\x07ERR%03d\r" % number]
    with pytest.raises(ControllerError) as refused:
        bench.client.request("LIST PLC5")
    (problem,) = refused.value.problems
    assert refused.value.error_number == number
    for language in LANGUAGES:
        said = load(language).problem(problem)
        assert f"ERR{number:03d}" in said and "LIST PLC5" in said
        assert problem.code not in said
