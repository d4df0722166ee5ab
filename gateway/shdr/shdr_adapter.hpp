/// Port for MTConnect agents.
#pragma once

#include <cstdint>
#include <memory>

#include "gateway/feed/snapshot.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

/// One thread serves a few agents: all items on connection, then changes. An agent that sends an
/// overlong line or does not read is disconnected.
class ShdrAdapter {
 public:
  /// @throws std::runtime_error if it cannot listen
  explicit ShdrAdapter(const ShdrSettings& settings);
  ~ShdrAdapter();
  ShdrAdapter(const ShdrAdapter&) = delete;
  ShdrAdapter& operator=(const ShdrAdapter&) = delete;

  void show(const SnapshotPointer& snapshot);  ///< never blocks
  [[nodiscard]] std::uint16_t port() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
