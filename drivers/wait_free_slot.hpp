/// Passes the newest value from one writer to one reader; neither waits for the other.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace thermocomp {

/// Triple buffer. The writer fills back(), then publish(); the reader calls fresh() and reads
/// front(). Exactly one writer thread and one reader thread. No allocation after construction.
template <class T>
class WaitFreeSlot {
 public:
  WaitFreeSlot() = default;
  explicit WaitFreeSlot(const T& initial) : buffers_{initial, initial, initial} {}

  /// The writer's buffer; it holds an earlier value, so write all of it.
  [[nodiscard]] T& back() noexcept { return buffers_[back_]; }
  void publish() noexcept {
    back_ =
        shared_.exchange(static_cast<std::uint8_t>(back_ | fresh_bit), std::memory_order_acq_rel) &
        index_mask;
  }

  /// The reader's side: takes the newest published value. @return true if front() changed
  bool fresh() noexcept {
    if ((shared_.load(std::memory_order_relaxed) & fresh_bit) == 0) return false;
    front_ = shared_.exchange(front_, std::memory_order_acq_rel) & index_mask;
    return true;
  }
  [[nodiscard]] const T& front() const noexcept { return buffers_[front_]; }

 private:
  static constexpr std::uint8_t fresh_bit = 4;
  static constexpr std::uint8_t index_mask = 3;
  std::array<T, 3> buffers_{};
  std::uint8_t back_{0};
  std::atomic<std::uint8_t> shared_{1};
  std::uint8_t front_{2};
};

}  // namespace thermocomp
