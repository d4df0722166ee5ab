/// Offsets to a controller in CAN frames, and what it applies and measures from its own frames.
#pragma once

#include <atomic>
#include <mutex>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/kinds/can/travel_frames.hpp"
#include "drivers/controllers/write_gate.hpp"
#include "drivers/wait_free_slot.hpp"

namespace thermocomp {

/// Sends its frames each period while there is a command of this epoch. In sync once every frame it
/// listens for has come since the link was (re)established; out of sync as soon as one of them has
/// been missing for silent_after_s, the interface is down or bus-off, or a frame could not be sent.
/// The published time is that of the oldest of these frames. What is sent counts as written once
/// the interface has sent it: where nobody acknowledges, it never does.
///
/// An axis whose command is not valid keeps the value sent last (at first, and on a new link where
/// it can have come from that: what the controller applies); its valid bit is 0. A frame with an
/// axis of which neither is known is not sent, unless the valid bits stand in the same frame. Valid
/// bits and heartbeat are raw numbers: scale and offset are not used; the heartbeat starts anew
/// when its bits are full.
///
/// Of an axis whose controller interpolates along its travel the offsets of all nodes go as one set
/// with a number of its own (CanTravel), while all of them are valid; else its frames are not sent,
/// unless something else stands in them. Each number stands for one content. What the controller
/// shows of it counts when all frames carry the number of one set, and is as old as the oldest of
/// them. Nothing is sent until the frames of whoever sent before this link was started are
/// forgotten; the numbers then go on half-way round from the one in effect, or by the clock where
/// not sent: what is left of a former set in a queue or in a controller that forgets nothing
/// has another number.
class CanController final : public ControllerLink {
 public:
  /// @throws InvalidValue for signals that cannot be or overlap
  explicit CanController(CanControllerConfig config);
  ~CanController() override;

  /// @throws DriverError when the system has no CAN sockets at all
  void start() override;
  void stop() noexcept override;
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override;
  [[nodiscard]] ControllerHealth health() const override;

 private:
  /// A frame we send.
  struct Outgoing {
    CanFrame frame;
    std::vector<std::size_t> axes;
    bool has_valid_bits{false};
    bool has_heartbeat{false};
  };
  /// What has to come anew when the link is (re)established, and then again and again.
  struct Awaited {
    nanoseconds received_at{};
    bool seen{false};  ///< since the link was (re)established
  };
  /// A frame we listen for, with where its values go in state_; those of sets go to shown_sets_.
  struct Incoming : Awaited {
    CanId id;
    std::vector<std::pair<CanSignal, double*>> values{};
  };
  /// The set of an axis that the controller shows.
  struct ShownSet : Awaited {
    std::size_t axis{0};
    CanSetReader reader;
  };

  void plan_outgoing();
  void plan_incoming();
  Outgoing& outgoing(const CanSignal& signal);
  Incoming& incoming(const CanSignal& signal);
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
  void tell_error();
  void synchronise();
  void hold_what_is_applied(bool link_is_new);
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
  std::vector<std::size_t> first_;  ///< one an axis: its first offset in command and state
  std::vector<Outgoing> outgoing_;  ///< offsets first, then valid bits, then heartbeat
  ControllerState state_;           ///< the thread's own
  std::vector<Incoming> incoming_;
  std::vector<ShownSet> shown_sets_;
  std::vector<std::uint64_t> set_numbers_;  ///< one an axis: of the set sent last
  bool numbered_{false};                    ///< they have begun
  nanoseconds quiet_until_{};               ///< before, nothing is sent
  CanSocket socket_;
  WriteGate gate_;
  std::uint64_t heartbeat_{0};
  std::uint64_t bus_offs_{0};  ///< as the socket counts, up to the newest look
  std::uint64_t handed_{0};    ///< frames given to the interface, as the socket counts sent_out()
  std::uint64_t written_{0};   ///< of them, sent when the newest write was confirmed
  bool silent_{false};         ///< lost because frames were missing, and not back
  nanoseconds next_send_{};
  std::array<double, axes_max> held_um_{};  ///< what an axis that is not valid goes on sending
  WaitFreeSlot<ControllerState> states_;
  WaitFreeSlot<OfferedCommand> commands_;
  WakeEvent wake_;
  std::atomic<bool> stopping_{false};
  mutable std::mutex health_mutex_;
  ControllerHealth health_;
  BusThread thread_;
};

}  // namespace thermocomp
