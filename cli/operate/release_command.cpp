#include "cli/operate/release_command.hpp"

#include <chrono>
#include <cmath>
#include <iostream>
#include <thread>

#include <nlohmann/json.hpp>

#include "cli/common/daemon_client.hpp"
#include "cli/common/json_fields.hpp"
#include "cli/operate/progress_line.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto look_period = 50ms;
constexpr auto patience = 10s;

/// Of the axis, or of the first of its nodes that has one: its mismatch with what it reads back
/// now; empty where it has none.
json mismatch_now(const GlobalOptions& global, const std::string& name) {
  const json status = ask_daemon(global.socket, "status", json::object());
  for (const json& axis : list_of(status, "axes")) {
    if (text_of(axis, "name") != name && text_of(axis, "axis") != name) continue;
    json mismatch = object_of(axis, "mismatch");
    if (mismatch.empty()) continue;
    mismatch["applied_um"] = number_of(axis, "applied");
    return mismatch;
  }
  return json::object();
}

/// While read-backs are awaited.
/// @return as mismatch_now(); the release is under way still where its `releasing` is true
json waited_for(const GlobalOptions& global, const std::string& name) {
  const auto began = Clock::now();
  ProgressLine line("axis " + name);
  json mismatch = mismatch_now(global, name);
  while (flag_of(mismatch, "releasing") && Clock::now() - began < patience) {
    line.update("waiting for what is read back");
    std::this_thread::sleep_for(look_period);
    mismatch = mismatch_now(global, name);
  }
  return mismatch;
}

/// Where what is read back is not what was sent last: what the release takes on trust.
void warn_of_trust(const json& before) {
  constexpr double same_um = 0.3;
  const double sent_um = number_of(before, "sent_um");
  const double read_um = number_of(before, "applied_um");
  if (!(std::abs(read_um - sent_um) > same_um)) return;
  std::cout << "It read back " << fixed_signed(read_um, 2) << " um where "
            << fixed_signed(sent_um, 2)
            << " um was sent last, and goes on from what it reads back.\nIf the controller adds "
               "the difference by itself, the tool moves by it once more: mend that first.\n";
}

}  // namespace

int run_release(const GlobalOptions& global, const std::string& axis) {
  const json before = mismatch_now(global, axis);
  ask_daemon(global.socket, "release", {{"axis", axis}});
  const json after = waited_for(global, axis);
  if (after.empty()) {
    std::cout << "axis " << axis << ": released\n";
    warn_of_trust(before);
    return exit_success;
  }
  if (flag_of(after, "releasing")) {
    std::cout << "axis " << axis
              << ": not released yet: it goes on by itself once the controller's read-backs allow "
                 "it (thermocomp status)\n";
    return exit_no;
  }
  std::cout << "axis " << axis << ": NOT released: it reads back "
            << fixed_signed(number_of(after, "applied_um"), 2) << " um where "
            << fixed_signed(number_of(after, "sent_um"), 2) << " um was sent last ("
            << text_of(after, "likely")
            << ").\nMend that, wait until it reads back what was sent, "
               "and release again.\n";
  return exit_no;
}

}  // namespace thermocomp::cli
