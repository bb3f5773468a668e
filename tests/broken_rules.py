"""What `tests.mutations` breaks: rules, each with the text that carries it and the test that stands for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Mutation:
    """`old` stands once in `file`, `new` in its place breaks the `rule`, and `test` notices."""

    rule: str
    file: str
    old: str
    new: str
    test: str


STOP, STOPPING = "drivers/lathe/stop.py", "tests/drivers/test_stopping.py"
LIMITS, BETWEEN = "tests/drivers/test_limits_of_a_cut.py", "tests/console/test_between_two_parts.py"
DISTURBED = "tests/drivers/test_identification_refused.py"
UNEVEN = "tests/profiles/test_roundness.py"
INTERLOCKS = "console/session/cut/interlocks.py"
_STOPPING: tuple[Mutation, ...] = (
    Mutation(
        rule="With hands in the machine every stop is control-K.",
        file=STOP,
        old="if kill or self.inside_guard or not self.loops_closed:",
        new="if kill or not self.loops_closed:",
        test=f"{STOPPING}::test_with_hands_in_the_machine_a_stop_opens_loops_that_are_said_to_be_closed",
    ),
    Mutation(
        rule="Before the controller has said that every loop is closed a stop is control-K.",
        file=STOP,
        old="self.loops_closed = False\n        self.inside_guard = False",
        new="self.loops_closed = True\n        self.inside_guard = False",
        test=f"{STOPPING}::test_before_the_drives_were_seen_a_stop_opens_every_loop",
    ),
    Mutation(
        rule="Behind a control-K every further stop is a control-K.",
        file=STOP,
        old="KILL_ALL if self.killed else ABORT_ALL",
        new="KILL_ALL if kill else ABORT_ALL",
        test=f"{STOPPING}::test_what_is_sent_for_each_state_of_the_drives",
    ),
    Mutation(
        rule="A stop is released only when rest was proven behind the last one.",
        file=STOP,
        old="if proven != len(self._begun):",
        new="if proven > len(self._begun):",
        test="tests/drivers/test_recovery.py::test_a_stop_sent_again_asks_for_a_new_proof",
    ),
    Mutation(
        rule="A running cut that leaves its plan by 30 um is stopped.",
        file="drivers/cutting/guarding.py",
        old="TOOL_MARGIN_UM / tool.count_um",
        new="TOOL_MARGIN_UM * tool.count_um",
        test=f"{LIMITS}::test_a_running_cut_may_leave_its_plan_by_its_margins",
    ),
    Mutation(
        rule="A home search that rests without a zero is over.",
        file="drivers/lathe/standstill.py",
        old="or self._rests >= self.RESTS",
        new="or self._rests > self.RESTS",
        test=f"{LIMITS}::test_a_home_search_is_over_in_position_or_after_three_rests_without_a_zero",
    ),
    Mutation(
        rule="One poll in twelve queries the line of the program.",
        file="drivers/cutting/program_reports.py",
        old="self._polls % POLLS_A_REPORT == 0",
        new="self._polls % POLLS_A_REPORT != 0",
        test=f"{LIMITS}::test_a_program_is_asked_for_its_line_once_in_twelve_polls",
    ),
    Mutation(
        rule="A stop between the two parts of a run begins no second one.",
        file="console/session/cut/run.py",
        old="    context.lathe.stop.check()\n    return run_once",
        new="    return run_once",
        test=f"{BETWEEN}::test_a_stop_after_the_reference_part_begins_no_second_one",
    ),
    Mutation(
        rule="Run shows the time that the program gives the retract.",
        file="console/session/station/progress.py",
        old="max(out_s - begun_s - cut_s, 0.0)",
        new="max(out_s - begun_s + cut_s, 0.0)",
        test=f"{BETWEEN}::test_the_retract_has_the_time_that_the_program_gives_it",
    ),
    Mutation(
        rule="A cut that the controller ends is watched to its end.",
        file="drivers/lathe/motion.py",
        old="                watch(snapshot)\n            self._clock.wait(CUT_POLL_S)",
        new="                pass\n            self._clock.wait(CUT_POLL_S)",
        test="tests/drivers/test_kept_heartbeat.py::"
        "test_a_cut_that_lost_its_host_is_watched_until_the_controller_has_ended_it",
    ),
    Mutation(
        rule="A setting that changed while a response was measured is seen after it.",
        file="drivers/identification/measuring.py",
        old="        found = fingerprint_problems(self._before, self._read(), left_out)",
        new="        found = fingerprint_problems(self._before, self._before, left_out)",
        test=f"{DISTURBED}::test_an_axis_that_another_host_scales_otherwise_is_named_at_the_end",
    ),
    Mutation(
        rule="An override that this console has not commanded stops the cut.",
        file="drivers/cutting/override.py",
        old="return min(self._from, goal), max(self._from, goal)",
        new="return 0.0, 200.0",
        test="tests/console/test_adjusted_cuts.py::test_another_override_than_ours_stops_the_cut",
    ),
    Mutation(
        rule="A trim beyond what was judged is put back by the program.",
        file="drivers/pmac/programs/pvt.py",
        old="P53=P55 P54=P56\nENDIF",
        new="ENDIF",
        test="tests/drivers/test_hold_and_resume.py::test_what_is_beyond_the_bounds_is_put_back_whole",
    ),
    Mutation(
        rule="Rest is proven by polls in which nothing drifts or swings.",
        file="drivers/lathe/standstill.py",
        old="return drift <= limit and scatter",
        new="return drift <= math.inf and scatter",
        test="tests/drivers/test_recovery.py::test_an_axis_that_moves_is_not_at_rest",
    ),
    Mutation(
        rule="A machine is taken over only at rest.",
        file="drivers/lathe/ownership.py",
        old="if not at_rest:",
        new="if at_rest is None:",
        test="tests/drivers/test_ownership.py::test_a_take_over_needs_rest_and_is_seen_by_who_was_pushed_aside",
    ),
    Mutation(
        rule="A console whose number was overwritten does not command any more.",
        file="drivers/lathe/ownership.py",
        old="self.standing = ConsoleRole.OUSTED",
        new="self.standing = ConsoleRole.OWNER",
        test="tests/drivers/test_ownership.py::test_a_take_over_needs_rest_and_is_seen_by_who_was_pushed_aside",
    ),
    Mutation(
        rule="A cut begins with every axis at its start.",
        file=INTERLOCKS,
        old="START_BAND_COUNTS = 10.0",
        new="START_BAND_COUNTS = 10_000.0",
        test="tests/console/test_interlocks.py::test_an_axis_that_is_not_at_its_start_is_named_with_both_places",
    ),
    Mutation(
        rule="A cut begins with zeros that were found.",
        file=INTERLOCKS,
        old='"machine.not_homed": snapshot.homed,',
        new='"machine.not_homed": True,',
        test="tests/console/test_interlocks.py::test_what_the_controller_reports_forbids_the_cut",
    ),
    Mutation(
        rule="A cut begins with every loop closed.",
        file=INTERLOCKS,
        old='"machine.not_enabled": snapshot.loops_closed,',
        new='"machine.not_enabled": True,',
        test="tests/console/test_interlocks.py::test_what_the_controller_reports_forbids_the_cut",
    ),
    Mutation(
        rule="A spindle that is set by hand has the speed of the job.",
        file=INTERLOCKS,
        old="SPEED_BAND = 0.02",
        new="SPEED_BAND = 0.2",
        test="tests/console/test_synchronisation.py::test_a_spindle_at_another_speed_is_not_cut_on",
    ),
    Mutation(
        rule="A device that the controller sees not well forbids motion.",
        file="drivers/lathe/safety.py",
        old="for device, good in inputs.items() if not good",
        new="for device, good in inputs.items() if good is None",
        test="tests/matrix/test_safety_devices.py::test_what_was_armed_is_not_started",
    ),
)

OWNERSHIP, PLANNED = "tests/drivers/test_ownership.py", "tests/console/test_tool_against_its_plan.py"
_CUTTING: tuple[Mutation, ...] = (
    Mutation(
        rule="A late host does not renew the watchdog of another console.",
        file="drivers/lathe/heartbeat.py",
        old="not lost and owner == self._owner and watchdog",
        new="not lost and watchdog",
        test="tests/drivers/test_kept_heartbeat.py::test_a_late_host_renews_only_its_own_watchdog",
    ),
    Mutation(
        rule="What is read right before a motion says who owns the machine.",
        file="drivers/lathe/heartbeat.py",
        old="self._owner_seen(self._owner)",
        new="pass",
        test=f"{OWNERSHIP}::test_a_console_that_lost_control_starts_nothing",
    ),
    Mutation(
        rule="An observer ends no cut.",
        file="drivers/cutting/cut_program.py",
        old="        self._sending.refuse_unless_owner()\n        self.held = True",
        new="        self.held = True",
        test=f"{OWNERSHIP}::test_an_observer_sends_no_command_of_a_cut",
    ),
    Mutation(
        rule="After a cut the override is 100 % again.",
        file="drivers/cutting/cut_program.py",
        old="if self._to_restore or self.override.commanded != REAL_TIME:",
        new="if self._to_restore:",
        test=f"{OWNERSHIP}::test_what_a_cut_has_changed_is_put_back_by_its_owner",
    ),
    Mutation(
        rule="A cut whose heartbeat PLC is silent is ended by its policy.",
        file="drivers/lathe/motion.py",
        old="if not in_cut or heartbeat.policy is Policy.STOP:",
        new="if not in_cut:",
        test="tests/drivers/test_kept_heartbeat.py::test_a_cut_whose_plc_falls_silent_is_ended_by_its_policy",
    ),
    Mutation(
        rule="What shapes a cut is read again and again until its feed ends.",
        file="drivers/cutting/watch_table.py",
        old="                turn.append(item)",
        new="                pass",
        test="tests/drivers/test_watch_table.py::test_the_whole_table_comes_round",
    ),
    Mutation(
        rule="A hold that the line has lost is asked for again.",
        file="drivers/cutting/feed_hold.py",
        old="        except LinkTimeoutError:\n            self._client.request",
        new="        except LinkTimeoutError:\n            str",
        test=f"{LIMITS}::test_what_only_sets_a_value_is_sent_twice_at_most",
    ),
    Mutation(
        rule="After a hold the turns in which the tool finds less of the chip are not judged.",
        file="drivers/cutting/feed_hold.py",
        old="return TURNS_BACK + out_ms(way_mm) / 1000.0 * plan.spindle_speed_rpm / 60.0",
        new="return TURNS_BACK",
        test="tests/drivers/test_planned_bounds.py::"
        "test_after_a_hold_as_many_turns_are_not_judged_as_the_way_out_took_and_two",
    ),
    Mutation(
        rule="A zero that is set on an axis in open loop is no home.",
        file="drivers/lathe/held_positions.py",
        old="still = seen is not None and abs(at - seen) <= self._bands[axis]",
        new="still = False",
        test="tests/drivers/test_path_seen.py::"
        "test_a_zero_that_is_set_on_an_axis_that_nothing_holds_is_found_and_a_hand_is_not_taken_for_it",
    ),
    Mutation(
        rule="In a cut a correction stays that no table of its program moves.",
        file="drivers/cutting/watch_table.py",
        old="corrected = tables_on or any(table.definition.target == motor for table in program.tables)",
        new="corrected = tables_on or bool(program.tables)",
        test="tests/drivers/test_watch_table.py::test_a_correction_is_watched_unless_a_table_moves_it",
    ),
    Mutation(
        rule="The following error that the witness has seen is judged by that of the polls.",
        file="console/session/cut/cut_verdict.py",
        old="if unheld and len(rows) >= LEAST_POLLS:",
        new="if not unheld:",
        test=f"{PLANNED}::test_the_polls_of_a_cut_without_a_hold_are_what_the_following_error_of_its_witness_is_judged_by",
    ),
    Mutation(
        rule="After another console has had control no stamp of the alignment is left.",
        file="console/session/cut/alignment.py",
        old="if alignment.clamping is None and alignment.jaw is None and alignment.touch_off is None:",
        new="if alignment.jaw is None and alignment.touch_off is None:",
        test="tests/console/test_alignment.py::test_behind_another_console_nothing_is_aligned",
    ),
)

LINEAR, PIECES = "drivers/pmac/trajectory/linear.py", "drivers/pmac/trajectory/pieces.py"
BLENDING = "tests/drivers/trajectory/test_linear_moves.py"
EXPRESSIONS = "tests/drivers/language/test_pmac_expressions.py"
_TRAJECTORIES: tuple[Mutation, ...] = (
    Mutation(
        rule="Two S-curves longer than TA set the acceleration time.",
        file=LINEAR,
        old="ta_ms = max(move.ta_ms, 2.0 * move.ts_ms)",
        new="ta_ms = max(move.ta_ms, move.ts_ms)",
        test=f"{BLENDING}::test_acceleration_times_are_two_s_curves_at_least_and_moves_are_no_shorter",
    ),
    Mutation(
        rule="A move shorter than its acceleration takes the acceleration time.",
        file=LINEAR,
        old="max(tm_ms, ta_ms))  # rule 2",
        new="tm_ms)  # rule 2",
        test=f"{BLENDING}::test_acceleration_times_are_two_s_curves_at_least_and_moves_are_no_shorter",
    ),
    Mutation(
        rule="A blend is cut to the room in the move before it.",
        file=LINEAR,
        old="ta_ms = min(ta_ms, 2.0 * blend.room_ms)",
        new="ta_ms = min(ta_ms, 3.0 * blend.room_ms)",
        test=f"{BLENDING}::test_a_long_blend_is_cut_to_the_room_in_the_move_before_it",
    ),
    Mutation(
        rule="Ix16 stretches a move.",
        file=LINEAR,
        old="tm_ms = max(tm_ms, abs(distance) / limit)",
        new="tm_ms = max(tm_ms, distance / limit)",
        test=f"{BLENDING}::test_ix16_stretches_the_move_time",
    ),
    Mutation(
        rule="Ix17 guards the stop that may follow a move.",
        file=LINEAR,
        old="change = max(abs(velocity - was), abs(velocity))",
        new="change = abs(velocity - was)",
        test=f"{BLENDING}::test_ix17_lengthens_the_acceleration_even_for_the_stop_that_may_follow",
    ),
    Mutation(
        rule="A ramp with S-curves has the higher peak of acceleration.",
        file=PIECES,
        old="span_ms = len(start), ta_ms - ts_ms",
        new="span_ms = len(start), ta_ms",
        test="tests/drivers/trajectory/test_linear_moves.py::test_rule_1_to_3_at_the_boundary_the_path_is_off_its_point_by_the_known_share",
    ),
    Mutation(
        rule="A PVT segment is the cubic through its places and its speeds.",
        file=PIECES,
        old="(3.0 * slope - 2.0 * v0 - v1) / duration_ms",
        new="(3.0 * slope - v0 - 2.0 * v1) / duration_ms",
        test="tests/drivers/trajectory/test_spline_pvt_and_rapid_moves.py::test_the_manual_s_building_blocks",
    ),
    Mutation(
        rule="A SPLINE2 weighs its distances by the times of their neighbours.",
        file="drivers/pmac/trajectory/planner.py",
        old="late = here_ms / (joint_ms * (joint_ms + next_ms))",
        new="late = duration_ms / (joint_ms * (joint_ms + next_ms))",
        test="tests/drivers/trajectory/test_spline_pvt_and_rapid_moves.py::test_spline2_is_the_non_uniform_cubic_b_spline",
    ),
    Mutation(
        rule="INT rounds down, also below zero.",
        file="drivers/pmac/language/evaluate.py",
        old='"INT": lambda value: float(math.floor(value))',
        new='"INT": lambda value: float(math.trunc(value))',
        test=f"{EXPRESSIONS}::test_the_examples_of_the_software_reference",
    ),
    Mutation(
        rule="`!>` is also so of what is equal.",
        file="drivers/pmac/language/evaluate.py",
        old='"!>": le',
        new='"!>": lt',
        test=f"{EXPRESSIONS}::test_conditions",
    ),
    Mutation(
        rule="Of words that begin alike the longest is meant.",
        file="drivers/pmac/language/lexer.py",
        old="sorted(words, key=len, reverse=True)",
        new="sorted(words, key=len)",
        test="tests/drivers/language/test_pmac_expressions.py::test_the_longest_word_wins_and_strings_and_comments_keep_what_they_hold",
    ),
    Mutation(
        rule="A comment may hold any character.",
        file="drivers/pmac/language/lexer.py",
        old='if character == ";":',
        new='if character == "|":',
        test="tests/drivers/language/test_pmac_expressions.py::test_the_longest_word_wins_and_strings_and_comments_keep_what_they_hold",
    ),
)

PATH, GRIP = "profiles/compensations/path.py", "profiles/chucking/grip.py"
SERVO, LOOP = "profiles/axis/servo.py", "profiles/axis/sampled_loop.py"
COMPENSATION = "tests/profiles/test_compensation.py"
_SCIENCE: tuple[Mutation, ...] = (
    Mutation(
        rule="The command comes earlier by the lag of the axis.",
        file=PATH,
        old="harmonic.phase_deg + math.degrees(cmath.phase(here)) / harmonic.lobes",
        new="harmonic.phase_deg - math.degrees(cmath.phase(here)) / harmonic.lobes",
        test=f"{COMPENSATION}::test_an_axis_undoes_its_inverse",
    ),
    Mutation(
        rule="Eq 8: the tool goes deeper where the plain cut takes less.",
        file=PATH,
        old="a1_um=-a1_um, b1_um=-b1_um",
        new="a1_um=a1_um, b1_um=b1_um",
        test=f"{COMPENSATION}::test_the_rule_of_eqs_6_10_and_11",
    ),
    Mutation(
        rule="Eq 4: N jaws make N lobes in a turn.",
        file=PATH,
        old="return jaws * spindle_speed_rpm / 60",
        new="return spindle_speed_rpm / 60",
        test=f"{COMPENSATION}::test_eq_4",
    ),
    Mutation(
        rule="The output of the sampled loop acts one period late.",
        file=LOOP,
        old="complexes(held / z * np.exp(-2j * np.pi * hz * self.plant.delay_s))",
        new="complexes(held * np.exp(-2j * np.pi * hz * self.plant.delay_s))",
        test="tests/profiles/test_margins.py::test_the_sampled_loop_is_its_difference_equation",
    ),
    Mutation(
        rule="The derivative of the sampled loop is a backward difference.",
        file=LOOP,
        old="return complexes((1.0 - 1.0 / z) / self.period_s)",
        new="return complexes((z - 1.0) / self.period_s)",
        test="tests/profiles/test_margins.py::test_the_sampled_loop",
    ),
    Mutation(
        rule="A sine costs R I^2 / 2.",
        file=SERVO,
        old="tool.coil_resistance_ohm / 2,",
        new="tool.coil_resistance_ohm,",
        test="tests/profiles/test_margins.py::test_what_a_sine_costs",
    ),
    Mutation(
        rule="The lever of the overhang comes on top of what the cut turns and pushes.",
        file=GRIP,
        old="return slipping_n + lifting_n",
        new="return max(slipping_n, lifting_n)",
        test="tests/profiles/test_grip.py::test_the_grip_that_a_cut_needs_is_against_slipping_and_against_lifting_together",
    ),
    Mutation(
        rule="The jaws lose force with the square of the speed.",
        file=GRIP,
        old="mass_radius_kg_m * (math.pi * spindle_speed_rpm / 30) ** 2",
        new="mass_radius_kg_m * (math.pi * spindle_speed_rpm / 30)",
        test="tests/profiles/test_grip.py::test_centrifugal_force",
    ),
    Mutation(
        rule="Eq 2: a lobe lags by the phase of mass, damping and spring.",
        file="profiles/paper/chuck.py",
        old="math.hypot(spring, dash), math.atan2(dash, spring)\n    even_n",
        new="math.hypot(spring, dash), math.atan2(spring, dash)\n    even_n",
        test="tests/profiles/test_ring.py::test_integrating_eq_2_in_time_stays_on_the_steady_state",
    ),
    Mutation(
        rule="A ring under N jaws bends by N / (pi (n^2 - 1)^2) in its harmonics.",
        file="profiles/chucking/ring.py",
        old="math.pi * (harmonic**2 - 1) ** 2",
        new="math.pi * harmonic**4",
        test="tests/profiles/test_ring.py::test_the_series_is_the_closed_form",
    ),
    Mutation(
        rule="The moment under a jaw is W R (1/h - cot h) / 2.",
        file="profiles/chucking/ring.py",
        old="(1 / h - 1 / math.tan(h))\n    return 6",
        new="(1 / h)\n    return 6",
        test="tests/profiles/test_ring.py::test_the_stress_under_a_jaw_is_that_of_finite_elements",
    ),
    Mutation(
        rule="Faster gains need responses in which no flexible mode can hide.",
        file="profiles/axis/loop_design.py",
        old="HIDDEN_CHANGE = 0.7",
        new="HIDDEN_CHANGE = 1e9",
        test="tests/profiles/test_loop_design.py::test_responses_without_a_mode_refuse_faster_gains_and_softer_ones_have_less",
    ),
    Mutation(
        rule="A flexible mode of the axis is in the loop that gains are designed for.",
        file="profiles/axis/plant_fit.py",
        old="and problem.is_resonance(found.values)):",
        new="and not problem.is_resonance(found.values)):",
        test="tests/profiles/test_loop_design.py::test_a_mode_above_the_measured_frequencies_is_found",
    ),
    Mutation(
        rule="Points weigh by the angle that they stand for.",
        file="profiles/metrology/circles.py",
        old="weighed = design * weights",
        new="weighed = design",
        test=f"{UNEVEN}::test_how_the_angles_are_spaced_does_not_change_the_part",
    ),
    Mutation(
        rule="A gap whose bridge may be too far off is refused.",
        file="profiles/roundness.py",
        old="if effect_um > allowed_um:",
        new="if effect_um > 100.0 * allowed_um:",
        test=f"{UNEVEN}::test_a_gap_is_judged_by_its_effect",
    ),
    Mutation(
        rule="Neighbouring outliers are a feature and stay in the verdict.",
        file="profiles/roundness.py",
        old="        dirt[places] = False",
        new="        dirt[places] = True",
        test=f"{UNEVEN}::test_neighbouring_outliers_are_a_feature_and_stay",
    ),
    Mutation(
        rule="The filter lets half of its cut-off through.",
        file="profiles/metrology/points.py",
        old="_ALPHA = math.sqrt(math.log(2) / math.pi)",
        new="_ALPHA = math.sqrt(math.log(2)) / math.pi",
        test="tests/profiles/test_roundness.py::test_the_filter",
    ),
    Mutation(
        rule="A V-block adds where the lobes are odd and takes where they are even.",
        file="profiles/metrology/harmonics.py",
        old="sign = -1.0 if lobes % 2 else 1.0",
        new="sign = 1.0 if lobes % 2 else -1.0",
        test="tests/profiles/test_lobe_fit.py::test_factors",
    ),
)

GROUPS: Mapping[str, tuple[Mutation, ...]] = {
    "Stop path and interlocks": _STOPPING,
    "A running cut": _CUTTING,
    "Trajectories and language": _TRAJECTORIES,
    "Science": _SCIENCE,
}
