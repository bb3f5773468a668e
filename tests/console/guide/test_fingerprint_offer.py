"""When a fingerprint is offered, and whether it keeps what the offer says."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from console.session.cut.alignment import Alignment
from console.session.guide.fingerprint_offer import fingerprint_offer
from console.session.guide.situation import Situation
from console.session.learning.fingerprint import fingerprint_cut
from console.session.stages import nominal_path
from console.session.work import Work
from drivers.cutting.strategy import UNCOMPENSATED, Strategy
from drivers.preview.preview import preview
from profiles.compensations.learned_compensation import HoldsFor, LearnedCompensation, PartReading
from profiles.compensations.path import PathHarmonic
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from tests.tui.align_stage import VALID, state
from tests.tui.stage import experiment


def after_a_part(lobe_sd_um: float = 0.3, **changes: object) -> Work:
    """Experiment 1 with the path of its model, which a part has confirmed as well as this."""
    work = replace(experiment(), **changes)  # type: ignore[arg-type]
    job, strategy = work.job, Strategy(work.strategy)
    lobe = PathHarmonic(lobes=3, amplitude_um=0.0, phase_deg=0.0)
    target = PathHarmonic(lobes=3, amplitude_um=0.5 * job.lobe_error_um_pp, phase_deg=job.lobe_phase_deg)
    learned = LearnedCompensation(
        holds_for=HoldsFor(
            job="j", job_sha256="a", machine="m", machine_sha256="b", simulated=True, strategy=work.strategy
        ),
        version=1,
        parent=0,
        gain=0.5,
        path=nominal_path(job, work.machine.machine, strategy, None),
        part=PartReading(version=0, fraction=1.0, target=target, lobe=lobe, lobe_sd_um=lobe_sd_um, ront_um=5.0),
        date="2001-11-30T14:05:00Z",
    )
    return replace(work, compensation=learned)


def situation(work: Work, alignment: Alignment = VALID) -> Situation:
    return Situation(state=state(alignment), work=work, machine=work.machine.machine)


def readings_at(job: Job, places: int) -> ClampReadings:
    """Return the lobe of the job at rest from finger-tight on, of a dial of 1 um, from jaw 1 on."""
    angles = [360.0 * place / places for place in range(places)]
    height = 0.95 * 0.5 * job.lobe_error_um_pp * 1314.0 / 1084.0
    return ClampReadings(
        angle_deg=tuple(angles),
        finger_um=(0.0,) * places,
        full_um=tuple(float(round(-height * math.cos(math.radians(3 * angle)))) for angle in angles),
        from_jaw_1=True,
        graduation_um=1.0,
    )


def test_after_a_part_the_clamping_is_most_of_what_is_left_and_the_offer_is_kept() -> None:
    work = after_a_part()
    offer = fingerprint_offer(situation(work))
    assert offer is not None and (offer.places, offer.minutes(reads_itself=False)) == (7, 3.5)
    assert offer.minutes(reads_itself=True) < 2.0
    # 5 % of a lobe of 55 um that the speed makes 6.1 %, +- 1.96, and what the job does not know of it.
    assert 6.5 < offer.now_um < 13.0
    found = fingerprint_cut(
        readings_at(work.job, offer.places),
        work.job,
        work.job,
        work.machine.machine,
        Strategy(work.strategy),
        history=(work.compensation,) if work.compensation else (),
    )
    assert 2.0 * 1.96 * found.clamped.sd_um == pytest.approx(offer.then_um, rel=0.15)
    assert offer.then_um < 0.8 * offer.now_um


def test_it_is_not_offered_where_something_else_is_more_or_nothing_would_follow_it() -> None:
    assert fingerprint_offer(situation(after_a_part(lobe_sd_um=4.0))) is None, "the gauge scatters more"
    assert fingerprint_offer(situation(after_a_part(stage="air"))) is None
    assert fingerprint_offer(situation(replace(after_a_part(), strategy=UNCOMPENSATED.value))) is None
    read = replace(VALID, readings=readings_at(experiment().job, 7))
    assert fingerprint_offer(situation(after_a_part(), read)) is None, "it was taken"
    assert fingerprint_offer(situation(after_a_part(), Alignment(settings=()))) is None, "nothing is clamped"
    armed = situation(after_a_part())
    assert fingerprint_offer(replace(armed, work=None)) is None


def test_before_any_part_the_friction_that_is_assumed_is_more_than_the_clamping() -> None:
    work = experiment()
    seen = preview(work.job, work.machine.machine)
    assert fingerprint_offer(situation(replace(work, outlook=seen, preview=seen))) is None
    assert fingerprint_offer(situation(work)) is None, "nothing is computed yet"
