/// A travel in the daemon's file: what is the same on every bus, and its values on CAN and Modbus.
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

/// What a value's place can carry.
struct Carried {
  Range reach;
  double count{0.0};  ///< what one count is, in the value's unit; of a float the least step
};

/// The value of an offset must be able to carry the bound, or the offset would be cut off, and one
/// count of it must be small enough beside bound and slew, or the axis would leap or stand still.
void check_offset_place(const TomlTable& table, std::string_view key, const Carried& place,
                        const LimiterConfig& limiter);

/// [axis.line] or [axis.table] of an axis; not there: it has neither.
[[nodiscard]] TomlTable travel_table(const TomlTable& axis);

/// Reads the travel itself, and tells what its values must be able to hold.
class TravelSection {
 public:
  /// @param axis  has a travel_table(); what the estimator needs of it is read with the axis
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
  bool is_travel_{true};  ///< the ends of the travel could be read
};

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

/// Registers that are written, and by what: no register may be written for two purposes.
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
