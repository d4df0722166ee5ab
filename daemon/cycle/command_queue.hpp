/// Commands of the operator on their way to the cycle.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "estimator/types.hpp"

namespace thermocomp {

/// One producer, one consumer, wait-free. What has not been taken yet can be withdrawn: either the
/// consumer gets it or the producer has it back, never both.
class CommandQueue {
 public:
  static constexpr std::size_t capacity = 64;

  /// Producer. @return the command's number, counted from 0; none: 64 wait already
  std::optional<std::uint64_t> try_push(const Command& command) noexcept;
  /// Producer. @param number  of a command that was pushed and is not known to be done
  /// @return false: the consumer has it
  [[nodiscard]] bool withdraw(std::uint64_t number) noexcept;
  /// Consumer; leaves out what was withdrawn.
  [[nodiscard]] bool try_pop(Command& command) noexcept;
  /// Consumer: all before this number were taken or withdrawn.
  [[nodiscard]] std::uint64_t taken() const noexcept {
    return tail_.load(std::memory_order_relaxed);
  }

 private:
  enum class State : std::uint8_t { waiting, taken, withdrawn };
  struct Place {
    Command command;
    std::atomic<State> state{State::taken};
  };

  std::array<Place, capacity> places_{};
  std::atomic<std::uint64_t> head_{0};
  std::atomic<std::uint64_t> tail_{0};
};

}  // namespace thermocomp
