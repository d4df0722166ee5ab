/// Master's side of one CANopen node: set-up, start, supervision, reading. Pure: no socket, no
/// clock.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/bus.hpp"
#include "drivers/can/can_protocol.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/canopen/emergency.hpp"
#include "drivers/can/canopen/sdo_client.hpp"

namespace thermocomp {

/// State of a node, CiA 301.
inline constexpr std::uint8_t state_operational = 0x05;

using std::chrono::nanoseconds;

/// Detects a second sender by counting arrivals in windows of eight periods. Two senders give
/// sixteen; more than twelve count as two senders until a window has few enough again. A sender
/// that catches up after a pause stays below.
class RateWatch {
 public:
  static constexpr int periods = 8;
  static constexpr int arrivals_max = 12;

  /// @param period  0: never too often
  explicit RateWatch(nanoseconds period = nanoseconds{0}) noexcept : window_(periods * period) {}

  void arrived(nanoseconds at) noexcept {
    if (window_ == nanoseconds{0}) return;
    advance(at);
    if (++count_ > arrivals_max) too_often_ = true;
  }
  void advance(nanoseconds now) noexcept {
    if (window_ == nanoseconds{0} || now < begin_ + window_) return;
    if (count_ <= arrivals_max) too_often_ = false;
    begin_ = now;
    count_ = 0;
  }
  void forget() noexcept {
    count_ = 0;
    too_often_ = false;
  }
  [[nodiscard]] bool too_often() const noexcept { return too_often_; }

 private:
  nanoseconds window_;
  nanoseconds begin_{};
  int count_{0};
  bool too_often_{false};
};

/// Fills signal.id, start_bit and length_bits of the pdo_object channels that `mapping` contains.
/// @return their indices
std::vector<std::size_t> place_channels(const CanopenMapping& mapping,
                                        std::vector<CanopenChannel>& channels);

/// States of a node: pre-operational during set-up (writes, each verified; COB-IDs and mappings
/// read), then started, then read. A reboot, a lost heartbeat or a lost bus restarts the set-up,
/// and so does the return to operational of a node that left it without our command. Readings are
/// no_answer until it is complete, and device_error if the set-up was refused, two nodes send the
/// same COB-ID, or the error register shows an emergency that was not heard.
class CanopenNode {
 public:
  /// A node silent for longer is shown as not answering, a missing TPDO is reported.
  static constexpr nanoseconds silent_after = std::chrono::seconds{5};

  CanopenNode(const CanopenNodeConfig& config, const CanopenBusConfig& bus);

  void opened(nanoseconds now);
  void closed(nanoseconds now);

  // Frames of the node, by function code.
  void take_heartbeat(std::span<const std::uint8_t> data, nanoseconds at);
  void take_emergency(std::span<const std::uint8_t> data, nanoseconds at);
  void take_sdo(std::span<const std::uint8_t> data, nanoseconds at);
  /// A TPDO of this or another node. @return true if it carries a channel
  bool take_pdo(std::uint32_t cob_id, std::span<const std::uint8_t> data, nanoseconds at);

  void advance(nanoseconds now);
  [[nodiscard]] std::optional<CanFrame> next_frame();

  /// In the order of the node's channels, as are the next two.
  [[nodiscard]] std::span<const Reading> readings() const noexcept { return readings_; }
  [[nodiscard]] const std::vector<RawReading>& raw() const noexcept { return raw_; }
  [[nodiscard]] const std::vector<CanopenChannel>& channels() const noexcept { return channels_; }
  /// COB-IDs of the TPDOs that the node reported as its own since its start.
  [[nodiscard]] std::span<const std::uint32_t> cob_ids_reported() const noexcept {
    return cob_ids_reported_;
  }
  /// Call when another node reports this node's TPDO as its own; empty: none does.
  void claim_conflict(const std::string& reason, nanoseconds now);

  [[nodiscard]] bool running() const noexcept {
    return phase_ == Phase::running && !lost_ && !left_;
  }
  /// Counters and present error.
  [[nodiscard]] UnitHealth health(nanoseconds now) const;

 private:
  enum class Phase { closed, setting_up, waiting, running };
  enum class Work { write, verify, ask_cob_id, ask_count, ask_entry, ask_errors };
  struct Job {
    Work work{Work::write};
    std::size_t which{0};  ///< index of the write, or number of the TPDO
    int entry{0};
  };
  struct Watched {
    std::uint32_t cob_id{0};
    RateWatch rate;
    nanoseconds due_by{};  ///< time after which a missing TPDO is reported
  };

  void place_configured();
  void begin_setup(nanoseconds now);
  void next_job(nanoseconds now);
  void start_job(const Job& job, nanoseconds now);
  void take_job(const SdoResult& result, nanoseconds now);
  void take_answer(const Job& job, std::span<const std::uint8_t> bytes, nanoseconds now);
  void take_mapping_answer(const Job& job, std::span<const std::uint8_t> bytes, nanoseconds now);
  void finish_mapping();
  void setup_failed(const std::string& reason, Fault fault, nanoseconds now);
  void setup_done(nanoseconds now);
  void poll(nanoseconds now);
  void take_poll(const SdoResult& result, nanoseconds now);
  void take_status(const SdoResult& result, nanoseconds now);
  void forget_poll() noexcept;
  void take_result(nanoseconds now);
  void watch_heartbeat(nanoseconds now);
  void stop_reading(nanoseconds now);
  void watch_duplicates(nanoseconds now);
  void renew_pdos(nanoseconds at);
  void command(std::uint8_t what);
  void forget_emergencies();
  void show(std::size_t channel, const CanValue& decoded, nanoseconds at);
  void lose(std::size_t channel, Fault fault, nanoseconds at);
  void lose_all(Fault fault, nanoseconds at);
  [[nodiscard]] bool is_doubtful(std::size_t channel) const noexcept;
  [[nodiscard]] std::string state_text() const;
  [[nodiscard]] std::string trouble(nanoseconds now) const;

  const CanopenNodeConfig config_;
  const bool starts_;  ///< NMT commands are sent
  std::vector<CanopenWrite> writes_;
  std::vector<CanopenChannel> channels_;
  std::vector<Reading> readings_;
  std::vector<RawReading> raw_;
  std::vector<std::optional<Fault>> emergencies_;  ///< one per channel
  std::vector<nanoseconds> poll_at_;
  std::vector<char> vouched_for_;  ///< the status after the last poll was good
  std::vector<Watched> watched_;   ///< one per TPDO
  SdoClient client_;

  Phase phase_{Phase::closed};
  std::deque<Job> jobs_;
  std::optional<std::size_t> polled_;  ///< channel that waits for its answer
  /// Value of that channel until its status arrives.
  std::optional<std::vector<std::uint8_t>> polled_value_;
  CanopenMapping mapping_;  ///< mapping that is being read
  int entries_{0};
  std::vector<std::uint32_t> cob_ids_reported_;
  nanoseconds retry_at_{};
  nanoseconds retry_pause_;
  nanoseconds received_at_{};  ///< last heartbeat, or start of the wait for it
  nanoseconds start_again_at_{};
  bool lost_{false};
  std::optional<std::uint8_t> state_;  ///< of the last heartbeat since the set-up
  bool left_{false};                   ///< it was operational, and is not
  RateWatch heartbeats_;
  std::uint64_t second_answers_seen_{0};
  nanoseconds second_answer_until_{};  ///< until then a second node is assumed
  std::string conflict_;
  std::string refused_;  ///< setting that the node refused, being read back
  std::string setup_error_;
  std::string poll_error_;
  std::uint64_t errors_unheard_{0};  ///< error register at the set-up, until it is empty
  std::string emergency_text_;       ///< of the last emergency, until the errors are reset
  std::deque<CanFrame> frames_;
  UnitHealth counters_;
  nanoseconds good_at_{};  ///< last good answer or TPDO
};

}  // namespace thermocomp
