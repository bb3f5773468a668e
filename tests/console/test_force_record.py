"""The check by the cutting force in the record: what is written is read again, and how long it stands."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from console.session.force_record import ForceCheck, against_full, force_event, force_of
from profiles.compensations.force_null import ForceNull, Sign, Why, unknown
from tests.console.floor import experiment_1

TURNED = ForceNull(
    sign=Sign.TURNED,
    lobes=3,
    force_n=-0.7 + 0.2j,
    force_sd_n=0.03,
    right_n=-0.6j,
    wrong_n=1.0j,
    mean_n=2.6,
    ratio=0.1 - 0.9j,
    turned_deg=28.0,
    turned_sd_deg=2.5,
    air_turns=6,
    cut_turns=6,
)


@pytest.mark.parametrize("found", [TURNED, replace(TURNED, sign=Sign.AGREES), unknown(3, Why.ROUND)])
def test_what_is_written_is_read_again(found: ForceNull) -> None:
    assert force_of(json.dumps({"strategy": "cam", **force_event(found)})) == found


@pytest.mark.parametrize(
    "data", ["{}", "[]", "{", '{"force_null": 1}', '{"force_null": {"sign": "agrees"}}', '{"force_null": null}']
)
def test_what_another_version_wrote_is_nothing(data: str) -> None:
    assert force_of(data) is None
    assert force_event(None) == {}


@pytest.mark.parametrize(
    ("moved_deg", "code"),
    [
        (0.0, "force.turned"),
        (28.0, None),
        (20.0, None),
        (-28.0, "force.wrong_sign"),  # 56 degrees of spindle are 168 of the lobe
        (148.0, None),
        (15.0, "force.turned"),
    ],
)
def test_it_stands_until_jaw_1_is_where_the_force_has_it(moved_deg: float, code: str | None) -> None:
    """Ten degrees of spindle are 30 of a lobe of three; 120 degrees further on is the same lobe."""
    said = against_full(TURNED, moved_deg)
    assert (None if said is None else said.code) == code


def test_it_is_said_of_its_job_alone() -> None:
    job = experiment_1()
    check = ForceCheck(job=job, found=TURNED)
    assert check.contradicts(job) is not None
    assert check.contradicts(replace(job, assumed=())) is not None
    assert check.contradicts(replace(job, lobe_phase_deg=job.lobe_phase_deg + 28.0)) is None
    assert check.contradicts(replace(job, depth_of_cut_mm=0.2)) is None
    assert ForceCheck(job=job, found=replace(TURNED, sign=Sign.AGREES)).contradicts(job) is None
