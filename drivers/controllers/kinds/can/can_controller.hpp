/// Offsets to a controller in CAN frames; applied offsets and signals from its frames.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/kinds/can/travel_frames.hpp"

namespace thermocomp {

/// Sends its frames each period while there is a command of this epoch. Synchronised once every
/// configured frame has been received since the link was (re)established; no longer when one of
/// them is missing for silent_after_s, the interface is down or bus-off, or a frame could not be
/// sent. The published time is that of the oldest of these frames. Frames count as written once the
/// interface has sent them, which requires an acknowledgement.
///
/// An axis whose command is not valid keeps the value sent last; at first, and on a new link if it
/// can result from that value, the applied offset. Its valid bit is 0. A frame with an axis for
/// which neither is known is sent only if it also contains the valid bits. Valid bits and heartbeat
/// are raw numbers without scale and offset; the heartbeat wraps around.
///
/// For an axis whose controller interpolates along its travel, the offsets of all nodes are sent as
/// one numbered set (CanTravel) while all of them are valid; otherwise frames that contain only
/// such sets are not sent. A number identifies one content. A read-back set counts when all its
/// frames carry the same number; its age is that of the oldest. Nothing is sent until frames from
/// before the start of this link have expired; numbering then continues half a cycle after the
/// number in effect (without read-back: from the clock), so that remains of an earlier set in a
/// queue or in the controller have another number.
class CanController final : public ControllerLink {
 public:
  /// @throws InvalidValue for impossible or overlapping signals
  explicit CanController(CanControllerConfig config);
  ~CanController() override;

  /// @throws DriverError when the system has no CAN sockets
  void start() override;
  void stop() noexcept override;
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

 private:
  struct Outgoing {
    CanFrame frame;
    std::vector<std::size_t> axes;
    bool has_valid_bits{false};
    bool has_heartbeat{false};
  };
  /// Received data that must be renewed after each (re)start of the link and regularly after that.
  struct Awaited {
    nanoseconds received_at{};
    bool seen{false};  ///< since the link was (re)established
  };
  /// A frame to receive, with the places of its values in state_; sets are in shown_sets_.
  struct Incoming : Awaited {
    CanId id;
    std::string what{};         ///< "applied of axis z, cutting_on"
    std::size_t short_bytes{};  ///< of the last frame, if these are too few
    bool is_short{false};
    std::vector<std::pair<CanSignal, double*>> values{};
  };
  /// The read-back set of an axis.
  struct ShownSet : Awaited {
    std::size_t axis{0};
    CanSetReader reader;
  };

  void plan_outgoing();
  void plan_incoming();
  Outgoing& outgoing(const CanSignal& signal);
  Incoming& incoming(const CanSignal& signal, const std::string& what);
  void run();
  void open_or_pause();
  void receive();
  void take(const CanFrame& frame);
  bool take_sets(const CanFrame& frame);
  [[nodiscard]] bool all_frames_seen() const noexcept;
  [[nodiscard]] bool all_sets_seen() const noexcept;
  void await_all() noexcept;
  void await_what_is_older(nanoseconds than) noexcept;
  void supervise(nanoseconds now);
  void note_bus_state();
  void report_error();
  [[nodiscard]] std::string missing_text(nanoseconds now) const;
  void synchronise();
  void hold_applied(bool link_is_new);
  void number_sets();
  [[nodiscard]] bool is_driven(std::size_t axis) const noexcept;
  [[nodiscard]] std::span<double> held_um(std::size_t axis) noexcept;
  void send_command(nanoseconds now);
  [[nodiscard]] bool may_be_left_out(const Outgoing& outgoing) const noexcept;
  bool compose_and_send(Outgoing& outgoing);
  void note_written(nanoseconds now);
  void publish(bool online, nanoseconds now);
  void lose(bool same_link = false, bool online = false);

  const CanControllerConfig config_;
  std::vector<std::size_t> first_;  ///< one per axis: its first offset in command and state
  std::vector<Outgoing> outgoing_;  ///< offsets first, then valid bits, then heartbeat
  ControllerState state_;           ///< of the thread
  std::vector<Incoming> incoming_;
  std::vector<ShownSet> shown_sets_;
  std::vector<std::uint64_t> set_numbers_;  ///< one per axis: number of the set sent last
  bool numbered_{false};                    ///< numbering has begun
  nanoseconds no_sending_before_{};         ///< earliest time of sending
  CanSocket socket_;
  WriteGate gate_;
  std::uint64_t heartbeat_{0};
  std::uint64_t bus_offs_{0};  ///< count of the socket at the last check
  std::uint64_t handed_{0};    ///< frames given to the interface, for comparison with sent_out()
  std::uint64_t written_{0};   ///< handed_ at the newest confirmed write
  bool silent_{false};         ///< frames are missing for silent_after_s
  nanoseconds opened_at_{};
  nanoseconds next_send_{};
  std::array<double, axes_max> held_um_{};  ///< sent for an axis that is not valid
  WaitFreeSlot<ControllerState> states_;
  WaitFreeSlot<OfferedCommand> commands_;
  WakeEvent wake_;
  std::atomic<bool> stopping_{false};
  mutable std::mutex health_mutex_;
  ControllerHealth health_;
  BusThread thread_;
};

}  // namespace thermocomp
