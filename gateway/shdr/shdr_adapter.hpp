/// The port that an MTConnect agent connects to.
#pragma once

#include <cstdint>
#include <memory>

#include "gateway/feed/snapshot.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

/// A thread of its own serves a few agents: everything when one connects, then what changes. An
/// agent that sends what is no line, or does not read, is cut off.
class ShdrAdapter {
 public:
  /// @throws std::runtime_error when it cannot listen
  explicit ShdrAdapter(const ShdrSettings& settings);
  ~ShdrAdapter();
  ShdrAdapter(const ShdrAdapter&) = delete;
  ShdrAdapter& operator=(const ShdrAdapter&) = delete;

  void show(const SnapshotPointer& snapshot);  ///< never waits
  [[nodiscard]] std::uint16_t port() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
