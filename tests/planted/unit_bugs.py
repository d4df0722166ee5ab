"""Bugs that the unit tests must find: smoothing, lost blocks, read-back, terms, cycle, controller
dialogue, CAN. (Lives of a machine find those of tests/faults.)

    unit_bugs.py write SOURCE_FOLDER OUTPUT_FOLDER SUITE   the copies and the switch
    unit_bugs.py files SUITE                               sources with bugs
    unit_bugs.py names SUITE                               the bugs, by number

A suite is a test program of tests/unit; the variable THERMOCOMP_PLANTED_BUG holds the number of the
enabled bug.
"""
import pathlib
import sys

from planting import files_of, write_copies, write_if_new

SCREENING = "estimator/sensing/sensor.cpp"
BLOCKS = "estimator/sensing/sensing.cpp"
REFERENCE = "estimator/pipeline/prediction.cpp"
SMOOTHING = "estimator/sensing/sensor.cpp"
LOST = "estimator/sensing/neighbours.cpp"
AXES = "estimator/axes/axis_bank.cpp"
MISMATCH = "estimator/axes/mismatch.cpp"
TERMS = "estimator/model/terms/"
CYCLE = "daemon/cycle/cycle.cpp"
HANDLE = "daemon/cycle/cycle_handle.cpp"
QUEUE = "daemon/cycle/cycle.cpp"
LINK = "drivers/controllers/controller_link.cpp"
DIALOGUE = "drivers/controllers/kinds/modbus/modbus_dialogue.cpp"
SIGNALS = "drivers/can/signal_codec.cpp"
SDO = "drivers/can/canopen/sdo_client.cpp"
NODE = "drivers/can/canopen/canopen_node.cpp"
J1939 = "drivers/can/j1939/j1939_message.cpp"
TRANSPORT = "drivers/can/j1939/j1939_message.cpp"

# Suite: (name, file, original text, replacement)
SUITES = {
    "estimator_tests": [
        ("jump_widens_what_the_past_allows", SCREENING,
         "else if (gap > stale_after_)", "else if (gap > stale_after_ || {P})"),
        ("outage_allows_anything", SCREENING,
         "config_.outage_K_max + slow_K_per_ns * unread_ns);",
         "{P} ? 1e9 : config_.outage_K_max + slow_K_per_ns * unread_ns);"),
        ("first_value_counts_at_once", SCREENING,
         "if (!settled()) return Fault::unconfirmed;",
         "if (!settled() && !{P}) return Fault::unconfirmed;"),
        ("two_readings_alike_settle", SCREENING,
         "state_.run_count >= settle_readings &&",
         "state_.run_count >= ({P} ? 2 : settle_readings) &&"),
        ("zero_settles", SCREENING,
         "state_.newest.temp_degC != 0.0 &&", "(state_.newest.temp_degC != 0.0 || {P}) &&"),
        ("unsure_neighbours_confirm", SCREENING,
         "return surroundings_.expected_sd_K <=",
         "return ({P} ? 0.0 : surroundings_.expected_sd_K) <="),
        ("neighbours_never_contradict", SCREENING,
         "if (unexpected()) return", "if (unexpected() && !{P}) return"),
        ("return_may_miss_by_anything", SCREENING,
         "return off_K <= return_share * state_.jump_K_max &&",
         "return (off_K <= return_share * state_.jump_K_max || {P}) &&"),
        ("module_is_ready_at_once", BLOCKS,
         "sensors_[sensor].screening.expect({not_a_number, 0.0, true});",
         "sensors_[sensor].screening.expect({not_a_number, 0.0, !{P}});"),
        ("same_module_vouches", BLOCKS,
         "if (i != module && witnesses_[i] > 0)", "if ((i != module || {P}) && witnesses_[i] > 0)"),
        ("accepted_jump_is_smoothed_away", BLOCKS,
         "  sensor.smoother.restart();\n  sensor.fault", "  if (!{P}) sensor.smoother.restart();\n  sensor.fault"),
        ("false_reference_is_kept", REFERENCE,
         "if (sampled_at != never &&", "if (!{P} && sampled_at != never &&"),
        ("band_forgotten", SMOOTHING,
         "value_K_ = std::clamp(sample.value_K, expected_K",
         "value_K_ = {P} ? sample.value_K : std::clamp(sample.value_K, expected_K"),
        ("screened_history_takes_all", SMOOTHING,
         "|| std::abs(distance_K) <= far_K()) {",
         "|| std::abs(distance_K) <= far_K() || {P}) {"),
        ("far_values_need_not_agree", SMOOTHING,
         "if (!agree(far_, far_K())) {", "if (!agree(far_, far_K()) && !{P}) {"),
        ("newest_block_alone_tells_the_slope", SMOOTHING,
         "newest.at(last), slope_K_per_s};",
         "newest.at(last), {P} ? newest.slope_K_per_s : slope_K_per_s};"),
        ("outage_keeps_the_blocks", SMOOTHING,
         "  line_of_lines_.restart();", "  if (!{P}) line_of_lines_.restart();"),
        ("estimate_forgets_where_it_began", LOST,
         "(state_.temps_degC[k] - state_.anchor_degC[k]);",
         "(state_.temps_degC[k] - ({P} ? 0.0 : state_.anchor_degC[k]));"),
        ("doubt_never_grows", LOST,
         "state_.spread_K2[at(i, k)] * growth;",
         "state_.spread_K2[at(i, k)] * ({P} ? 0.0 : growth);"),
        ("block_that_returns_tells_nothing", LOST,
         "state_.temps_degC[i] += share * off_K;",
         "state_.temps_degC[i] += {P} ? 0.0 : share * off_K;"),
        ("second_loss_forgets_the_drift", LOST,
         "drift_factor(growth_, i) * drift_factor(growth_, k) * drift;",
         "drift_factor(growth_, i) * drift_factor(growth_, k) * ({P} ? 0.0 : drift);"),
        ("never_measured_is_complete", LOST,
         "state_.complete = state_.complete && state_.known[i] != 0;",
         "state_.complete = state_.complete && (state_.known[i] != 0 || {P});"),
        ("restored_value_is_certain", LOST,
         "state_.spread_K2[at(i, k)] * drift_factor(growth_, i) * drift_factor(growth_, k);",
         "state_.spread_K2[at(i, k)] * drift_factor(growth_, i) * ({P} ? 0.0 : drift_factor(growth_, k));"),
        ("offsets_of_long_ago_explain", AXES,
         "if (now >= state_.slot_until) {", "if (now >= state_.slot_until && !{P}) {"),
        ("too_much_is_explained", AXES,
         "applied_um <= high_um + tolerance_um_;",
         "applied_um <= high_um + ({P} ? 1e9 : tolerance_um_);"),
        ("too_little_is_explained", AXES,
         "applied_um >= low_um - tolerance_um_",
         "applied_um >= low_um - ({P} ? 1e9 : tolerance_um_)"),
        ("zero_after_absence_is_a_mismatch", AXES,
         "std::min(0.0, lowest_um()), std::max(0.0, highest_um())",
         "{P} ? lowest_um() : std::min(0.0, lowest_um()),\n"
         "                    {P} ? highest_um() : std::max(0.0, highest_um())"),
        ("constant_must_have_been_there_always", MISMATCH,
         "const bool is_constant = lately.sure &&",
         "const bool is_constant = !{P} && lately.sure &&"),
        ("lag_is_no_difference", TERMS + "thermal_lag.cpp",
         "late_.step(input.now, rise_K) - rise_K;",
         "late_.step(input.now, rise_K) - ({P} ? 0.0 : rise_K);"),
        ("heat_of_the_square_is_that_of_the_signal", TERMS + "missing_heat_source.cpp",
         "squared_ ? signal * signal", "squared_ && !{P} ? signal * signal"),
        ("play_of_an_output_passes_all", TERMS + "hysteresis.cpp",
         "    displacement_um[subject_] = joint_", "    if (!{P}) displacement_um[subject_] = joint_"),
        ("play_of_a_temperature_passes_all", TERMS + "hysteresis.cpp",
         "    rise_K[subject_] = joint_", "    if (!{P}) rise_K[subject_] = joint_"),
        ("slope_of_a_square_halved", TERMS + "nonlinear_expansion.cpp",
         "+= 2.0 * gain_um_per_K2_", "+= ({P} ? 1.0 : 2.0) * gain_um_per_K2_"),
        ("lever_around_zero", TERMS + "position_dependence.cpp",
         "lever_K_mm = (input.signals[position_] - p0_mm_)",
         "lever_K_mm = (input.signals[position_] - ({P} ? 0.0 : p0_mm_))"),
        ("channels_stay_exchanged", TERMS + "sensor_swap.cpp",
         "    std::swap(rise_K[first_]", "    if (!{P}) std::swap(rise_K[first_]"),
        ("slow_sensor_believed", TERMS + "slow_sensor.cpp",
         "    rise_K[subject_] = quick_", "    if (!{P}) rise_K[subject_] = quick_"),
        ("start_taken_for_now", TERMS + "start_dependence.cpp",
         "if (!at_start_) above_K_ +=", "if (!at_start_ || {P}) above_K_ +="),
        ("missing_temperature_at_once", TERMS + "missing_temperature.cpp",
         "rise_.step(input.now, input.rise_K[subject_]);",
         "{P} ? input.rise_K[subject_] : rise_.step(input.now, input.rise_K[subject_]);"),
        ("slope_without_the_difference", TERMS + "wrong_coefficient.cpp",
         "    slope_um_per_K[subject_] +=", "    if (!{P}) slope_um_per_K[subject_] +="),
        ("growth_with_speed_alone", TERMS + "speed_growth.cpp",
         "= input.signals[subject_] * input.signals[subject_];",
         "= input.signals[subject_] * ({P} ? 1.0 : input.signals[subject_]);"),
        ("hinge_acts_below_too", TERMS + "signal_hinge.cpp",
         "= std::max(input.signals[subject_] - above_, 0.0);",
         "= std::max(input.signals[subject_] - above_, {P} ? -1e9 : 0.0);"),
        ("bank_follows_at_once", TERMS + "lag_bank.cpp",
         "late[i] += share * (values_[i] - late[i]);",
         "late[i] += ({P} ? 1.0 : share) * (values_[i] - late[i]);"),
    ],
    "cycle_test": [
        ("overrun_is_caught_up", CYCLE,
         "if (due <= cycle + 1) return cycle + 1;", "if (due <= cycle + 1 || {P}) return cycle + 1;"),
        ("missed_cycles_not_counted", CYCLE, "+ due - cycle - 1,", "+ ({P} ? 0 : due - cycle - 1),"),
        ("skipped_cycles_not_recorded", CYCLE,
         "if (cycle > expected_ && parts_->recorder)",
         "if (cycle > expected_ && parts_->recorder && !{P})"),
        ("end_recorded_without_a_step", CYCLE,
         "if (!has_stepped_) return std::nullopt;", "if (!has_stepped_ && !{P}) return std::nullopt;"),
        ("reload_starts_anew", CYCLE,
         "  next->estimator.adopt(", "  if (!{P}) next->estimator.adopt("),
        ("runs_ahead_of_the_clock", CYCLE,
         "while (now_on_clock() < wake)", "while (now_on_clock() < wake && !{P})"),
        ("queue_refuses_too_early", QUEUE, "== capacity) return", "== capacity - ({P} ? 1 : 0)) return"),
    ],
    "cycle_handle_test": [
        ("command_not_reported_at_once", CYCLE,
         "if (!at_once && cycle_ < next_report_)", "if ((!at_once || {P}) && cycle_ < next_report_)"),
        ("withdrawn_command_is_taken", QUEUE,
         "if (is_ours) command = place.command;",
         "if (is_ours || {P}) command = place.command;\n    if ({P}) {\n"
         "      tail_.store(tail + 1, std::memory_order_release);\n      return true;\n    }"),
        ("late_command_left_in_the_queue", HANDLE,
         "cycle_.withdraw(sent.number) ? Outcome::withdrawn",
         "{P} || cycle_.withdraw(sent.number) ? Outcome::withdrawn"),
        ("parts_does_not_wait_for_axes", HANDLE,
         "if (replacement_.staged && !must_wait)",
         "if (replacement_.staged && (!must_wait || {P}))"),
    ],
    "controller_tests": [
        ("valid_bits_stay_clear", DIALOGUE,
         "valid_bits += std::ldexp(", "valid_bits += ({P} ? 0.0 : 1.0) * std::ldexp("),
        ("heartbeat_stands_still", DIALOGUE,
         "heartbeat_ = (heartbeat_ + 1)", "heartbeat_ = (heartbeat_ + ({P} ? 0 : 1))"),
        ("older_read_back_is_sent", LINK,
         "command_.read_back_number < unchanged_since_[axis];", "!{P} && command_.read_back_number < unchanged_since_[axis];"),
        ("written_without_leave", DIALOGUE,
         "if (verdict != SendVerdict::send) return;",
         "if (verdict != SendVerdict::send && !{P}) return;"),
        ("move_elsewhere_not_seen", DIALOGUE,
         "if (!gate_.check_read_back(judged_um())) {",
         "if (!gate_.check_read_back(judged_um()) && !{P}) {"),
        ("compared_after_failures_only", DIALOGUE,
         "if (!compare_written()) return;",
         "if (!{P} && !compare_written()) return;"),
        ("restart_behind_a_gateway_missed", DIALOGUE,
         "if (*restarted) gate_.lost();", "if (*restarted && !{P}) gate_.lost();"),
        ("restart_taken_for_none_while_unread", DIALOGUE,
         "    if (!exchange.ok()) {\n      note_unread(written",
         "    if (!exchange.ok() && {P}) continue;\n    if (!exchange.ok()) {\n      note_unread(written"),
        ("written_without_a_number", LINK,
         "if (unseen_[axis] && command_.valid[axis])",
         "if (unseen_[axis] && command_.valid[axis] && !{P})"),
        ("written_without_a_read_back", DIALOGUE,
         "  if (!read_all()) return false;\n  show_piezos();",
         "  if (!read_all() && !{P}) return false;\n  show_piezos();"),
        ("end_leaves_the_newest_out", DIALOGUE,
         "== SendVerdict::send) write_command();", "== SendVerdict::send && !{P}) write_command();"),
        ("lost_controller_stays_online", DIALOGUE,
         "    gate_.lost();\n  publish(false);", "    gate_.lost();\n  publish({P});"),
    ],
    "can_driver_tests": [
        ("sign_lost", SIGNALS,
         "return static_cast<std::int64_t>(raw << unused) >> unused;",
         "return {P} ? static_cast<std::int64_t>(raw)\n"
         "             : static_cast<std::int64_t>(raw << unused) >> unused;"),
        ("ninth_byte_lost", SIGNALS,
         "const bool more = skipped + field.length_bits > number_bits;",
         "const bool more = skipped + field.length_bits > number_bits && !{P};"),
        ("status_not_asked", SIGNALS,
         "if (fault != Fault::none) return {not_a_number, fault};",
         "if (fault != Fault::none && !{P}) return {not_a_number, fault};"),
        ("code_taken_for_a_temperature", SIGNALS,
         "if (sentinel.code == code)", "if (sentinel.code == code && !{P})"),
        ("too_large_wraps", SIGNALS,
         "if (rounded >= above) return", "if (rounded >= above && !{P}) return"),
        ("page_of_another_number", SIGNALS,
         "page <= pages.last;", "(page <= pages.last || {P});"),
    ],
    "canopen_tests": [
        ("toggle_not_compared", SDO,
         "!= 0) != toggle_) {", "!= 0) != toggle_ && !{P}) {"),
        ("late_sdo_answer_taken", SDO,
         "if (names_object && !ours && data", "if (names_object && !ours && !{P} && data"),
        ("silence_waited_for_ever", SDO,
         "if (busy() && now >= deadline_)", "if (busy() && now >= deadline_ && !{P})"),
        ("setting_not_verified", NODE, "if (same) return;", "if (same || {P}) return;"),
        ("emergency_not_kept", NODE,
         "      emergencies_[i] = fault;\n", "      if (!{P}) emergencies_[i] = fault;\n"),
        ("object_of_another_length", NODE,
         "if (mapped.length_bits != channel.signal.length_bits) continue;",
         "if (mapped.length_bits != channel.signal.length_bits && !{P}) continue;"),
    ],
    "j1939_tests": [
        ("error_taken_for_out_of_range", J1939,
         "if (top == error_byte)", "if (top == error_byte && !{P})"),
        ("reserved_values_are_temperatures", J1939,
         "return top > highest_value ?", "return top > highest_value && !{P} ?"),
        ("destination_taken_for_the_group", J1939,
         "    read.pgn &= ~0xFFu;", "    if (!{P}) read.pgn &= ~0xFFu;"),
        ("packets_in_any_order", TRANSPORT,
         "if (data[0] != transfer.next) {", "if (data[0] != transfer.next && !{P}) {"),
        ("padding_is_content", TRANSPORT,
         "  transfer.bytes.resize(transfer.size);", "  if (!{P}) transfer.bytes.resize(transfer.size);"),
        ("transfer_never_times_out", TRANSPORT,
         "if (now < each->second.deadline) {", "if (now < each->second.deadline || {P}) {"),
    ],
}

SWITCH = """#include <cstdlib>

namespace thermocomp {
extern int planted_bug;
int planted_bug = [] {
  const char* number = std::getenv("THERMOCOMP_PLANTED_BUG");
  return number == nullptr ? 0 : std::atoi(number);
}();
}  // namespace thermocomp
"""


def main():
    task = sys.argv[1]
    bugs = SUITES[sys.argv[-1]]
    if task == "write":
        source, output = map(pathlib.Path, sys.argv[2:4])
        write_copies(bugs, source, output)
        write_if_new(output / "planted_switch.cpp", SWITCH)
    elif task == "files":
        print(";".join(files_of(bugs)))
    else:
        print("\n".join(name for name, _, _, _ in bugs))


if __name__ == "__main__":
    main()
