/// What a proving move did, by what was sent and read back while it lasted.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// Fed with the axis as the daemon's `offsets` shows it: once before the move, then until it is
/// over and a little longer, since a read-back comes late.
class ProveCourse {
 public:
  /// @param before  the axis before the move
  ProveCourse(double move_um, const nlohmann::json& before);

  void take(const nlohmann::json& axis);

  /// The daemon has the move in hand no more.
  [[nodiscard]] bool over() const noexcept { return begun_ && !proving_; }
  /// The read-back shows the place where it began; true where nothing is read back.
  [[nodiscard]] bool is_back() const noexcept;
  /// Nothing more is to be waited for: the read-back is where it began, to a register's rounding.
  [[nodiscard]] bool is_settled() const noexcept;
  /// Went there as asked, and came back.
  [[nodiscard]] bool passed() const noexcept { return went() && over() && is_back(); }
  /// "sent +3.20 um, read back +3.15 um", both since the beginning
  [[nodiscard]] std::string progress() const;
  /// Sentences for a person: moved, came back, or what was read instead.
  [[nodiscard]] std::string verdict(const std::string& axis) const;

 private:
  /// From where it began; the read-back is NaN where the controller tells none.
  struct Place {
    double sent_um{0.0};
    double read_um{0.0};
  };
  [[nodiscard]] bool went() const noexcept;
  [[nodiscard]] bool reads_back() const noexcept;

  double move_um_;
  double tolerance_um_;
  Place began_;
  Place now_;
  Place farthest_;
  bool begun_{false};
  bool proving_{false};
};

}  // namespace thermocomp::cli
