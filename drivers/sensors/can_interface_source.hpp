/// Sources of readings on a CAN interface (socket, thread, health), with or without a protocol.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/can/can_protocol.hpp"
#include "drivers/can/can_socket.hpp"

namespace thermocomp {

/// An interface that is missing, down or bus-off is retried for ever. The derived class decodes
/// frames; its hooks run on the thread only, and its destructor must call stop().
class CanInterfaceSource : public SensorSource {
 public:
  /// @throws DriverError when the system has no CAN sockets
  void start() final;
  void stop() noexcept final;
  void newest(std::span<Reading> all) noexcept final;
  [[nodiscard]] BusHealth health() const final;

 protected:
  struct Setting {
    std::string name;
    std::string kind;  ///< as in BusHealth
    std::string interface;
    double reconnect_s{0.5};
    nanoseconds patience;  ///< work() is called at least this often while the interface is open
    nanoseconds gather{};  ///< pause after work(), so that frames come in batches
  };
  /// @param wanted   identifiers to receive; more by socket().add_filter()
  /// @param sensors  index in the whole configuration of each reading
  /// @param units    before the start
  /// @throws InvalidValue for an impossible interface or number of identifiers
  CanInterfaceSource(Setting setting, std::vector<CanId> wanted, std::vector<std::size_t> sensors,
                     std::vector<UnitHealth> units);

  /// The bus is now usable.
  virtual void bus_opened(nanoseconds now) = 0;
  /// The bus is not usable: every reading becomes no_answer.
  virtual void bus_closed(nanoseconds now) = 0;
  /// Receives frames and performs what is due.
  virtual void work() = 0;
  /// @param readings  shape (sensors of this bus); overwritten
  virtual void write_readings(std::vector<Reading>& readings) = 0;
  [[nodiscard]] virtual std::vector<UnitHealth> units(nanoseconds now) = 0;

  [[nodiscard]] CanSocket& socket() noexcept { return socket_; }
  /// True if the bus is open and not bus-off, as last reported to the hooks.
  [[nodiscard]] bool usable() const noexcept { return usable_.value_or(false); }
  /// Calls bus_opened() or bus_closed() when the state of the link has changed.
  void follow_link();

 private:
  void run();
  void open();
  void publish();

  const Setting setting_;
  const std::vector<std::size_t> sensors_;
  CanSocket socket_;
  WakeEvent wake_;
  std::atomic<bool> stopping_{false};
  std::optional<bool> usable_;  ///< none: not yet reported to the hooks
  WaitFreeSlot<std::vector<Reading>> slot_;
  mutable std::mutex health_mutex_;
  BusHealth health_;
  BusThread thread_;
};

/// Runs a protocol with a socket, a clock and a thread. While the interface is missing, down or
/// bus-off the protocol is closed, which makes its readings no_answer; opening is retried for ever.
class CanProtocolSource final : public CanInterfaceSource {
 public:
  /// @param kind  as in BusHealth
  /// @throws InvalidValue for an impossible interface or number of identifiers
  CanProtocolSource(std::string name, std::string kind, std::string interface, double reconnect_s,
                    std::unique_ptr<CanProtocol> protocol);
  ~CanProtocolSource() override;

 private:
  void bus_opened(nanoseconds now) override;
  void bus_closed(nanoseconds now) override;
  void work() override;
  void write_readings(std::vector<Reading>& readings) override;
  [[nodiscard]] std::vector<UnitHealth> units(nanoseconds now) override;
  void send();

  std::unique_ptr<CanProtocol> protocol_;
};

}  // namespace thermocomp
