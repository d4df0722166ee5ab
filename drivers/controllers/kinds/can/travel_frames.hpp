/// The set of a travel (travel_values.hpp) in CAN frames (CanTravel). Pure.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/can/can_socket.hpp"
#include "drivers/controllers/controller_config.hpp"

namespace thermocomp {

[[nodiscard]] inline CanId id_of(const CanSignal& signal) noexcept {
  return {signal.id, signal.extended_id};
}

/// Checks nodes, values and numbers, but no overlaps with other signals.
/// @throws InvalidValue for impossible nodes or signals
void check_travel(const CanTravel& travel);

/// Number of set numbers before they wrap around. @pre the set has a number
[[nodiscard]] std::uint64_t set_numbers(const CanSet& set) noexcept;

/// Writes the set's number and its values in this frame, and no other bits.
/// @param values  one per value of the set
/// @pre the frame has room for them
void put_set(const CanSet& set, std::span<const double> values, std::uint64_t number,
             CanFrame& frame);

/// Change of a node's offset with one count of each value that it depends on [um].
[[nodiscard]] double resolution_um(const TravelShape& shape, const CanSet& set, std::size_t node);

/// Assembles a set from frames in any order, repeated or lost.
class CanSetReader {
 public:
  enum class Taken {
    nothing,    ///< the frame is not part of the set
    too_short,  ///< too short for its content; ignored
    part,       ///< the newest frames belong to different sets, or some are missing
    whole       ///< all frames carry the same number; values() belong to this set
  };

  /// @pre check_travel() passes
  explicit CanSetReader(CanSet set);

  Taken take(const CanFrame& frame);
  /// Drops frames received earlier. values() do not change.
  void forget_before(nanoseconds at) noexcept;
  void forget() noexcept;  ///< drops all frames; values() do not change

  /// Values of the newest complete set; NaN before the first.
  [[nodiscard]] std::span<const double> values() const noexcept { return values_; }
  [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
  /// Receive time of its oldest frame.
  [[nodiscard]] nanoseconds received_at() const noexcept { return received_at_; }

 private:
  /// The newest frame of an identifier.
  struct Part {
    CanSignal number_place;
    std::size_t size{0};              ///< required bytes
    std::vector<std::size_t> places;  ///< indices of its values in the set
    std::vector<double> values;
    std::uint64_t number{0};
    nanoseconds received_at{};
    bool is_there{false};
  };
  [[nodiscard]] bool is_whole() const noexcept;

  CanSet set_;
  std::vector<Part> parts_;
  std::vector<double> values_;
  std::uint64_t number_{0};
  nanoseconds received_at_{};
};

}  // namespace thermocomp
