/// Thermocouple readings from the frames of one CAN interface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/can/can_config.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/sensors/can_interface_source.hpp"

namespace thermocomp {

/// Only listens. A reading's time is the arrival of its frame at the interface. A frame with
/// unchanged counter is ignored: neither value nor time changes (except for the first frame after a
/// loss of the bus). A J1939 group is accepted from any sender; while two send it, its readings are
/// device_error. While the interface is missing, down or bus-off the readings are no_answer;
/// opening is retried for ever.
///
/// Frames are fetched in batches at intervals of at least 10 ms: their times are the kernel's, and
/// a busy bus costs little.
class CanSource final : public CanInterfaceSource {
 public:
  /// @throws InvalidValue for an impossible signal, interface or number of identifiers
  explicit CanSource(const CanBusConfig& config);
  ~CanSource() override;

 private:
  struct Channel {
    CanId id;
    CanSignal signal;
    std::optional<CanField> counter;
    std::size_t device{0};  ///< index in the bus' configuration
    std::size_t sensor{0};  ///< index in the whole configuration
    /// Counter in the last frame of the identifier, and in the last one that carried the signal.
    /// Devices count frames or rounds of all pages: a change of either is progress.
    std::optional<std::uint64_t> count_of_frame{};
    std::optional<std::uint64_t> count_of_page{};
    // Only for a J1939 group:
    std::optional<CanId> sender{};  ///< of the last frame
    std::optional<CanId> rival{};   ///< second sender within a short time
    nanoseconds last_frame{};
    nanoseconds contested_until{};  ///< two senders are assumed until then
  };
  enum class Arrival { other_page, unchanged, renewed, bad_frame };

  void bus_opened(nanoseconds now) override;
  void bus_closed(nanoseconds now) override;
  void work() override;
  void write_readings(std::vector<Reading>& readings) override;
  [[nodiscard]] std::vector<UnitHealth> units(nanoseconds now) override;

  static std::vector<Channel> channels_of(const CanBusConfig& config);
  static std::vector<std::size_t> sensors_of(const std::vector<Channel>& channels);
  explicit CanSource(const CanBusConfig& config, std::vector<Channel> channels);
  void take(const CanFrame& frame);
  void take(const CanFrame& frame, Channel& channel, std::size_t& counted);
  static std::string contest(const CanFrame& frame, Channel& channel);
  static Arrival arrival_of(const CanFrame& frame, Channel& channel) noexcept;
  static void note_arrival(Arrival arrival, UnitHealth& unit);

  std::vector<Channel> channels_;  ///< in order of identifier, then the groups
  std::size_t groups_begin_{0};
  nanoseconds opened_at_{};
  std::vector<Reading> readings_;  ///< one per channel
  std::vector<UnitHealth> units_;
  std::vector<nanoseconds> last_good_;  ///< arrival of each device's last good frame; 0: none
};

}  // namespace thermocomp
