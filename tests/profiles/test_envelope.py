"""How fast a lobe may be cut: tabulated speeds for each limit of the paper's tool axis with three jaws."""

from dataclasses import replace

import numpy as np
import pytest

from profiles.axis.envelope import envelope, envelope_row, first_beyond
from profiles.axis.servo import eq9_response, tool_compliance_um_per_n
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

JOB = load_job("lee-2001-experiment-1").job
LATHE = load_machine("lee-2001-lathe").machine

TABLE = """
5    | 28500 | 15301 | 28542 | 22507 | 16282 | 11078
16.5 | 15688 | 8423  | 15711 | 12390 | 10905 | 7396
27.5 | 12152 | 6524  | 12170 | 9597  | 9179  | 6210
50   | 9012  | 4838  | 9025  | 7117  | 7494  | 5050
100  | 6372  | 3420  | 6381  | 5032  | 5911  | 3955
200  | 4505  | 2417  | 4511  | 3558  | 4645  | 3073
500  | 2848  | 1527  | 2852  | 2250  | 3346  | 2158
1000 | 2013  | 1077  | 2015  | 1591  | 2581  | 1611
"""
ROWS = [[float(word) for word in line.split("|")] for line in TABLE.strip().splitlines()]


def with_bus(volts: float | None) -> MachineProfile:
    return replace(LATHE, tool=replace(LATHE.tool, bus_voltage_v=volts))


@pytest.mark.parametrize("row", ROWS, ids=[f"{row[0]:g} um" for row in ROWS])
def test_speeds(row: list[float]) -> None:
    amplitude_um, *speeds = row
    high, low = (envelope_row(with_bus(volts), amplitude_um, 3).rpm for volts in (300.0, 100.0))
    names = ("peak_thrust", "heat", "current", "encoder_acceleration", "voltage")
    met = [*(high[name] for name in names), low["voltage"]]
    assert met == pytest.approx(speeds, rel=2e-4, abs=1.0)


@pytest.mark.parametrize(("share", "rpm"), [(0.02, 29), (0.05, 69), (0.10, 126), (0.20, 230), (0.50, 590)])
def test_a_plain_sine_through_eq_9(share: float, rpm: float) -> None:
    hz = first_beyond(lambda f: np.abs(1 - eq9_response(LATHE, f)), share, 1000.0)
    assert hz is not None
    assert 20 * hz == pytest.approx(rpm, abs=0.6)


def test_the_job_in_the_envelope() -> None:
    """At 50 Hz 27.5 um need 13 of 2000 N: nothing of the motor binds, but how far the command runs ahead does."""
    found = envelope(JOB, LATHE)
    assert "voltage" not in found.at_job.rpm
    assert found.at_job.binding == "following_error"
    assert found.percent["following_error"] == pytest.approx(100_000 / found.at_job.rpm["following_error"])
    assert found.percent["peak_thrust"] == pytest.approx(100 * 1000 / 12152, rel=1e-3)
    assert found.plain_sine_rpm is not None and found.plain_sine_rpm < 150
    six = envelope(replace(JOB, jaws=6), LATHE)
    assert six.at_job.rpm["heat"] == pytest.approx(found.at_job.rpm["heat"] / 2)


def test_a_job_without_a_lobe_is_always_within_its_tolerance() -> None:
    assert envelope(replace(JOB, lobe_error_um_pp=0.0), LATHE).plain_sine_rpm is None


def test_the_tool_gives_way_to_a_force() -> None:
    found = tool_compliance_um_per_n(LATHE, [10.0, 50.0])
    assert np.abs(found) == pytest.approx([7.545, 1.4951], abs=5e-4)
    assert np.degrees(np.angle(found[1])) == pytest.approx(-124.2, abs=0.05)
    proportional = replace(LATHE, tool=replace(LATHE.tool, gain_ki_v_per_m_s=0.0))
    assert tool_compliance_um_per_n(proportional, 0.0) == pytest.approx(10.857, abs=5e-4)
