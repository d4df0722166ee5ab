/// The set of a travel (travel_values.hpp) in the frames of a controller that interpolates
/// (CanTravel): pure.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/can/can_socket.hpp"
#include "drivers/controllers/controller_config.hpp"

namespace thermocomp {

/// Nodes, values and numbers alone: whether they share bits with something else is looked at where
/// all frames are known.
/// @throws InvalidValue for nodes or signals that cannot be
void check_travel(const CanTravel& travel);

/// How many numbers a set can have before they begin anew. @pre the set has a number
[[nodiscard]] std::uint64_t set_numbers(const CanSet& set) noexcept;

/// Puts into a frame what it carries of the set: its number and those of its values that stand
/// there. Other bits stay.
/// @param values  one each of the set
/// @pre the frame has room for them
void put_set(const CanSet& set, std::span<const double> values, std::uint64_t number,
             CanFrame& frame);

/// How far a node's offset moves with one count of each value that it is made of [um].
[[nodiscard]] double resolution_um(const TravelShape& shape, const CanSet& set, std::size_t node);

/// Puts a set together from frames that come in any order, twice or not at all.
class CanSetReader {
 public:
  enum class Taken {
    nothing,    ///< the set has no such frame
    too_short,  ///< for what it should carry; as if it had not come
    part,       ///< the newest frames are of different sets, or not all have come
    whole       ///< all of them carry the same number: values() are this set's
  };

  /// @pre check_travel() accepts it
  explicit CanSetReader(CanSet set);

  Taken take(const CanFrame& frame);
  /// Frames that were received before are part of no set any more. values() stay.
  void forget_before(nanoseconds at) noexcept;
  void forget() noexcept;  ///< all frames; values() stay

  /// Of the newest whole set; NaN before the first.
  [[nodiscard]] std::span<const double> values() const noexcept { return values_; }
  [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
  /// When the oldest frame of it was received.
  [[nodiscard]] nanoseconds received_at() const noexcept { return received_at_; }

 private:
  /// The newest frame of an identifier.
  struct Part {
    CanSignal number_place;
    std::size_t size{0};              ///< it must have
    std::vector<std::size_t> places;  ///< of the values in it
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
