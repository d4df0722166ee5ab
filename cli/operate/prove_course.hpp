/// Outcome of a proving move from the offsets sent and read back meanwhile.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// Takes the axis from the daemon's `offsets`: once before the move, then until shortly after it.
class ProveCourse {
 public:
  /// @param before  the axis before the move
  ProveCourse(double move_um, const nlohmann::json& before);

  void take(const nlohmann::json& axis);

  [[nodiscard]] bool over() const noexcept { return begun_ && !proving_; }
  /// The read-back has returned to its initial value; true without read-back.
  [[nodiscard]] bool is_back() const noexcept;
  /// The move has ended and the read-back has returned to within a register's resolution.
  [[nodiscard]] bool is_settled() const noexcept;
  [[nodiscard]] bool passed() const noexcept { return went() && over() && is_back(); }
  [[nodiscard]] bool reads_back() const noexcept;
  /// "sent +3.20 um, read back +3.15 um", both relative to the start
  [[nodiscard]] std::string progress() const;
  /// Sentences with the outcome and the values read.
  [[nodiscard]] std::string verdict(const std::string& axis) const;

 private:
  /// Relative to the start; read_um is NaN without read-back.
  struct Place {
    double sent_um{0.0};
    double read_um{0.0};
  };
  [[nodiscard]] double expected_um() const noexcept;
  [[nodiscard]] bool went() const noexcept;

  double move_um_;
  double tolerance_um_;
  Place began_;
  Place now_;
  Place farthest_;
  bool begun_{false};
  bool proving_{false};
};

}  // namespace thermocomp::cli
