/// Saving, loading and counting of the estimator's inner state, which each part lists once.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "estimator/checks.hpp"

namespace thermocomp {

/// A part defines `void visit_state(StateArchive& archive) { archive(a_, b_, c_); }`. Only numbers,
/// enums, durations and vectors or arrays of them: no padding, so equal states have equal bytes.
class StateArchive {
 public:
  /// Counts the bytes of the visited state.
  StateArchive() = default;
  /// Saves into `out`, which must be large enough (checked). Never allocates, never throws.
  explicit StateArchive(std::span<std::byte> out) : mode_(Mode::save), out_(out) {}
  /// Loads from `in`. @throws std::runtime_error when `in` is too short or of another layout
  explicit StateArchive(std::span<const std::byte> in) : mode_(Mode::load), in_(in) {}

  [[nodiscard]] std::size_t position_bytes() const noexcept { return position_; }

  template <class... T>
  void operator()(T&... values) {
    (visit(values), ...);
  }

 private:
  enum class Mode { count, save, load };

  template <class Rep, class Period>
  void visit(std::chrono::duration<Rep, Period>& value) {
    raw(&value, sizeof value);
  }
  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void visit(T& value) { raw(&value, sizeof value); }
  template <class T, std::size_t n>
  void visit(std::array<T, n>& values) {
    for (T& value : values) visit(value);
  }
  template <class T>
  void visit(std::vector<T>& values) {
    std::size_t size = values.size();
    raw(&size, sizeof size);
    // Sizes are fixed at construction; another size is another layout.
    if (size != values.size()) throw std::runtime_error("estimator state of another layout");
    for (T& value : values) visit(value);
  }
  template <class T>
  requires requires(T& part, StateArchive& archive) { part.visit_state(archive); }
  void visit(T& part) { part.visit_state(*this); }

  void raw(void* data, std::size_t size) {
    if (mode_ == Mode::save) {
      THERMOCOMP_ENSURE(position_ + size <= out_.size());
      std::memcpy(out_.data() + position_, data, size);
    } else if (mode_ == Mode::load) {
      if (position_ + size > in_.size()) throw std::runtime_error("estimator state is cut short");
      std::memcpy(data, in_.data() + position_, size);
    }
    position_ += size;
  }

  Mode mode_{Mode::count};
  std::span<std::byte> out_;
  std::span<const std::byte> in_;
  std::size_t position_{0};
};

}  // namespace thermocomp
