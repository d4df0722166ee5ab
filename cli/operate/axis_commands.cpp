#include "cli/operate/axis_commands.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <string>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "cli/operate/prove_course.hpp"
#include "daemon/socket/status_client.hpp"
#include "report/terminal.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto line_period = 2s;

/// Progress on stderr: one overwritten line, or without a terminal a line every two seconds.
class ProgressLine {
 public:
  explicit ProgressLine(std::string what)
      : what_(std::move(what)), on_terminal_(stderr_is_terminal()), last_(Clock::now()) {}
  ~ProgressLine() {
    if (shown_ && on_terminal_) std::fputs(rewritten_line("").c_str(), stderr);
  }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void update(const std::string& text) {
    const auto now = Clock::now();
    if (!on_terminal_ && now - last_ < line_period) return;
    last_ = now;
    shown_ = true;
    const std::string line = what_ + ": " + text;
    std::fputs((on_terminal_ ? rewritten_line(line) : line + "\n").c_str(), stderr);
    std::fflush(stderr);
  }

 private:
  std::string what_;
  bool on_terminal_;
  bool shown_{false};
  Clock::time_point last_;
};

constexpr auto look_period = 50ms;
/// Delay of a slow controller's last read-back.
constexpr auto settles_within = 2s;
/// For daemons that do not report the duration.
constexpr double takes_s_default = 120.0;
/// Timeout of a move: factor times the computed duration, plus patience_s.
constexpr double patience_factor = 2.0;
constexpr double patience_s = 10.0;

json axis_now(const GlobalOptions& global, const std::string& name) {
  const json offsets = StatusClient(global.socket).call("offsets", json::object());
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

/// Timeout for the read-backs after a release.
constexpr auto read_back_patience = 10s;

/// Mismatch of the axis, or of its first node with one, with the present read-back; empty: none.
json mismatch_now(const GlobalOptions& global, const std::string& name) {
  const json status = StatusClient(global.socket).call("status", json::object());
  for (const json& axis : list_of(status, "axes")) {
    if (text_of(axis, "name") != name && text_of(axis, "axis") != name) continue;
    json mismatch = object_of(axis, "mismatch");
    if (mismatch.empty()) continue;
    mismatch["applied_um"] = number_of(axis, "applied");
    return mismatch;
  }
  return json::object();
}

/// Waits while read-backs are outstanding.
/// @return as mismatch_now(); `releasing` is true if the release is still pending
json waited_for(const GlobalOptions& global, const std::string& name) {
  const auto began = Clock::now();
  ProgressLine line("axis " + name);
  json mismatch = mismatch_now(global, name);
  while (flag_of(mismatch, "releasing") && Clock::now() - began < read_back_patience) {
    line.update("waiting for the read-back");
    std::this_thread::sleep_for(look_period);
    mismatch = mismatch_now(global, name);
  }
  return mismatch;
}

/// Warns if the read-back differs from the last offset sent: the release adopts the read-back.
void warn_of_read_back(const json& before) {
  constexpr double same_um = 0.3;
  const double sent_um = number_of(before, "sent_um");
  const double read_um = number_of(before, "applied_um");
  if (!(std::abs(read_um - sent_um) > same_um)) return;
  std::cout << "It read back " << fixed_signed(read_um, 2) << " um where "
            << fixed_signed(sent_um, 2)
            << " um was sent last, and continues from the read-back.\nIf the controller itself "
               "adds the difference, the tool moves by it again: correct that first.\n";
}

}  // namespace

int run_prove(const GlobalOptions& global, const std::string& axis, double move_um) {
  const json before = axis_now(global, axis);
  const json answer =
      StatusClient(global.socket).call("prove", {{"axis", axis}, {"value_um", move_um}});
  const double takes_s = number_of(answer, "takes_s");
  ProveCourse course(move_um, before);
  watch(global, axis, std::isfinite(takes_s) ? takes_s : takes_s_default, course);
  std::cout << course.verdict(axis);
  if (course.passed() || !course.reads_back())
    std::cout
        << "an indicator at the tool must have shown " << fixed_signed(move_um, 2)
        << " um in the axis' positive direction, else change the sign in its [[axis]] table\n";
  else
    std::cout << "find the reason before the sign is judged: thermocomp status, thermocomp scan\n";
  return course.passed() ? exit_success : exit_no;
}

int run_release(const GlobalOptions& global, const std::string& axis) {
  const json before = mismatch_now(global, axis);
  StatusClient(global.socket).call("release", {{"axis", axis}});
  const json after = waited_for(global, axis);
  if (after.empty()) {
    std::cout << "axis " << axis << ": released\n";
    warn_of_read_back(before);
    return exit_success;
  }
  if (flag_of(after, "releasing")) {
    std::cout << "axis " << axis
              << ": not released yet: it continues by itself once the controller's read-backs "
                 "allow it (thermocomp status)\n";
    return exit_no;
  }
  std::cout
      << "axis " << axis << ": NOT released: it reads back "
      << fixed_signed(number_of(after, "applied_um"), 2) << " um where "
      << fixed_signed(number_of(after, "sent_um"), 2) << " um was sent last ("
      << text_of(after, "likely")
      << ").\nCorrect that, wait until it reads back what was sent, and release again. Where the "
         "controller\nkeeps its value while the axis is not driven, set its offset to 0 there "
         "first.\n";
  return exit_no;
}

}  // namespace thermocomp::cli
