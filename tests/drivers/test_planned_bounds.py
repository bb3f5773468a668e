"""Bounds of plans, the health of the tool, and the words of the user buffer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.backup import backup_text, read_backup, typed_lines
from drivers.commissioning.comparison import differences
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.restoring import left_differing, refuse_other_memory, restore, restore_lines
from drivers.commissioning.user_buffer import UserWords, read_place, read_words, word_lines
from drivers.cutting.bounds import UNTRIMMED, Trim
from drivers.cutting.feed_hold import turns_back
from drivers.cutting.guarding import cut_guard
from drivers.cutting.live_trim import subtract_trim, trim_um
from drivers.cutting.override import bounds_of
from drivers.cutting.planning import Strategy, plan_cut
from drivers.errors import LinkError, RefusedError
from drivers.identification.health import (
    HealthRequest,
    HealthResult,
    as_table,
    check_health,
    from_table,
    health_problems,
)
from drivers.identification.nominal import path_response
from drivers.lathe.heartbeat import cut_condition
from drivers.lathe.snapshot import AxisName
from drivers.lathe.standstill import rest_limits
from drivers.lathe.stop import StoppedError
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.plant.true_parameters import ideal
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import ProblemError, ProfileError
from profiles.store import load_machine
from profiles.strict_values import rename_keys
from tests.drivers.commissioned import Commissioned, Stand, commissioned, ready
from tests.drivers.conftest import JobMaker
from tests.drivers.cut_floor import with_inverter
from tests.drivers.families import ON_ONE, of_family
from tests.drivers.families import machine as machine
from tests.drivers.test_limits_of_a_cut import commanded, polled


@ON_ONE
def test_no_override_is_wider_than_a_fifth(machine: MachineProfile, experiment: JobMaker) -> None:
    """At 80 % a program takes 1.25 times its time, of the 1.5 times that it is given."""
    job = replace(experiment(1), cut_length_mm=1.0, spindle_speed_rpm=300.0, lobe_spindle_speed_rpm=300.0)
    found = bounds_of(plan_cut(job, machine, Strategy.NONE), job, machine, path_response(Strategy.NONE, machine))
    assert (found.low_percent, found.low_by) == (80, "widest")
    assert (found.high_percent, found.high_by) == (120, "widest")


@ON_ONE
def test_a_speed_that_is_too_fast_is_refused_with_the_fastest_that_is_not(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    job = replace(experiment(1), jaws=12, spindle_speed_rpm=1500.0)
    with pytest.raises(ProblemError) as refused:
        plan_cut(job, machine, Strategy.PVT)
    limit = refused.value.problems[0].limit
    fastest = int(limit.removeprefix("<= ").removesuffix(" rpm"))
    assert 1 < fastest < 1500

    def code(rpm: float) -> str:
        try:
            plan_cut(replace(job, spindle_speed_rpm=rpm), machine, Strategy.PVT)
        except ProblemError as error:
            return error.problems[0].code
        return ""

    assert code(fastest + 1.0) == "program.too_fast" != code(float(fastest))


@ON_ONE
def test_a_trim_is_in_the_path_and_taken_out_of_a_poll(machine: MachineProfile, experiment: JobMaker) -> None:
    """10 % of a lobe of 27.5 um, at its crest in full, a quarter of a lobe on nothing; a count is 0.2 um."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    crest_deg, amplitude_um = plan.target.phase_deg, plan.target.amplitude_um
    assert amplitude_um == pytest.approx(27.5, rel=0.01)
    angles = [crest_deg + 120.0 / 8.0 * eighth for eighth in range(8)]
    most = max(angles, key=lambda each: abs(trim_um(plan, Trim(gain_percent=10.0), each)))
    found_um = trim_um(plan, Trim(gain_percent=10.0), most)
    assert abs(found_um) == pytest.approx(2.75, rel=0.01)
    assert trim_um(plan, Trim(gain_percent=10.0), most + 30.0) == pytest.approx(0.0, abs=1e-6)
    assert trim_um(plan, UNTRIMMED, most) == 0.0
    spindle = commanded(most / 360.0 * machine.spindle.counts_per_rev)
    poll = polled(0.0, tool=commanded(1000.0), spindle=spindle)
    assert subtract_trim(poll, plan, machine, UNTRIMMED) is poll
    shifted = subtract_trim(poll, plan, machine, Trim(gain_percent=10.0)).tool.position
    assert shifted == pytest.approx(1000.0 - found_um / 0.2, abs=0.01)


@pytest.mark.parametrize("policy", ["retract", "stop", "finish"])
def test_a_program_knows_its_watchdog_unless_it_may_finish(machine: MachineProfile, policy: str) -> None:
    held = replace(machine, heartbeat=replace(machine.heartbeat, policy=policy))
    assert (cut_condition(held) == "") is (policy == "finish")


@ON_ONE
def test_a_foreign_spindle_is_cut_on_by_its_angle_alone(machine: MachineProfile, experiment: JobMaker) -> None:
    """A table on its angle, or its time base: where a program commands the spindle, nothing would turn it."""
    turned, refused = with_inverter(machine), dict[Strategy, tuple[str, str]]()
    for strategy in Strategy:
        try:
            plan_cut(experiment(1), turned, strategy)
        except ProblemError as error:
            refused[strategy] = error.problems[0].code, error.problems[0].limit
    told = "program.not_turned", "cam, timebase"
    assert refused == dict.fromkeys((Strategy.PAPER, Strategy.NONE, Strategy.PVT), told)


@ON_ONE
def test_the_land_of_the_tool_stays_clear_of_the_jaws(machine: MachineProfile, experiment: JobMaker) -> None:
    """Of a land of 0.4 mm half is in front of the place of the tool."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    tool, carriage = replace(machine.tool, wiper_land_mm=0.4), machine.carriage
    furthest_mm = plan.checked.highest[carriage.motor] / carriage.counts_per_mm
    for more_mm, refused in ((0.05, False), (-0.05, True)):
        clearance_mm = carriage.jaw_face_mm - furthest_mm - 0.2 - more_mm
        near = replace(machine, tool=tool, carriage=replace(carriage, jaw_clearance_mm=clearance_mm))
        found = {finding.problem.code for finding in plan_cut(experiment(1), near, Strategy.PVT).findings}
        assert ("cut.near_jaws" in found) is refused


@ON_ONE
def test_what_is_rest_goes_by_the_counts_of_an_axis(machine: MachineProfile) -> None:
    """5 counts/s; of a scale of 5 nm 1 um/s, which are 200 of its counts."""
    assert rest_limits(machine) == dict.fromkeys(AxisName, 5.0)
    for axis in (AxisName.TOOL, AxisName.CARRIAGE):
        finer = replace(getattr(machine, axis.value), counts_per_mm=200_000.0)
        found = rest_limits(replace(machine, **{axis.value: finer}))
        assert found == {**dict.fromkeys(AxisName, 5.0), axis: pytest.approx(200.0)}


@ON_ONE
def test_a_cut_with_a_trim_may_leave_its_plan_by_it(machine: MachineProfile, experiment: JobMaker) -> None:
    """30 um, and 10 % of what the path commands of the lobe: the operator may ask for that at every moment."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    guard, places = cut_guard(plan, machine), plan.checked.highest
    margin_um = 30.0 + 0.1 * plan.command.amplitude_um
    for beyond, codes in ((0.99, []), (1.01, ["cut.outside_plan"])):
        tool = commanded(places[machine.tool.motor] + beyond * margin_um / machine.tool.count_um)
        spindle, carriage = (commanded(places[axis.motor]) for axis in (machine.spindle, machine.carriage))
        assert [each.code for each in guard(polled(0.0, tool=tool, spindle=spindle, carriage=carriage))] == codes


@ON_ONE
def test_after_a_hold_as_many_turns_are_not_judged_as_the_way_out_took_and_two(
    machine: MachineProfile, experiment: JobMaker
) -> None:
    """On its way out the tool cut less and less of the chip, and there it finds less of it again."""
    plan = plan_cut(experiment(1), machine, Strategy.PVT)
    at = plan.checked.motors.index(machine.tool.motor)
    moves = [
        (move.record.target[at], sum(piece.duration_ms for piece in move.pieces)) for move in plan.checked.moves
    ]
    while moves[-2][0] == moves[-1][0]:
        moves.pop()  # the tool is out, the spindle comes to rest
    out_ms, mean_counts = 0.0, plan.setup.surface + plan.setup.depth
    while moves[-1][0] < mean_counts:
        out_ms += moves.pop()[1]
    assert turns_back(plan, machine) == pytest.approx(2.0 + out_ms / 60.0, abs=0.4)  # a lobe is 20 ms


# The health test on the simulated lathe: what it finds, what it refuses, and that it leaves all as it was.

DATE = "2001-11-30T14:05:00.000Z"


def checked(stand: Stand, **changes: float) -> HealthResult:
    return check_health(stand.rig, HealthRequest(**changes), stand.origin, DATE)


@pytest.mark.first(1)
def test_the_nominal_tool_is_as_its_model_and_everything_is_as_before(machine: MachineProfile) -> None:
    stand = ready(machine)
    before = read_configuration(stand.rig.client, stand.rig.dialect, whole_card(stand.rig.dialect))
    found = checked(stand)
    step, model = found.step, found.model
    count_um = machine.tool.count_um
    assert step.size_um == pytest.approx(25.0, abs=0.1)
    assert step.rise_ms == pytest.approx(model.step.rise_ms, abs=0.3)
    assert step.overshoot_percent == pytest.approx(model.step.overshoot_percent, abs=100 * 2 * count_um / 25.0)
    assert step.settling_ms == pytest.approx(model.step.settling_ms, abs=2.0)
    assert found.parabola.peak_um == pytest.approx(model.parabola.peak_um, abs=2 * count_um)
    assert found.parabola.rms_um == pytest.approx(model.parabola.rms_um, abs=count_um)
    # 40 Hz, by the sampled loop: tests/drivers/test_identifying.py has 30 and 50 Hz.
    assert found.sine.gain == pytest.approx(model.gain, rel=0.002)
    assert found.sine.phase_deg == pytest.approx(model.phase_deg, abs=0.2)
    assert 0.88 < model.gain < 0.99
    # The step in the samples that are kept; the tool is back at its zero, nothing of ours is left.
    assert max(found.reference_um) == pytest.approx(25.0, abs=0.05)
    after = read_configuration(stand.rig.client, stand.rig.dialect, whole_card(stand.rig.dialect))
    assert after.settings == before.settings and stand.rig.client.request("LIST PROG998") in ((), ("",), ("RET",))
    snapshot = stand.rig.lathe.snapshot()
    assert abs(snapshot.tool.position) <= 2.0 and snapshot.at_rest and snapshot.loops_closed
    assert from_table(rename_keys(as_table(found), {})) == found


def test_a_heavier_tool_with_friction_is_seen_in_the_figures() -> None:
    machine = load_machine("lee-2001-lathe").machine
    true = ideal(machine)
    heavy = replace(true, moving_mass_kg=1.2 * true.moving_mass_kg, coulomb_friction_n=1.0)
    found = checked(ready(machine, heavy))
    # 20 % more mass needs 20 % more of the error that accelerates it.
    assert found.parabola.rms_um > 1.1 * found.model.parabola.rms_um
    assert abs(found.sine.phase_deg - found.model.phase_deg) > 2.0


@pytest.mark.parametrize(("step_um", "code"), [(51.0, "identify.amplitude"), (1.0, "identify.amplitude")])
def test_what_is_too_large_or_too_small_is_refused_before_anything_is_sent(step_um: float, code: str) -> None:
    machine = load_machine("lee-2001-lathe").machine
    assert [p.code for p in health_problems(HealthRequest(step_um=step_um), machine)] == [code]
    weak = replace(
        machine, controller=replace(machine.controller, variables={**machine.controller.variables, "I111": 300})
    )
    assert "I111" in {p.key for p in health_problems(HealthRequest(), weak)}


def test_with_the_drives_off_nothing_moves(machine: MachineProfile) -> None:
    stand = ready(machine)
    stand.rig.lathe.switch_off()
    stand.line.heard = b""
    with pytest.raises(RefusedError) as refused:
        checked(stand)
    assert refused.value.problems[0].code == "machine.not_enabled"
    assert not any("B998" in line or "OPEN" in line for line in stand.lines)


@pytest.mark.parametrize("after_s", [0.3, 1.3, 2.4])
def test_a_stop_ends_it_at_rest_with_the_drives_off_and_nothing_left(after_s: float) -> None:
    """During the rest before, in the step, in the parabola."""
    stand = ready(load_machine("lee-2001-lathe").machine)
    stop_at_s = stand.sim.now_s() + after_s
    wait = stand.clock.wait

    def stopping(seconds: float) -> None:
        wait(seconds)
        if stand.sim.now_s() >= stop_at_s and stand.stop.reason is None:
            stand.stop.stop("space")

    stand.clock.wait = stopping  # type: ignore[method-assign]
    with pytest.raises(ProblemError) as error:
        checked(stand)
    assert isinstance(error.value, StoppedError), error.value
    assert not stand.drives_on
    assert stand.rig.client.request("LIST PROG998") in ((), ("",), ("RET",))


# The user buffer in a backup: found where the controller says, every word of it kept, sent and compared.

LAST = {"pmac": 0x9FFF, "turbo": 0x107FF}
"""Where the memory for buffers ends: PMAC Software Reference, Memory Map; Turbo Software Reference, I4908."""

BUFFER_DATE = "2026-03-01T12:00:00+00:00"
WORD = st.one_of(st.sampled_from((0, 1, 0x800000, 0xFFFFFF)), st.integers(0, 0xFFFFFF))


def plain(family: str, **changes: object) -> ControllerConfiguration:
    """A configuration of which only the user buffer matters."""
    kind, read = (
        DIALECTS[family].type_prefix,
        ControllerConfiguration(family=family, kind="X", version="1.0", settings={}),
    )
    return replace(read, kind=kind, values={}, **changes)  # type: ignore[arg-type]


def read(card: Commissioned, *, values: bool = True) -> ControllerConfiguration:
    """The user buffer, and what takes no time; the values of P, Q and M are not asked for."""
    extent = replace(whole_card(card.dialect), settings=(), pointers=(), motors=(1,), plcs=(), programs=())
    found = read_configuration(card.client, card.dialect, extent)
    words = read_words(card.client, found.user_buffer) if values and found.user_buffer else None
    return replace(found, values={} if values else None, user_words=words)


def words_of(card: Commissioned, space: str, first: int, count: int) -> list[int]:
    (text,) = card.client.request(f"RH{space}:${first:X},{count}")
    return [int(word, 16) for word in text.split()]


def test_it_is_read_where_the_controller_says(machine: MachineProfile) -> None:
    card = commissioned(machine)
    last = LAST[card.dialect.name]
    assert read_place(card.client, card.dialect) == range(last + 1, last + 1)
    card.tell("DEFINE UBUFFER 35", f"WX:${last - 34:X},$ABCDEF", f"WY:${last:X},7")
    place = read_place(card.client, card.dialect)
    assert place == range(last - 34, last + 1)
    found = read_words(card.client, place)
    assert found == UserWords(x=(0xABCDEF, *[0] * 34), y=(*[0] * 34, 7))


def test_a_backup_is_sent_to_a_fresh_controller_and_to_one_with_other_words(machine: MachineProfile) -> None:
    card = commissioned(machine)
    first = LAST[card.dialect.name] - 299
    card.tell("DEFINE UBUFFER 300", f"WX:${first:X},1,2,3", f"WY:${first + 299:X},$FFFFFF")
    card.tell(f"M9->L:${first + 100:X}", "M9=-2.5")
    text = backup_text(read(card), BUFFER_DATE)
    backup = read_backup(text, "file")
    assert backup_text(backup.configuration, BUFFER_DATE) == text

    for before in ([], ["DEFINE UBUFFER 300", f"WX:${first + 5:X},9,9,9"], ["DEFINE UBUFFER 1000"]):
        other = commissioned(machine)
        other.tell("#1DEFINE COMP 4,#2,#1,10000", "1 2 3 4", *before)
        now = read(other)
        refuse_other_memory(backup, now, "here")
        lines = restore_lines(text, backup, now)
        assert ("DEFINE UBUFFER 300" in lines) == (len(now.user_buffer or ()) != 300)
        restore(other.client, other.dialect, lines)
        assert backup_text(read(other), BUFFER_DATE) == text
        assert words_of(other, "X", first, 8) == [1, 2, 3, 0, 0, 0, 0, 0]
        assert words_of(other, "Y", first + 299, 1) == [0xFFFFFF]
        assert other.client.numbers(f"RL:${first + 100:X}") == (-2.5,)
        assert left_differing(backup.configuration, read(other), machine) == []


def test_a_controller_loses_a_buffer_that_the_backup_does_not_have(machine: MachineProfile) -> None:
    card = commissioned(machine)
    text = backup_text(read(card), BUFFER_DATE)
    backup = read_backup(text, "file")
    card.tell("DEFINE UBUFFER 20")
    now = read(card)
    (found,) = left_differing(backup.configuration, now, machine)
    assert (found.facts["what_changed"], found.found, found.wanted) == ("UBUFFER", "20", "0")
    restore(card.client, card.dialect, restore_lines(text, backup, now))
    assert not read(card).user_buffer


def test_an_older_backup_leaves_the_user_buffer_alone(machine: MachineProfile) -> None:
    """It does not say whether there was one."""
    card = commissioned(machine)
    older = read_backup(backup_text(replace(read(card), user_buffer=None), BUFFER_DATE), "file")
    assert older.configuration.user_buffer is None
    card.tell("DEFINE UBUFFER 20")
    now = read(card)
    refuse_other_memory(older, now, "here")
    assert not any("UBUFFER" in line for line in restore_lines("", older, now))
    assert left_differing(older.configuration, now, machine) == []


def test_the_size_is_compared_without_values_and_each_word_with_them(machine: MachineProfile) -> None:
    card = commissioned(machine)
    last = LAST[card.dialect.name]
    card.tell("DEFINE UBUFFER 16")
    before = read(card)
    card.tell(f"WX:${last - 15:X},$10", f"WY:${last:X},2")
    now = read(card)
    assert differences(before, now, machine) == [], "words are data, as P-variables are"
    found = [
        (each.facts["what_changed"], each.found, each.wanted) for each in left_differing(before, now, machine)
    ]
    assert found == [(f"X:${last - 15:X}", "$10", "$0"), (f"Y:${last:X}", "$2", "$0")]
    card.tell("DEFINE UBUFFER 48")
    (size,) = differences(before, read(card, values=False), machine)
    assert (size.facts["what_changed"], size.found, size.wanted) == ("UBUFFER", "48", "16")
    assert before.fingerprint == now.fingerprint == read(card).fingerprint


@given(st.sampled_from(sorted(DIALECTS)), st.lists(st.tuples(WORD, WORD), max_size=70))
def test_any_words_come_back(family: str, pairs: list[tuple[int, int]]) -> None:
    end = LAST[family] + 1
    place = range(end - len(pairs), end)
    x, y = (tuple(pair[part] for pair in pairs) for part in (0, 1))
    words = UserWords(x=x, y=y) if pairs else None
    text = backup_text(plain(family, user_buffer=place, user_words=words), BUFFER_DATE)
    found = read_backup(text, "file").configuration
    assert (found.user_buffer, found.user_words) == (place, words)
    assert backup_text(found, BUFFER_DATE) == text
    if words is not None:
        assert set(word_lines(place, words)) <= set(typed_lines(text))
        assert max(map(len, word_lines(place, words))) < 255, "a controller takes no longer line"


CHANGES: dict[str, Callable[[str], str]] = {
    "a word that is missing": lambda text: text.replace(",$21\n", "\n"),
    "a line that is missing": lambda text: "".join(line for line in text.splitlines(True) if "WX" not in line),
    "a line twice": lambda text: text.replace("WX", "WX:$9FFE,$1\nWX"),
    "another address": lambda text: text.replace("WY:$9FFE", "WY:$9FF0"),
    "another size": lambda text: text.replace("DEFINE UBUFFER 2", "DEFINE UBUFFER 20000"),
    "another end": lambda text: text.replace("2 words", "3 words"),
    "more than there is": lambda text: text.replace("2 words from $9FFE", "40958 words from $2"),
    "no definition": lambda text: text.replace("DEFINE UBUFFER 2\n", ""),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_backup_that_does_not_fit_together_is_refused(change: Callable[[str], str]) -> None:
    from drivers.commissioning.backup import END_OF_HEADER
    from drivers.commissioning.configuration import digest

    words = UserWords(x=(1, 0x21), y=(3, 4))
    text = backup_text(plain("pmac", user_buffer=range(0x9FFE, 0xA000), user_words=words), BUFFER_DATE)
    assert read_backup(text, "file").configuration.user_words == words
    changed = change(text)
    assert changed != text
    head, body = changed.split(f"{END_OF_HEADER}\n")
    signed = head.replace(head.split("; sha256 ")[1].strip(), digest(body.splitlines()))
    with pytest.raises(ProfileError) as caught:
        read_backup(f"{signed}{END_OF_HEADER}\n{body}", "file")
    assert caught.value.problems[0].code == "controller.backup_line"


def answering(card: Commissioned, monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    """What this controller answers when it is asked for the beginning of its user buffer."""
    client, asked = card.client, card.client.question
    place = card.dialect.user_buffer
    assert place is not None
    line = f"RHX:${place.x_address:X}" if place.setting is None else f"I{place.setting}"

    def question(text: str, *rest: object, **more: object) -> tuple[str, ...]:
        return (answer,) if text == line else asked(text, *rest, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(client, "question", question)


@pytest.mark.parametrize("answer", ["$5", "$FFFFFF"])
def test_a_place_outside_of_memory_is_refused_where_its_words_are_wanted(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    card = commissioned(machine)
    answering(card, monkeypatch, answer.removeprefix("$") if card.dialect.name == "pmac" else answer)
    with pytest.raises(RefusedError) as caught:
        read_configuration(card.client, card.dialect, whole_card(card.dialect, values=True))
    assert caught.value.problems[0].code == "controller.user_buffer"
    now = read(card, values=False)
    assert now.user_buffer is None, "what does not need it continues without"
    monkeypatch.undo()
    (said,) = differences(read(card, values=False), now, card.machine)
    shown = answer.removeprefix("$") if card.dialect.name == "pmac" else answer
    assert (said.code, said.severity, said.found) == ("user_buffer_misplaced", Severity.REFUSAL, shown)


def test_an_answer_of_no_number_is_out_of_step(machine: MachineProfile, monkeypatch: pytest.MonkeyPatch) -> None:
    card = commissioned(machine)
    answering(card, monkeypatch, "what?")
    with pytest.raises(LinkError) as caught:
        read(card)
    assert caught.value.problems[0].code == "link.out_of_step"


def test_a_controller_without_the_word_has_none_in_its_backup(machine: MachineProfile) -> None:
    card = commissioned(machine)
    dialect = replace(card.dialect, user_buffer=replace(card.dialect.user_buffer, setting=9999))  # type: ignore[type-var]
    assert read_place(card.client, dialect) is None
    text = backup_text(replace(read(card), user_buffer=None), BUFFER_DATE)
    assert "user buffer:" not in text and "UBUFFER" not in text


@ON_ONE
def test_a_turbo_with_more_memory_ends_elsewhere(machine: MachineProfile, monkeypatch: pytest.MonkeyPatch) -> None:
    card = commissioned(of_family(machine, "turbo"))
    card.tell("DEFINE UBUFFER 2")
    backup = read_backup(backup_text(read(card), BUFFER_DATE), "file")
    answering(card, monkeypatch, "$3FF00")
    place = read_place(card.client, card.dialect)
    assert place == range(0x3FF00, 0x40000)
    with pytest.raises(RefusedError) as caught:
        refuse_other_memory(backup, replace(backup.configuration, user_buffer=place), "here")
    problem = caught.value.problems[0]
    assert (problem.code, problem.value, problem.limit) == ("controller.user_buffer_end", "$3FFFF", "$107FF")
