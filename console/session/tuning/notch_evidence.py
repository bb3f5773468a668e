"""What health tests with a notch filter show of it: how the controller reads its coefficients.

A wrong reading shows in the numbers of a test; with a first filter the loop is stable by each of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from console.session.data.health import kept_tests
from drivers.identification.health import HealthResult
from profiles.arrays import floats
from profiles.axis.notch import SignConvention
from profiles.axis.sampled_loop import AxisPlant, SampledLoop, loop_of
from profiles.axis.servo_gains import NOTCH_NUMBERS, complete_settings, with_variables
from profiles.axis.step_figures import MOST_LEFT, GatheredStep, left_by, reading_of
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

MOST_TESTS = 50


NO_FIRMWARE = ("", "")  # where nobody has asked the controller for its version and type


def seen_reading(
    machine: MachineProfile, data: Path, plant: AxisPlant, firmware: tuple[str, str], *, simulated: bool
) -> SignConvention | None:
    """Return how the newest test with a filter shows that it is read; None where none tells.

    A test of another firmware, or one that fits no reading of this axis, tells nothing.
    """
    try:
        tests = kept_tests(data, machine.name, MOST_TESTS)
    except ProfileError:
        return None
    for kept in tests:
        test = kept.result
        if test is None or test.origin.simulated is not simulated:
            continue
        if not same_firmware(firmware, test):
            continue
        tested = with_variables(machine, complete_settings(machine, test.origin.gains))
        loop = loop_of(tested, plant)
        if loop.gains.notch:
            left = left_by(loop, gathered_step(test))
            reading = reading_of(left)
            if reading is not None and left[reading] <= MOST_LEFT:
                return reading
    return None


def same_firmware(firmware: tuple[str, str], test: HealthResult) -> bool:
    """Whether a test was made on this firmware (version and type); any counts where that is not known."""
    return firmware in (NO_FIRMWARE, (test.origin.version, test.origin.kind))


def filter_doubts(test: HealthResult, loop: SampledLoop, motor: int) -> Iterator[Problem]:
    """Yield why a test does not prove the filter of the loop of a motor; nothing where the loop has none."""
    if not loop.gains.notch:
        return
    left = left_by(loop, gathered_step(test))
    reading, value = reading_of(left), _percent(left[SignConvention.STATED])
    if reading is not None and reading is not SignConvention.STATED:
        names = misread(reading, motor)
        yield Problem(code="trial.read_otherwise", key=names, value=value, limit=_percent(left[reading]))
    elif reading is None:
        yield Problem(code="trial.notch_undecided", value=value)
    elif left[SignConvention.STATED] > MOST_LEFT:
        yield Problem(code="trial.disagrees", value=value, limit=f"<= {_percent(MOST_LEFT)}")


def format_residual(test: HealthResult, loop: SampledLoop) -> str:
    """Return as text how much of the step of a test the model leaves, its coefficients read as stated."""
    return _percent(left_by(loop, gathered_step(test))[SignConvention.STATED])


def misread(reading: SignConvention, motor: int) -> str:
    """Return the names of the coefficients whose signs a controller reads otherwise."""
    numbers = {SignConvention.NUMERATOR: NOTCH_NUMBERS[:2], SignConvention.DENOMINATOR: NOTCH_NUMBERS[2:]}
    return ", ".join(f"I{motor}{number}" for number in numbers.get(reading, NOTCH_NUMBERS))


def _percent(left: float) -> str:
    return f"{100.0 * left:.2g} %"


def gathered_step(test: HealthResult) -> GatheredStep:
    """Return the step of a test as it is judged."""
    return GatheredStep(
        reference_um=floats(test.reference_um), position_um=floats(test.position_um), step_um=test.step_um
    )
