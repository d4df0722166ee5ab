#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/commands.hpp"
#include "cli/common/json_fields.hpp"
#include "cli/operate/axis_commands.hpp"
#include "cli/operate/promotion.hpp"
#include "daemon/socket/status_client.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct PlainCommand {
  const char* name;
  const char* method;
  const char* help;
  const char* done;
};
constexpr std::array<PlainCommand, 4> plain_commands{{
    {"enable", "enable", "switches the compensation on; offsets approach at their slew rate",
     "compensation switched on"},
    {"disable", "disable", "switches the compensation off; offsets go to zero at their slew rate",
     "compensation switched off; the offsets of driven axes go to zero at their slew rate"},
    {"cycle-end", "cycle_end", "reports the end of a machining cycle", "end of cycle noted"},
    {"reload", "reload", "reloads configuration and model without a jump of the axes",
     "configuration and model reloaded"},
}};

struct AxisValue {
  std::string axis;
  double value_um{0.0};
};

/// The moves of the axes after a command that changes their targets; nothing if the daemon, which
/// has done the command, does not answer.
void print_moves(const GlobalOptions& global) {
  constexpr double shown_um = 0.1;
  json status;
  try {
    status = StatusClient(global.socket).call("status", json::object());
  } catch (const Failure&) {
    return;
  }
  for (const json& axis : status.value("axes", json::array())) {
    const double from = number_of(axis, "offset");
    const double most = number_of(axis, "offset_max");
    const double to = std::clamp(number_of(axis, "target"), -most, most);
    const std::string subject = "axis " + text_of(axis, "name");
    const std::string unit = " " + text_of(axis, "unit");
    if (!flag_of(axis, "driven"))
      std::cout << subject << " is not driven: nothing is sent\n";
    else if (std::abs(to - from) >= shown_um)
      std::cout << subject << " moves from " << fixed_signed(from, 2) << " to "
                << fixed_signed(to, 2) << unit << " at its slew rate\n";
  }
}

int run_plain(const GlobalOptions& global, const PlainCommand& command) {
  const json answer = StatusClient(global.socket).call(command.method, json::object());
  const std::string checksum = text_of(answer, "checksum");
  std::cout << command.done;
  if (!checksum.empty()) std::cout << ", model SHA-256 " << checksum.substr(0, 16);
  std::cout << '\n';
  if (flag_of(answer, "controller_disabled"))
    std::cout << "The offsets stay at zero while the controller's own switch is off "
                 "(disable_signal)\n";
  if (flag_of(answer, "dry_run"))
    std::cout << "DRY RUN: nothing is written to the controller. The switch outlives the dry run:\n"
                 "thermocomp disable before you end it, so that no axis moves unwatched\n";
  else if (std::string_view(command.method) != "cycle_end")
    print_moves(global);
  return exit_success;
}

struct MeasuredValue : AxisValue {
  std::optional<double> sd_um;
  std::string source{"probe"};
  double ago_min{0.0};
  bool confirm{false};
};

int run_measured(const GlobalOptions& global, const MeasuredValue& given) {
  json params{{"axis", given.axis}, {"value_um", given.value_um}};
  if (given.sd_um) params["sd_um"] = *given.sd_um;
  if (given.source != "probe") params["source"] = given.source;
  if (given.ago_min > 0) params["ago_s"] = 60.0 * given.ago_min;
  if (given.confirm) params["confirm"] = true;
  const json answer = StatusClient(global.socket).call("measured", params);
  const bool remains = text_of(answer, "meaning") == "remaining";
  const double predicted_um =
      number_of(answer, remains ? "predicted_remaining_um" : "predicted_um");
  std::cout << "axis " << given.axis << ": measured " << fixed_signed(given.value_um, 2)
            << (remains ? " um left at the tool; by the model "
                        : " um without offset; by the model ")
            << fixed_signed(predicted_um, 2) << (remains ? " um are left" : " um") << '\n';
  if (const double whole_um = number_of(answer, "predicted_um");
      remains && fixed_signed(whole_um, 2) != fixed_signed(predicted_um, 2))
    std::cout << "(displacement by the model " << fixed_signed(whole_um, 2)
              << " um, the rest is taken out by the offset in effect)\n";
  return exit_success;
}

/// Shortest observation that can rule out slow warming [s].
constexpr double watched_enough_s = 1800.0;

int run_reference(const GlobalOptions& global, bool force) {
  json params = json::object();
  if (force) params["force"] = true;
  json answer;
  try {
    answer = StatusClient(global.socket).call("reference", params);
  } catch (const Failure& refusal) {
    if (force || refusal.status() != exit_no) throw;
    throw Failure(refusal.what() + std::string(". thermocomp reference --force takes it "
                                               "nevertheless, unless a sensor is lost"),
                  exit_no);
  }
  std::cout << "reference: the present temperatures\n";
  if (const std::string although = text_of(answer, "although"); !although.empty())
    std::cout << "taken although " << although << '\n';
  // Earlier daemons do not report it.
  if (const double watched_s = number_of(answer, "watched_s"); watched_s < watched_enough_s)
    std::cout << "the temperatures have been watched for " << duration_text(watched_s)
              << " only: slow warming cannot be excluded\n";
  return exit_success;
}

int run_accept(const GlobalOptions& global, const std::string& sensor) {
  const json answer = StatusClient(global.socket).call("accept", {{"sensor", sensor}});
  std::cout << "sensor " << sensor << ": " << fixed(number_of(answer, "temp_degC"), 2)
            << " degC counts from now on";
  if (const double jump_K = number_of(answer, "jump_K"); jump_K != 0.0)
    std::cout << ", " << fixed_signed(jump_K, 2) << " K from the value before";
  std::cout << '\n';
  return exit_success;
}

using RunNamed = int (*)(const GlobalOptions&, const std::string&);

void add_named_command(CLI::App& app, const GlobalOptions& global, Action& action, const char* name,
                       const char* help, const char* value, const char* value_help, RunNamed run) {
  CLI::App* sub = app.add_subcommand(name, help);
  const auto given = std::make_shared<std::string>();
  sub->add_option(value, *given, value_help)->required();
  sub->callback([&global, &action, given, run] {
    action = [&global, given, run] { return run(global, *given); };
  });
}

void add_reference_command(CLI::App& app, const GlobalOptions& global, Action& action) {
  CLI::App* sub = app.add_subcommand(
      "reference", "takes the present temperatures as the state without displacement");
  const auto force = std::make_shared<bool>(false);
  sub->add_flag("--force", *force,
                "also during a proving move, with an offset applied, or while the machine warms");
  sub->callback([&global, &action, force] {
    action = [&global, force] { return run_reference(global, *force); };
  });
}

using RunAxis = int (*)(const GlobalOptions&, const AxisValue&);

void add_axis_command(CLI::App& app, const GlobalOptions& global, Action& action, const char* name,
                      const char* help, const char* value_help, RunAxis run) {
  CLI::App* sub = app.add_subcommand(name, help);
  const auto given = std::make_shared<AxisValue>();
  sub->add_option("AXIS", given->axis, "name of the axis in the configuration")->required();
  sub->add_option("UM", given->value_um, value_help)->required();
  sub->callback([&global, &action, given, run] {
    action = [&global, given, run] { return run(global, *given); };
  });
}

void add_measured_command(CLI::App& app, const GlobalOptions& global, Action& action) {
  CLI::App* sub = app.add_subcommand(
      "measured", "gives the daemon a displacement that was measured at the tool or on a part");
  const auto given = std::make_shared<MeasuredValue>();
  sub->add_option("AXIS", given->axis, "name of the axis in the configuration")->required();
  sub->add_option("UM", given->value_um,
                  "measured displacement in um, positive where the tool moves in the axis' "
                  "positive direction")
      ->required();
  sub->add_option(
         "--sd", given->sd_um,
         "its standard deviation in um; else noise_um of [correction], of a part twice that")
      ->type_name("UM");
  sub->add_option(
         "--source", given->source,
         "probe; part: measured on a part; wear: the same, and its negative has been entered at "
         "the controller, so that the compensation must not compensate it again")
      ->check(CLI::IsMember({"probe", "part", "wear"}));
  sub->add_option(
         "--ago", given->ago_min,
         "minutes since the part was cut: later changes of the compensation are taken into account")
      ->check(CLI::Range(0.0, 120.0))
      ->type_name("MIN");
  sub->add_flag("--confirm", given->confirm, "it is right though the model contradicts it");
  sub->callback([&global, &action, given] {
    action = [&global, given] { return run_measured(global, *given); };
  });
}

int run_promote(const GlobalOptions& global, bool back) {
  const Promotion done = back ? take_back(global.socket) : promote(global.socket);
  std::cout << done.model << (back ? ": the model before runs again" : ": the candidate runs")
            << "; the other is kept as " << done.before
            << ", and thermocomp promote --back exchanges them\n";
  if (std::isfinite(done.better_probability))
    std::cout << "by the probings beside the model it is better with "
              << fixed(100.0 * done.better_probability, 0) << " % (50 %: equally good)\n";
  print_moves(global);
  return exit_success;
}

int run_candidate(const GlobalOptions& global, const std::string& file) {
  const bool is_none = file == "none";
  start_candidate(global.socket, is_none ? fs::path() : fs::absolute(file));
  if (is_none) {
    std::cout << "no candidate is running\n";
    return exit_success;
  }
  std::cout << fs::absolute(file).string()
            << ": runs as the candidate; thermocomp status shows its score. To keep it after a "
               "restart: [model] candidate in the configuration\n";
  return exit_success;
}

void add_candidate_command(CLI::App& app, const GlobalOptions& global, Action& action) {
  CLI::App* candidate =
      app.add_subcommand("candidate", "runs a second model that is scored and never sent");
  const auto file = std::make_shared<std::string>();
  candidate->add_option("FILE", *file, "model file that the daemon can read, or none")->required();
  candidate->callback([&global, &action, file] {
    action = [&global, file] { return run_candidate(global, *file); };
  });
}

void add_promote_command(CLI::App& app, const GlobalOptions& global, Action& action) {
  CLI::App* promote = app.add_subcommand(
      "promote", "makes the candidate the model in use and keeps the one before");
  const auto back = std::make_shared<bool>(false);
  promote->add_flag("--back", *back, "the model before the last promotion runs again");
  promote->callback([&global, &action, back] {
    action = [&global, back] { return run_promote(global, *back); };
  });
}

}  // namespace

void add_operate_commands(CLI::App& app, const GlobalOptions& global, Action& action) {
  add_reference_command(app, global, action);
  for (const PlainCommand& command : plain_commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.help);
    sub->callback([&global, &action, &command] {
      action = [&global, &command] { return run_plain(global, command); };
    });
  }
  add_measured_command(app, global, action);
  add_candidate_command(app, global, action);
  add_promote_command(app, global, action);
  add_axis_command(app, global, action, "prove",
                   "moves one axis a few um and back, to confirm the sign with an indicator; "
                   "waits, and reports the read-back",
                   "distance in um", [](const GlobalOptions& options, const AxisValue& given) {
                     return run_prove(options, given.axis, given.value_um);
                   });
  add_named_command(app, global, action, "release",
                    "drives an axis again after the cause of its mismatch was corrected", "AXIS",
                    "name of the axis in the configuration", run_release);
  add_named_command(app, global, action, "accept",
                    "confirms the value of a sensor that jumped or is still unconfirmed", "SENSOR",
                    "name of the sensor in the configuration", run_accept);
}

}  // namespace thermocomp::cli
