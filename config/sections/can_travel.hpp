/// [axis.line] and [axis.table] in the frames of a controller on CAN.
#pragma once

#include <vector>

#include "config/sections/can_signals.hpp"
#include "config/sections/travel_section.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/controllers/controller_config.hpp"

namespace thermocomp::sections {

/// Reads the set of an axis: first what is sent, and, when all frames that are sent are known, what
/// is applied.
class CanTravelSection {
 public:
  /// @param axis  has a travel_table()
  CanTravelSection(const TomlTable& axis, const LimiterConfig& limiter, TakenBits& sent);

  void read_applied(const TakenBits& sent);
  /// The numbers must not come round while a frame of the controller still counts.
  void check_round(double period_s, double silent_after_s) const;
  [[nodiscard]] const CanTravel& travel() const noexcept { return travel_; }

 private:
  /// A signal of the set and the table that describes it.
  struct Place {
    TomlTable table;
    CanSignal signal;
  };
  static void refuse_registers(const TomlTable& own);
  [[nodiscard]] std::vector<Place> read_values(const TomlTable& own) const;
  [[nodiscard]] static std::vector<Place> read_numbers(const TomlTable& own);
  void check_values(const std::vector<Place>& values) const;
  static void check_numbers(const std::vector<Place>& values, const std::vector<Place>& numbers);

  TravelSection section_;
  CanTravel travel_;
};

}  // namespace thermocomp::sections
