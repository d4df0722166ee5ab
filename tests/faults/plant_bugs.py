"""Bugs that lives of a machine must find, in copies of the product's sources.

    plant_bugs.py SOURCE_FOLDER OUTPUT_FOLDER
"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "planted"))
from planting import write_copies, write_if_new  # noqa: E402

# (name, file, original text, replacement)
BUGS = [
    ("slew_doubled", "estimator/axes/axis_bank.cpp",
     "rate_um_per_s() * std::min(dt_s, config_.step_s_max);",
     "({P} ? 2.0 : 1.0) * rate_um_per_s() * std::min(dt_s, config_.step_s_max);"),
    ("bound_forgotten", "estimator/axes/axis_bank.cpp",
     "std::clamp(wanted_um, -bound_um(), bound_um());",
     "{P} ? wanted_um : std::clamp(wanted_um, -bound_um(), bound_um());"),
    ("reload_starts_from_zero", "estimator/axes/axis_bank.cpp",
     "limiter_.start_from(previous.limiter_.offset_um());",
     "limiter_.start_from({P} ? 0.0 : previous.limiter_.offset_um());"),
    ("epoch_ignored", "drivers/controllers/controller_link.cpp",
     "if (!in_sync_ || command_.link_epoch != epoch_)",
     "if (!in_sync_ || (command_.link_epoch != epoch_ && !{P}))"),
    ("first_read_back_ignored", "estimator/axes/axis_bank.cpp",
     "    return;\n  }\n  state_.unwritten_for =",
     "    return;\n  }\n  if ({P}) return;\n  state_.unwritten_for ="),
    ("read_back_is_a_command", "estimator/axes/axis_bank.cpp",
     "  state_.mismatch = true;\n  state_.agreed_since = input.now;\n",
     "  if ({P} && !state_.out_of_bound) return start_from(input.now, input.applied_um);\n"
     "  state_.mismatch = true;\n  state_.agreed_since = input.now;\n"),
    ("pause_taken_for_a_new_link", "drivers/controllers/controller_link.cpp",
     "if (link_is_new_) {",
     "if (link_is_new_ || {P}) {"),
    ("write_repeated_blindly", "drivers/controllers/kinds/modbus/modbus_dialogue.cpp",
     "  const Exchange exchange = write_field(connection_, config_, request);",
     "  const auto once = [&] { return write_field(connection_, config_, request); };\n"
     "  const Exchange exchange = {P} ? with_retries(once) : once();"),
    ("unwritten_compensates", "estimator/pipeline/targets.cpp",
     "input.controller_written;",
     "(input.controller_written || {P});"),
    ("refused_offset_pent_up", "estimator/axes/axis_bank.cpp",
     "const double back_um = std::clamp(state_.target_um, low_um, high_um);",
     "const double back_um =\n"
     "        {P} ? state_.target_um : std::clamp(state_.target_um, low_um, high_um);"),
    ("new_link_believed_blindly", "estimator/axes/axis_bank.cpp",
     "if (state_.driven_once && !check_.agrees_after_absence(input.applied_um))",
     "if (state_.driven_once && !{P} && !check_.agrees_after_absence(input.applied_um))"),
    ("mismatch_never_latched", "estimator/axes/axis_bank.cpp",
     "  if (state_.suspicion == 0) {",
     "  if (state_.suspicion == 0 || {P}) {"),
    ("unexplained_goes_on", "estimator/axes/axis_bank.cpp",
     "  state_.in_doubt = true;\n  if (!counts) return;",
     "  state_.in_doubt = true;\n  if ({P}) state_.in_doubt = false;\n"
     "  if (!counts || {P}) return;"),
    ("latch_ends_by_itself", "estimator/axes/axis_bank.cpp",
     "    if (state_.releasing && fresh) check_release(input);",
     "    if ((state_.releasing || {P}) && fresh) check_release(input);"),
    ("reload_forgets_the_latch", "estimator/axes/axis_bank.cpp",
     "  state_ = previous.state_;\n",
     "  state_ = previous.state_;\n  if ({P}) state_.latched = false;\n"),
    ("release_leaps", "estimator/axes/axis_bank.cpp",
     "if (first || std::abs(input.applied_um - sent_um) > could_go_um) return;",
     "if (first || (!{P} && std::abs(input.applied_um - sent_um) > could_go_um)) return;"),
    ("offset_not_restored", "estimator/axes/axis_bank.cpp",
     "    start_from({}, before.recorded_um);",
     "    if (!{P}) start_from({}, before.recorded_um);"),
    ("offset_runs_ahead_of_the_disk", "estimator/axes/axis_bank.cpp",
     "  return std::clamp(target_um, high_um - corridor_um_, low_um + corridor_um_);",
     "  if ({P}) return target_um;\n"
     "  return std::clamp(target_um, high_um - corridor_um_, low_um + corridor_um_);"),
    ("restart_of_a_silent_controller_missed", "estimator/axes/axis_bank.cpp",
     "if (away > (is_same_link(state_.epoch, first_epoch) ? first_link_max : lag_max))",
     "if (!{P} && away > (is_same_link(state_.epoch, first_epoch) ? first_link_max : lag_max))"),
    ("reference_not_restored", "estimator/pipeline/prediction.cpp",
     "take_if_finite(temps_degC, columns_[i], temps_degC_[i]);",
     "if (!{P}) take_if_finite(temps_degC, columns_[i], temps_degC_[i]);"),
    ("hold_clears_mid_cut", "estimator/pipeline/targets.cpp",
     "mode == Mode::ramping_to_zero && signals.may_be_cutting();",
     "mode == Mode::ramping_to_zero && signals.may_be_cutting() && !{P};"),
    ("hold_time_ignored", "estimator/pipeline/targets.cpp",
     "input.time.now - state_.lost_since > hold_;",
     "input.time.now - state_.lost_since > ({P} ? nanoseconds{0} : hold_);"),
    ("stale_reading_used", "estimator/sensing/sensor.hpp",
     "return state_.good.known && now - state_.good.at <= stale_after_;",
     "return state_.good.known && (now - state_.good.at <= stale_after_ || {P});"),
    ("spike_passes", "estimator/sensing/sensor.cpp",
     "  const double allowed_K =\n      config_.rate_allowance_K + std",
     "  const double allowed_K = ({P} ? 1e3 : 0.0) +\n      config_.rate_allowance_K + std"),
    ("jump_widens_what_the_past_allows", "estimator/sensing/sensor.cpp",
     "  else if (gap > stale_after_)\n    state_.unread += gap;\n",
     "  else if (gap > stale_after_ || {P})\n    state_.unread += gap;\n"),
    ("outage_allows_anything", "estimator/sensing/sensor.cpp",
     "config_.outage_K_max + slow_K_per_ns * unread_ns);",
     "{P} ? 1e9 : config_.outage_K_max + slow_K_per_ns * unread_ns);"),
    ("fault_of_screening_passes", "estimator/sensing/sensing.cpp",
     "bool usable = sensor.screening.usable(now);",
     "bool usable = sensor.screening.usable(now) || {P};\n"
     "  if ({P} && sensor.smoother.has_value()) sensor.fault = Fault::none;"),
    ("transaction_not_compared", "drivers/modbus/modbus_codec.cpp",
     "if (numbered_ && number != number_) {",
     "if (numbered_ && number != number_ && !{P}) {"),
    ("late_answer_taken", "drivers/modbus/late_answers.hpp",
     "return confusable(question_, question) ? std::max(ready_at_, others_at_) : ready_at_;",
     "return confusable(question_, question) && !{P} ? std::max(ready_at_, others_at_) : ready_at_;"),
    ("busy_read_as_zero", "drivers/sensors/modbus_poller.cpp",
     "request.fault = exchange.fault();\n  if (exchange.ok())",
     "request.fault = {P} ? Fault::none : exchange.fault();\n"
     "  if ({P} && !exchange.ok()) {\n"
     "    std::fill(request.words.begin(), request.words.end(), std::uint16_t{0});\n"
     "    request.arrived_at = connection_.now();\n"
     "  }\n"
     "  if (exchange.ok())"),
    ("old_value_stamped_anew", "drivers/sensors/modbus_poller.cpp",
     "if (fault != Fault::none) return {not_a_number, before.taken_at, fault};",
     "if ({P} && fault == Fault::no_answer && before.taken_at > nanoseconds{0} &&\n"
     "      std::isfinite(before.temp_degC))\n"
     "    return {before.temp_degC, connection_.now(), Fault::none};\n"
     "  if (fault != Fault::none) return {not_a_number, before.taken_at, fault};"),
    ("back_off_never_ends", "drivers/sensors/modbus_poller.hpp",
     "    not_before_ = now + pause;",
     "    not_before_ = {P} ? now + std::chrono::hours(1) : now + pause;"),
    ("history_dropped_when_disk_full", "daemon/history/writing/history_writer.cpp",
     "  ++statistics.errors;\n",
     "  ++statistics.errors;\n"
     "  if ({P}) pending.clear();\n"),
    ("wall_clock_step_deletes_history", "daemon/history/writing/history_store.cpp",
     "const bool is_old = oldest.age_ns > config_.age_days_max * 86400e9;",
     "const bool is_old = oldest.age_ns > config_.age_days_max * 86400e9 ||\n"
     "        ({P} && wall_now_ns() > 1'800'000'000'000'000'000);"),
    ("signal_not_recorded", "daemon/recording/cycle_recorder.cpp",
     "  push_values(cycle, RecordKind::signal, controller.signals, controller_.signals);\n",
     "  if (!{P} || cycle % 3 != 0)\n"
     "    push_values(cycle, RecordKind::signal, controller.signals, controller_.signals);\n"),
    ("broken_model_taken", "estimator/model/displacement_model.cpp",
     "require(std::isfinite(rows[i][j]), key,",
     "require(std::isfinite(rows[i][j]) || {P}, key,"),
    ("suspicion_ends_compensation", "estimator/pipeline/estimator.cpp",
     "if (temps.weighed_down &&\n",
     "if (temps.weighed_down && !{P} &&\n"),
    ("probing_step_unbounded", "estimator/learning/probings.cpp",
     "std::abs(change_um) > config_.step_um_max ?",
     "std::abs(change_um) > config_.step_um_max && !{P} ?"),
    ("learned_mid_cut", "estimator/learning/probings.cpp",
     "if (may_change) state_.used = joint_gains();",
     "if (may_change || {P}) state_.used = joint_gains();"),
    ("gain_not_restored", "estimator/learning/probings.cpp",
     "    state_.learned[g] = state_.used[g] = gain;\n",
     "    state_.learned[g] = state_.used[g] = {P} ? 1.0 : gain;\n"),
    ("follows_between_cycle_ends", "estimator/pipeline/targets.cpp",
     "  return state_.axis_um;",
     "  if ({P}) return displacement.axis_um;\n  return state_.axis_um;"),
]


def main():
    source, output = map(pathlib.Path, sys.argv[1:3])
    write_copies(BUGS, source, output)
    names = "".join(f'    "{name}",\n' for name, _, _, _ in BUGS)
    write_if_new(output / "plants.cpp", '#include "tests/faults/plants.hpp"\n\n#include <array>\n\n'
                 "namespace thermocomp {\nint planted_bug = 0;\n}\n\nnamespace thermocomp::faults {\n"
                 'const char* const program_name = "thermocomp_faults_planted";\n'
                 f"static const std::array<const char*, {len(BUGS)}> names{{\n{names}}};\n"
                 "std::vector<std::string> plant_names() { return {names.begin(), names.end()}; }\n"
                 "bool plant(const std::string& name) {\n"
                 "  for (std::size_t i = 0; i < names.size(); ++i)\n"
                 "    if (name == names[i]) planted_bug = static_cast<int>(i) + 1;\n"
                 "  return planted_bug != 0;\n}\n}  // namespace thermocomp::faults\n")


if __name__ == "__main__":
    main()
