"""What PLCs wait by: the timers of both families, and the settings that permit and guard them."""

from __future__ import annotations

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.plcs.plc import timer_variables
from drivers.pmac.settings import settings_with
from drivers.pmac.variables import VariableStore


def test_i68_says_for_how_many_systems_the_timers_run() -> None:
    """Turbo User Manual, Timers: coordinate systems 1 to I68 + 1."""
    assert timer_variables(TURBO, 0) == (5111, 5112)
    assert timer_variables(TURBO, 1) == (5111, 5112, 5211, 5212)
    assert timer_variables(TURBO, 15)[-2:] == (6611, 6612)
    assert len(timer_variables(TURBO, 15)) == len(timer_variables(TURBO, 99)) == 32


def test_a_timer_takes_values_of_24_bits_with_a_sign() -> None:
    store = VariableStore(settings_with({}, TURBO), TURBO)
    for written, kept in [(677, 677), (-5, -5), (8_388_607, 8_388_607), (8_388_608, -8_388_608), (1.6, 2)]:
        store.set(VariableKind.I, 5211, written)
        assert store.i(5211) == kept


def test_the_non_turbo_card_has_four_words_of_memory_instead() -> None:
    """User Manual, Precise Timing."""
    assert timer_variables(PMAC, 15) == ()
    assert PMAC.timer_words == (("X", 0x700), ("Y", 0x700), ("X", 0x701), ("Y", 0x701))
    assert TURBO.timer_words == ()


def test_background_plcs_are_off_from_the_factory() -> None:
    """Software Reference, I5: 0; read out of real Turbos: 0."""
    assert (PMAC.factory[5], TURBO.factory[5]) == (0, 0)


def test_the_watchdog_of_each_family() -> None:
    """Turbo: 4096 servo cycles, or one more than I40; non-Turbo: 512 real-time interrupts."""
    assert (TURBO.watchdog.count + 1, TURBO.watchdog.number, TURBO.watchdog.of_interrupts) == (4096, 40, False)
    assert (PMAC.watchdog.count + 1, PMAC.watchdog.number, PMAC.watchdog.of_interrupts) == (512, None, True)
    store = VariableStore(settings_with({}, TURBO), TURBO)
    assert store.i(40) == 0
    store.set(VariableKind.I, 40, 65_536 + 226)
    assert store.i(40) == 226
