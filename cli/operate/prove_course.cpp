#include "cli/operate/prove_course.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "cli/common/json_fields.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

/// Tolerance as a share of the move: the compensation continues meanwhile, registers are coarse,
/// and polling every 50 ms can miss the peak.
constexpr double tolerance_share = 0.2;
/// Tolerance of a read-back at rest.
constexpr double tolerance_um_min = 0.3;
/// Resolution of registers.
constexpr double rounding_um = 0.1;

std::string um(double value) {
  return fixed_signed(value, 2) + " um";
}

}  // namespace

ProveCourse::ProveCourse(double move_um, const nlohmann::json& before)
    : move_um_(move_um),
      tolerance_um_(std::max(tolerance_um_min, tolerance_share * std::abs(move_um))),
      began_{number_of(before, "offset"), number_of(before, "applied")} {
  if (!reads_back()) now_.read_um = farthest_.read_um = began_.read_um;
}

void ProveCourse::take(const nlohmann::json& axis) {
  proving_ =
      axis.contains("proving") && axis["proving"].is_boolean() && axis["proving"].get<bool>();
  begun_ = true;
  now_ = {number_of(axis, "offset") - began_.sent_um, number_of(axis, "applied") - began_.read_um};
  if (std::abs(now_.sent_um) > std::abs(farthest_.sent_um)) farthest_.sent_um = now_.sent_um;
  if (std::abs(now_.read_um) > std::abs(farthest_.read_um)) farthest_.read_um = now_.read_um;
}

bool ProveCourse::reads_back() const noexcept {
  return std::isfinite(began_.read_um);
}

/// The offset goes the other way where `sign` is -1.
double ProveCourse::expected_um() const noexcept {
  return std::copysign(move_um_, farthest_.sent_um);
}

bool ProveCourse::went() const noexcept {
  const double went_um = reads_back() ? farthest_.read_um : farthest_.sent_um;
  return std::abs(went_um - expected_um()) <= tolerance_um_;
}

bool ProveCourse::is_back() const noexcept {
  return !reads_back() || std::abs(now_.read_um) <= tolerance_um_;
}

bool ProveCourse::is_settled() const noexcept {
  return over() && (!reads_back() || std::abs(now_.read_um) <= rounding_um);
}

std::string ProveCourse::progress() const {
  return "sent " + um(now_.sent_um) +
         (reads_back() ? ", read back " + um(now_.read_um) : ", nothing is read back");
}

std::string ProveCourse::verdict(const std::string& axis) const {
  const std::string name = "axis " + axis + ": ";
  const std::string ends = "sent " + um(farthest_.sent_um) + " at the farthest, read back " +
                           um(farthest_.read_um) + " there and " + um(now_.read_um) +
                           " at the end, from where it began";
  if (!over()) return name + "the move is not over: " + progress() + "\n";
  if (!reads_back())
    return name +
           (went() ? "moved and came back, by what was sent: " : "was NOT sent as commanded: ") +
           um(farthest_.sent_um) + "; the controller reads nothing back, so only an indicator " +
           "shows whether it moved\n";
  if (passed()) return name + "moved and came back: " + ends + "\n";
  std::string what = went() ? "moved, but did NOT come back: " : "did NOT move as commanded: ";
  if (!went() && std::abs(farthest_.sent_um - expected_um()) > tolerance_um_)
    what = "was NOT moved all the way by the daemon (its bound, or it was ended): ";
  else if (!went() && std::abs(farthest_.read_um + expected_um()) <= tolerance_um_)
    what = "moved the OTHER way, as read back: ";
  return name + what + ends + "\n";
}

}  // namespace thermocomp::cli
