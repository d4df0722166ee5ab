#include "daemon/cycle/command_queue.hpp"

namespace thermocomp {

std::optional<std::uint64_t> CommandQueue::try_push(const Command& command) noexcept {
  const std::uint64_t head = head_.load(std::memory_order_relaxed);
  if (head - tail_.load(std::memory_order_acquire) == capacity) return std::nullopt;
  Place& place = places_[head % capacity];
  place.command = command;
  place.state.store(State::waiting, std::memory_order_relaxed);
  head_.store(head + 1, std::memory_order_release);
  return head;
}

bool CommandQueue::withdraw(std::uint64_t number) noexcept {
  if (number < tail_.load(std::memory_order_acquire)) return false;  // its place may be another's
  State state = State::waiting;
  return places_[number % capacity].state.compare_exchange_strong(state, State::withdrawn);
}

bool CommandQueue::try_pop(Command& command) noexcept {
  for (std::uint64_t tail = tail_.load(std::memory_order_relaxed);
       tail != head_.load(std::memory_order_acquire); ++tail) {
    Place& place = places_[tail % capacity];
    State state = State::waiting;
    const bool is_ours = place.state.compare_exchange_strong(state, State::taken);
    if (is_ours) command = place.command;
    tail_.store(tail + 1, std::memory_order_release);
    if (is_ours) return true;
  }
  return false;
}

}  // namespace thermocomp
