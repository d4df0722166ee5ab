/// What stands in the offset registers of an axis that is not read back: pure.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/kinds/modbus/modbus_layout.hpp"

namespace thermocomp {

/// Registers that can be written need not hold what was: a device may answer 0, or what it likes.
/// So they are compared once with what was written, and count no more where they differ.
class WrittenOffsets {
 public:
  explicit WrittenOffsets(const ModbusAxis& axis);

  /// The registers of the offset, or the set of a travel, in one request.
  [[nodiscard]] const ReadRequest& request() const noexcept { return request_; }
  /// Whether they may hold what was written.
  [[nodiscard]] bool count() const noexcept { return held_ != Held::no; }
  /// @param words  as read; empty: refused
  /// @return one per node of the axis, as sent: [um], of a piezo [V]; NaN: not known
  [[nodiscard]] std::vector<double> decode(std::span<const std::uint16_t> words) const;

  void wrote(const WriteField& field) { words_ = field.words; }
  /// Whether a look at the registers now would show if they hold what was written.
  [[nodiscard]] bool is_to_be_compared() const noexcept;
  void compare(std::span<const std::uint16_t> words) noexcept;

 private:
  enum class Held : std::uint8_t { not_known, yes, no };

  const ModbusAxis axis_;
  ReadRequest request_;
  Held held_{Held::not_known};
  std::vector<std::uint16_t> words_;  ///< written last
};

}  // namespace thermocomp
