/// [axis.line] and [axis.table] of a controller that interpolates along the travel: what does not
/// depend on the bus.
#pragma once

#include <string_view>

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

}  // namespace thermocomp::sections
