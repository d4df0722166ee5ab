#include "cli/operate/prove_command.hpp"

#include <chrono>
#include <cmath>
#include <iostream>
#include <thread>

#include <nlohmann/json.hpp>

#include "cli/common/daemon_client.hpp"
#include "cli/common/json_fields.hpp"
#include "cli/operate/progress_line.hpp"
#include "cli/operate/prove_course.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto look_period = 50ms;
/// The last read-back of a slow controller comes so late.
constexpr auto settles_within = 2s;
/// A daemon that does not say how long it takes.
constexpr double takes_s_default = 120.0;
/// Of the time that a move takes: longer, and something holds it.
constexpr double patience_factor = 2.0;
constexpr double patience_s = 10.0;

json axis_now(const GlobalOptions& global, const std::string& name) {
  const json offsets = ask_daemon(global.socket, "offsets", json::object());
  for (const json& axis : list_of(offsets, "axes"))
    if (text_of(axis, "name") == name || text_of(axis, "axis") == name) return axis;
  return json::object();
}

void watch(const GlobalOptions& global, const std::string& axis, double takes_s,
           ProveCourse& course) {
  const auto patience = std::chrono::duration<double>(patience_factor * takes_s + patience_s);
  const auto began = Clock::now();
  auto over_since = Clock::time_point{};
  ProgressLine line("axis " + axis);
  while (Clock::now() - began < patience) {
    course.take(axis_now(global, axis));
    line.update(course.progress());
    if (course.over()) {
      if (over_since == Clock::time_point{}) over_since = Clock::now();
      if (course.is_settled() || Clock::now() - over_since > settles_within) return;
    }
    std::this_thread::sleep_for(look_period);
  }
}

}  // namespace

int run_prove(const GlobalOptions& global, const std::string& axis, double move_um) {
  const json before = axis_now(global, axis);
  const json answer = ask_daemon(global.socket, "prove", {{"axis", axis}, {"value_um", move_um}});
  const double takes_s = number_of(answer, "takes_s");
  ProveCourse course(move_um, before);
  watch(global, axis, std::isfinite(takes_s) ? takes_s : takes_s_default, course);
  const std::string amount = fixed_signed(move_um, 2);
  std::cout << course.verdict(axis) << "an indicator at the tool must have shown " << amount
            << " um in the axis' positive direction, else change the sign in its [[axis]] table\n";
  return course.passed() ? exit_success : exit_no;
}

}  // namespace thermocomp::cli
