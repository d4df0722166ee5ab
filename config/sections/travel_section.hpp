/// Travels in the daemon's file: the part common to all buses, and the values on CAN and Modbus.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "config/sections/can_signals.hpp"
#include "config/toml/toml_reader.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::sections {

/// Range and resolution of a value's place.
struct Carried {
  Range reach;
  double count{0.0};  ///< value of one count; for a float its smallest step
};

/// Checks that the place of an offset can represent the bound, and that one count is small against
/// bound and slew limit; otherwise the axis would jump or stand still.
void check_offset_place(const TomlTable& table, std::string_view key, const Carried& place,
                        const LimiterConfig& limiter);

/// [axis.line] or [axis.table] of an axis; false if it has neither.
[[nodiscard]] TomlTable travel_table(const TomlTable& axis);

/// Reads the travel itself, and gives the required ranges of its values.
class TravelSection {
 public:
  /// @param axis  has a travel_table(); the estimator's part is read with the axis
  TravelSection(const TomlTable& axis, const LimiterConfig& limiter);

  [[nodiscard]] const TomlTable& table() const noexcept { return table_; }
  [[nodiscard]] const TravelShape& shape() const noexcept { return shape_; }
  [[nodiscard]] bool is_line() const noexcept { return shape_.p0_mm.has_value(); }

  void check_offset(const TomlTable& own, std::string_view key, const Carried& place) const;
  void check_slope(const TomlTable& own, std::string_view key, const Carried& place) const;
  void check_p0(const TomlTable& own, std::string_view key, const Carried& place) const;

 private:
  void read_line();
  void read_table();

  TomlTable table_;
  LimiterConfig limiter_;
  TravelShape shape_;
  bool is_travel_{true};  ///< the ends of the travel are valid
};

/// Reads the frames of an axis: sent ones and, when those of all axes are known, applied ones.
class CanTravelSection {
 public:
  /// @param axis  has a travel_table()
  CanTravelSection(const TomlTable& axis, const LimiterConfig& limiter, TakenBits& sent);

  void read_applied(const TakenBits& sent);
  /// Requires that set numbers do not repeat while a frame of the controller is still valid.
  void check_round(double period_s, double silent_after_s) const;
  [[nodiscard]] const CanTravel& travel() const noexcept { return travel_; }

 private:
  /// A signal and the table that describes it.
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

/// Written registers and their keys: no register may be written for two purposes.
class WrittenRegisters {
 public:
  void add(const TomlTable& table, std::string_view key, const ModbusValue& value);

 private:
  std::map<int, std::string> used_;
};

/// @param axis  has a travel_table()
[[nodiscard]] ModbusTravel read_modbus_travel(const TomlTable& axis, const LimiterConfig& limiter,
                                              WrittenRegisters& written);

}  // namespace thermocomp::sections
