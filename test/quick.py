"""Which cases of broad tests are quick: a sample drawn by a seed; the others are deep.

Here and not beside the tests, for together they decide what the quick suite costs, and tests of
scenes share what is compiled if all draw the same ones. ``pytest -m ''`` runs every case.
"""

from __future__ import annotations

from collections import defaultdict
from hashlib import sha256
from typing import Any

import pytest

SEED = 1

FIRST = (
    'four_bar_nominal', 'four_bar_clearance', 'slider_crank', 'valve_train', 'geneva', 'gear_pair',
    'gear_rattle', 'planetary', 'pendulum', 'offset_roller_cam', 'dump_truck',
)  # fmt: skip
"""Scenes that stand for the others of their kind, where a test has them."""

HEAVY = (
    'andrews_squeezer', 'bearing_run_up', 'four_bar_governed', 'gear_four_bar', 'groove_cam',
    'loader', 'measured_cam', 'oscillating_roller', 'sliding_cam', 'slider_crank_engine',
    'ten_links', 'whole_machine', '_024', '_066', 'compliant_joints',
)  # fmt: skip
"""What takes seconds to compile is deep, whatever the seed."""

CASES = {
    'grid/test_grid.py::test_a_case_comes_through': 4,
    'hard/test_hard.py::test_hard_case': 12,
    'test_animation.py::test_every_kind_of_machine_makes_a_film': 2,
    'test_bag_states.py::test_every_command_reads_it_or_says_why_not': 8,
    'test_blocks.py::test_what_a_page_says_can_be_run': 3,
    'test_book_mechanisms.py::test_the_gallery_is_right_and_its_scenes_run': 10,
    'test_cam_pairs.py::test_a_follower_keeps_to_its_law_through_all_rows': 4,
    'test_cam_pairs.py::test_forces_are_those_of_newton_and_euler_at_the_drawn_profile': 4,
    'test_cam_pairs.py::test_the_drawn_profile_touches_the_follower': 4,
    'test_cam_profiles.py::test_a_roller_rolled_over_the_drawn_profile_touches_it_everywhere': 4,
    'test_cam_profiles.py::test_the_smallest_base_circle_by_brute_force': 3,
    'test_charts.py::test_every_scene_has_its_charts': 4,
    'test_compliant.py::test_the_film_is_exact_from_the_centre_to_the_wall': 6,
    'test_compliant_level.py::test_books_and_snapshots_of_a_rattling_soft_bearing': 1,
    'test_compliant_level.py::test_no_long_contact_pulls': 1,
    'test_conjugate_action.py::test_the_ratio_of_drawn_teeth_is_constant': 3,
    'test_contact_loss.py::test_figures_and_instants_do_not_depend_on_the_grid': 1,
    'test_contact_loss.py::test_predictions_do_not_depend_on_the_frame': 1,
    'test_cycle.py::test_any_machine_is_told_and_drawn': 1,
    'test_cycle.py::test_any_machine_shakes_its_frame_by_the_rates_of_its_momentum': 2,
    'test_cycle.py::test_plots_go_where_they_are_told': 1,
    'test_display.py::test_arrows_are_the_reactions_of_the_same_run': 1,
    'test_display.py::test_markers_are_what_viewers_accept': 1,
    'test_drawing.py::test_names_do_not_cover_each_other': 4,
    'test_documentation.py::test_the_mobility_in_the_gallery_is_that_of_the_scene': 8,
    'test_edit.py::test_a_value_changes_one_line_and_comes_back_as_yaml': 3,
    'test_edit.py::test_whatever_is_done_to_a_scene_it_stays_one_that_can_be_undone': 2,
    'test_edit.py::test_every_scene_opens_and_a_number_changed_by_the_panel_is_one_line': 3,
    'test_event_loop.py::test_coarse_steps_never_let_the_pin_through': 4,
    'test_every_scene.py::test_every_mechanism_moves_freely_as_inverse_dynamics_wants': 3,
    'test_every_scene.py::test_forces_agree_with_newton_and_euler_for_every_body': 10,
    'test_every_scene.py::test_loops_stay_closed': 10,
    'test_every_scene.py::test_power_of_the_drives_is_the_rate_of_energy': 10,
    'test_every_scene.py::test_rates_and_accelerations_are_derivatives_of_the_positions': 10,
    'test_first_minutes.py::test_a_new_scene_is_the_one_it_was_begun_from': 12,
    'test_gallery.py::test_the_picture_in_the_gallery_is_that_of_the_scene': 8,
    'test_gate.py::test_a_wheel_of_any_number_of_slots_starts_with_a_slot_where_it_belongs': 5,
    'test_gear_mesh.py::test_rattle_agrees_with_another_integrator': 1,
    'test_gear_scenes.py::test_drawn_teeth_touch_and_do_not_overlap_while_they_turn': 1,
    'test_gears.py::test_tips_of_internal_gears_meet_where_the_drawn_teeth_overlap': 1,
    'test_guide.py::test_the_slider_moves_as_in_nine_cartesian_coordinates': 1,
    'test_indexing.py::test_the_wheel_points_at_the_pin_and_rests_between': 5,
    'test_instants.py::test_an_instant_of_change_differs_from_the_one_before_it': 2,
    'test_instants.py::test_all_of_a_sample_is_of_the_side_that_the_rule_names': 3,
    'test_json.py::test_results_are_strict_json': 10,
    'test_four_bar.py::test_a_four_bar_is_known_by_its_loop_however_its_links_are_drawn': 1,
    'test_live_charts.py::test_motion_goes_on_evenly_and_charts_are_full': 1,
    'test_loop_closure.py::test_a_motion_through_a_dead_point_is_found_there': 2,
    'test_measurement_chain.py::test_a_steady_tone_has_the_amplitude_of_the_formula': 7,
    'test_net.py::test_a_scene_moves_as_recorded': 14,
    'test_oscillator.py::test_the_response_is_that_of_an_integrator': 1,
    'test_output.py::test_a_full_disk_ends_in_a_sentence_and_leaves_nothing': 5,
    'test_output.py::test_a_read_only_folder_ends_in_a_sentence': 5,
    'test_printed_equations.py::test_every_formula_is_read_by_another_program': 1,
    'test_printed_equations.py::test_latex_is_balanced': 14,
    'test_printed_equations.py::test_motion_that_is_solved_fulfils_the_printed_equations': 1,
    'test_printed_equations.py::test_printed_closures_and_gaps_are_those_of_the_engine': 6,
    'test_printed_equations.py::test_printed_equations_of_motion_are_those_of_the_engine': 12,
    'test_printed_equations.py::test_printed_text_alone_gives_accelerations_and_drive_forces': 2,
    'test_random_cams_and_gears.py::test_a_driven_cam_moves_and_presses_as_its_law_asks': 3,
    'test_random_cams_and_gears.py::test_followers_that_lift_off_keep_their_books': 1,
    'test_random_cams_and_gears.py::test_rollers_in_grooves_keep_their_books': 1,
    'test_random_cams_and_gears.py::test_trains_turn_press_and_rattle_by_the_book': 2,
    'test_random_mechanisms.py::test_a_loose_joint': 1,
    'test_random_mechanisms.py::test_forces_and_books': 4,
    'test_random_mechanisms.py::test_gears': 2,
    'test_records.py::test_the_machine_of_every_scene_comes_back_from_its_description': 8,
    'test_report_page.py::test_nothing_overlaps_or_sticks_out': 1,
    'test_scenes.py::test_every_scene_of_the_package_loads_checks_and_runs': 16,
    'test_singular_dynamics.py::test_a_load_may_begin_and_end_at_a_change_point': 1,
    'test_singular_dynamics.py::'
    'test_a_parallelogram_moved_by_a_torque_goes_through_its_change_points': 2,
    'test_singular_dynamics.py::'
    'test_a_window_collapses_into_a_line_ten_times_and_keeps_its_branch': 1,
    'test_sliding_cams.py::test_a_follower_keeps_to_its_law_there_and_back': 2,
    'test_sliding_cams.py::test_a_roller_rattles_between_the_drawn_walls_of_a_groove': 1,
    'test_sliding_cams.py::test_a_thrown_wedge_bounces_as_the_second_route': 1,
    'test_sliding_cams.py::test_forces_are_those_of_newton_and_euler_at_the_drawn_profile': 5,
    'test_sliding_cams.py::test_the_drawn_profile_touches_the_follower': 5,
    'test_start_values.py::test_any_start_value_is_honoured_or_refused': 4,
    'test_stream.py::test_eight_nodes_a_step_are_as_good_as_twelve': 3,
    'test_terminal.py::test_long_work_says_what_it_does_to_a_terminal_only': 4,
    'test_workshop_commands.py::test_gears_are_drawn_in_the_middle_of_their_backlash': 1,
}
"""How many cases of a test are quick."""


def _order(case: str) -> tuple[int, bytes]:
    first = FIRST.index(case) if case in FIRST else len(FIRST)
    return first, sha256(f'{SEED} {case}'.encode()).digest()


def mark(items: list[Any]) -> None:
    """Mark what is not drawn as deep."""
    found: dict[str, list[Any]] = defaultdict(list)
    for item in items:
        name = item.nodeid.partition('[')[0].removeprefix('test/')
        if name in CASES and item.get_closest_marker('deep') is None:
            found[name].append(item)
    for name, cases in found.items():
        light = [c for c in cases if not any(word in c.callspec.id for word in HEAVY)]
        drawn = sorted(light, key=lambda c: _order(c.callspec.id))[: CASES[name]]
        for case in cases:
            if case not in drawn:
                case.add_marker(pytest.mark.deep)
