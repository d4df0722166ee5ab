#include "drivers/can/canopen/canopen_node.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/bus_thread.hpp"
#include "drivers/can/signal_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

using namespace std::chrono_literals;

constexpr std::uint8_t command_start = 0x01;
constexpr std::uint8_t command_pre_operational = 0x80;
constexpr std::uint8_t state_boot_up = 0x00;
constexpr std::uint8_t toggle_bit = 0x80;  // of node guarding, which uses the same identifier

constexpr std::uint16_t error_register_object = 0x1001;
constexpr std::uint16_t heartbeat_object = 0x1017;
constexpr std::uint16_t first_pdo_communication = 0x1800;
constexpr std::uint16_t first_pdo_mapping = 0x1A00;
constexpr std::uint16_t filler_indices = 0x20;  // indices of data types mark unused bits
constexpr std::uint32_t cob_id_invalid = 0x80000000;
constexpr std::uint32_t cob_id_extended = 0x20000000;
constexpr int mapped_max = 64;

constexpr nanoseconds first_pause = 1s;
constexpr nanoseconds longest_pause = 10s;
constexpr nanoseconds start_again_every = 1s;
constexpr nanoseconds other_master_lasts = 5s;  // its work on the node
constexpr nanoseconds second_answer_lasts = 5s;

std::uint16_t pdo_object(std::uint16_t first, std::size_t number) {
  return static_cast<std::uint16_t>(first + number - 1);
}

/// The whole TPDO; for a mapped object its bytes.
std::span<const std::uint8_t> bytes_of(std::span<const std::uint8_t> data,
                                       const CanopenChannel& channel) {
  const auto first = static_cast<std::size_t>(channel.signal.start_bit / 8);
  if (channel.way == CanopenWay::pdo_bits || first >= data.size()) return data;
  const auto bytes = static_cast<std::size_t>((channel.signal.length_bits + 7) / 8);
  return data.subspan(first, std::min(bytes, data.size() - first));
}

bool supports_emergencies(const CanopenChannel& channel) {
  return channel.emergency_channel != 0 || !channel.emergency_codes.empty();
}

std::string unheard_text(std::uint64_t error_register) {
  return "error register 1001:00 is " + hexadecimal(error_register, 2) +
         ": an emergency was sent unheard; mend its cause, or switch the node off and on";
}

}  // namespace

std::vector<std::size_t> place_channels(const CanopenMapping& mapping,
                                        std::vector<CanopenChannel>& channels) {
  std::vector<std::size_t> placed;
  int bit = 0;
  for (const CanopenMapped& mapped : mapping.objects) {
    for (std::size_t i = 0; i < channels.size(); ++i) {
      CanopenChannel& channel = channels[i];
      if (channel.way != CanopenWay::pdo_object || !(channel.object == mapped.object)) continue;
      if (mapped.object.index < filler_indices) continue;
      // A length other than that of the type means another object than the configured one.
      if (mapped.length_bits != channel.signal.length_bits) continue;
      if (bit + mapped.length_bits > static_cast<int>(8 * canopen_bytes_max)) continue;
      channel.signal.id = mapping.cob_id;
      channel.signal.start_bit = bit;
      placed.push_back(i);
    }
    bit += mapped.length_bits;
  }
  return placed;
}

CanopenNode::CanopenNode(const CanopenNodeConfig& config, const CanopenBusConfig& bus)
    : config_(config),
      starts_(bus.start_nodes),
      writes_(config.writes),
      channels_(config.channels),
      readings_(config.channels.size()),
      raw_(config.channels.size()),
      emergencies_(config.channels.size()),
      poll_at_(config.channels.size()),
      vouched_for_(config.channels.size()),
      client_(config.node, from_seconds(bus.sdo_timeout_s)),
      retry_pause_(first_pause),
      heartbeats_(from_seconds(config.heartbeat_s)) {
  if (config_.heartbeat_s > 0.0) {
    const auto period_ms = static_cast<std::uint64_t>(std::lround(config_.heartbeat_s * 1e3));
    CanopenWrite write{{heartbeat_object, 0}, std::vector<std::uint8_t>(2)};
    put_little_endian(write.bytes, 0, 2, period_ms);
    writes_.push_back(std::move(write));
  }
  counters_.name = config_.name;
  place_configured();
}

// -------------------------------------------------------------------- set-up

void CanopenNode::opened(nanoseconds now) {
  retry_pause_ = first_pause;
  begin_setup(now);
}

void CanopenNode::closed(nanoseconds now) {
  stop_reading(now);
  frames_.clear();
  jobs_.clear();
  phase_ = Phase::closed;
  heartbeats_.forget();
  for (Watched& each : watched_) each.rate.forget();
}

/// Forgets the mappings that were read.
void CanopenNode::place_configured() {
  for (CanopenChannel& channel : channels_) {
    if (channel.way != CanopenWay::pdo_bits) channel.signal.id = 0;
  }
  for (const CanopenMapping& mapping : config_.mappings) place_channels(mapping, channels_);
}

void CanopenNode::begin_setup(nanoseconds now) {
  stop_reading(now);
  place_configured();
  poll_error_.clear();
  refused_.clear();
  cob_ids_reported_.clear();
  lost_ = left_ = false;
  received_at_ = now;
  jobs_.clear();
  for (std::size_t i = 0; i < writes_.size(); ++i) {
    jobs_.push_back({Work::write, i, 0});
    jobs_.push_back({Work::verify, i, 0});
  }
  for (const int number : config_.mappings_read) {
    jobs_.push_back({Work::ask_cob_id, static_cast<std::size_t>(number), 0});
    jobs_.push_back({Work::ask_count, static_cast<std::size_t>(number), 0});
  }
  // Emergencies and their resets may have been sent unheard.
  if (std::any_of(channels_.begin(), channels_.end(), supports_emergencies))
    jobs_.push_back({Work::ask_errors, 0, 0});
  phase_ = Phase::setting_up;
  // Some nodes refuse settings while operational.
  if (!writes_.empty() && starts_) command(command_pre_operational);
  next_job(now);
}

void CanopenNode::next_job(nanoseconds now) {
  if (jobs_.empty()) return setup_done(now);
  start_job(jobs_.front(), now);
}

void CanopenNode::start_job(const Job& job, nanoseconds now) {
  ++counters_.requests;
  switch (job.work) {
    case Work::write:
      return client_.write(writes_[job.which].object, writes_[job.which].bytes, now);
    case Work::verify:
      return client_.read(writes_[job.which].object, now);
    case Work::ask_errors:
      return client_.read({error_register_object, 0}, now);
    case Work::ask_cob_id:
      return client_.read({pdo_object(first_pdo_communication, job.which), 1}, now);
    case Work::ask_count:
    case Work::ask_entry:
      return client_.read(
          {pdo_object(first_pdo_mapping, job.which), static_cast<std::uint8_t>(job.entry)}, now);
  }
}

void CanopenNode::take_job(const SdoResult& result, nanoseconds now) {
  if (result.outcome == SdoOutcome::timed_out) {
    return setup_failed(to_string(result), Fault::no_answer, now);
  }
  if (result.outcome == SdoOutcome::aborted && jobs_.front().work == Work::write) {
    refused_ = to_string(result);  // the node may already have the value, so it is read back next
    jobs_.pop_front();
    return next_job(now);
  }
  if (result.outcome != SdoOutcome::done) {
    const std::string why =
        refused_.empty() ? "reading " + to_string(result) : "setting " + refused_;
    return setup_failed(why, Fault::device_error, now);
  }
  const Job job = jobs_.front();
  jobs_.pop_front();
  take_answer(job, result.bytes, now);
  if (phase_ == Phase::setting_up) next_job(now);
}

void CanopenNode::take_answer(const Job& job, std::span<const std::uint8_t> bytes,
                              nanoseconds now) {
  if (job.work == Work::write) return;
  if (job.work == Work::ask_errors) {
    errors_unheard_ = little_endian(bytes, 0, 1);
    if (errors_unheard_ == 0) return forget_emergencies();
    if (emergency_text_.empty()) emergency_text_ = unheard_text(errors_unheard_);
    return;
  }
  if (job.work != Work::verify) return take_mapping_answer(job, bytes, now);
  const CanopenWrite& write = writes_[job.which];
  // A node that sends no length pads the value.
  const bool same = bytes.size() >= write.bytes.size() &&
                    std::equal(write.bytes.begin(), write.bytes.end(), bytes.begin());
  const std::string what = refused_.empty() ? to_string(write.object) + ":" : refused_ + ", and";
  refused_.clear();
  if (same) return;
  setup_failed("setting " + what + " reads back " + std::to_string(little_endian(bytes, 0, 8)) +
                   " instead of " + std::to_string(little_endian(write.bytes, 0, 8)) +
                   (write.object.index == heartbeat_object
                        ? " ms: heartbeat_timeout_s without heartbeat_s sets nothing"
                        : ""),
               Fault::device_error, now);
}

void CanopenNode::take_mapping_answer(const Job& job, std::span<const std::uint8_t> bytes,
                                      nanoseconds now) {
  const std::string pdo = "TPDO " + std::to_string(job.which);
  const auto value = static_cast<std::uint32_t>(little_endian(bytes, 0, 4));
  if (job.work == Work::ask_cob_id) {
    if ((value & cob_id_invalid) != 0) {
      return setup_failed(pdo + " is switched off in the node", Fault::device_error, now);
    }
    if ((value & cob_id_extended) != 0) {
      return setup_failed(pdo + " has a COB-ID of 29 bits", Fault::device_error, now);
    }
    mapping_ = {value & 0x7FFu, {}};
    return;
  }
  if (job.work == Work::ask_count) {
    entries_ = static_cast<int>(value & 0xFFu);
    if (entries_ > mapped_max) {
      return setup_failed(pdo + " has a mapping of variable form", Fault::device_error, now);
    }
  } else {
    mapping_.objects.push_back(
        {{static_cast<std::uint16_t>(value >> 16), static_cast<std::uint8_t>(value >> 8)},
         static_cast<int>(value & 0xFFu)});
  }
  if (job.entry < entries_) {
    jobs_.push_front({Work::ask_entry, job.which, job.entry + 1});
  } else {
    finish_mapping();
  }
}

void CanopenNode::finish_mapping() {
  place_channels(mapping_, channels_);
  cob_ids_reported_.push_back(mapping_.cob_id);
}

void CanopenNode::setup_failed(const std::string& reason, Fault fault, nanoseconds now) {
  jobs_.clear();
  setup_error_ = reason;
  phase_ = Phase::waiting;
  retry_at_ = now + retry_pause_;
  retry_pause_ = std::min(2 * retry_pause_, longest_pause);
  lose_all(fault, now);
}

void CanopenNode::setup_done(nanoseconds now) {
  phase_ = Phase::running;
  setup_error_.clear();
  retry_pause_ = first_pause;
  received_at_ = now;
  state_.reset();
  start_again_at_ = now + start_again_every;
  if (starts_) command(command_start);
  watched_.clear();
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    const CanopenChannel& channel = channels_[i];
    poll_at_[i] = now;
    if (channel.way == CanopenWay::sdo) continue;
    const std::uint32_t cob_id = channel.signal.id;
    if (cob_id == 0) {
      setup_error_ = to_string(channel.object) + " is in none of the node's TPDOs with " +
                     std::to_string(channel.signal.length_bits) + " bits";
      lose(i, Fault::device_error, now);
    }
    const bool known = std::any_of(watched_.begin(), watched_.end(),
                                   [&](const Watched& each) { return each.cob_id == cob_id; });
    if (known) continue;
    watched_.push_back({cob_id, RateWatch(from_seconds(config_.pdo_period_s)), now + silent_after});
  }
}

void CanopenNode::forget_emergencies() {
  errors_unheard_ = 0;
  emergencies_.assign(emergencies_.size(), std::nullopt);
  emergency_text_.clear();
}

void CanopenNode::command(std::uint8_t what) {
  CanFrame frame;
  frame.id = {0, false};
  frame.size = 2;
  frame.data[0] = what;
  frame.data[1] = static_cast<std::uint8_t>(config_.node);
  frames_.push_back(frame);
}

// -------------------------------------------------------------------- frames of the node

void CanopenNode::take_heartbeat(std::span<const std::uint8_t> data, nanoseconds at) {
  if (data.size() != 1) {
    ++counters_.bad_frames;
    return;
  }
  if (phase_ == Phase::closed) return;
  received_at_ = at;
  good_at_ = at;
  const auto state = static_cast<std::uint8_t>(data[0] & ~toggle_bit);
  if (state == state_boot_up) {
    // A reboot clears the node's errors.
    forget_emergencies();
    retry_pause_ = first_pause;
    begin_setup(at);
    return;
  }
  heartbeats_.arrived(at);
  if (lost_) return begin_setup(at);
  if (phase_ != Phase::running) return;
  if (state == state_operational) {
    // Mapping and settings may have been changed meanwhile.
    if (left_) return begin_setup(at);
    if (config_.pdo_on_change) renew_pdos(at);
  } else if (state_ == state_operational && !(writes_.empty() && config_.mappings_read.empty())) {
    left_ = true;
    start_again_at_ = at + other_master_lasts;
    stop_reading(at);
  }
  state_ = state;
  if (state != state_operational && starts_ && at >= start_again_at_) {
    // The node was stopped, or the command was lost.
    start_again_at_ = at + start_again_every;
    command(command_start);
  }
}

/// A heartbeat of a node that sends on change confirms its last values.
void CanopenNode::renew_pdos(nanoseconds at) {
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    if (channels_[i].way == CanopenWay::sdo || readings_[i].fault == Fault::no_answer) continue;
    readings_[i].taken_at = at;
  }
}

void CanopenNode::take_emergency(std::span<const std::uint8_t> data, nanoseconds at) {
  const std::optional<Emergency> emergency = read_emergency(data);
  if (!emergency) {
    ++counters_.bad_frames;
    return;
  }
  if (!emergency->is_reset()) {
    ++counters_.exceptions;
    emergency_text_ = "emergency " + to_string(*emergency);
  } else if (emergency->error_register == 0) {
    errors_unheard_ = 0;
    emergency_text_.clear();
  }
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    const auto fault = emergency_fault(*emergency, config_.emergency, channels_[i]);
    if (!fault) continue;
    if (*fault == Fault::none) {
      emergencies_[i].reset();  // the next value is the first one after the error
    } else {
      emergencies_[i] = fault;
      lose(i, *fault, at);
    }
  }
}

void CanopenNode::take_sdo(std::span<const std::uint8_t> data, nanoseconds at) {
  if (phase_ == Phase::closed) return;
  client_.take(data, at);
  if (client_.second_answers() != second_answers_seen_) {
    second_answers_seen_ = client_.second_answers();
    second_answer_until_ = at + second_answer_lasts;
  }
  take_result(at);
}

bool CanopenNode::take_pdo(std::uint32_t cob_id, std::span<const std::uint8_t> data,
                           nanoseconds at) {
  if (phase_ != Phase::running || cob_id == 0) return false;
  for (Watched& each : watched_) {
    if (each.cob_id != cob_id) continue;
    each.rate.arrived(at);
    each.due_by = config_.pdo_on_change ? nanoseconds::max() : at + silent_after;
  }
  bool has_channel = false;
  bool is_short = false;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    const CanopenChannel& channel = channels_[i];
    if (channel.way == CanopenWay::sdo || channel.signal.id != cob_id) continue;
    has_channel = true;
    const CanValue decoded = decode(data, channel.signal);
    is_short = is_short || decoded.fault == Fault::bad_frame;
    if (!running()) continue;
    const auto shown = bytes_of(data, channel);
    raw_[i].value.assign(shown.begin(), shown.end());
    show(i, decoded, at);
  }
  if (is_short) ++counters_.bad_frames;
  if (has_channel && !is_short) {
    ++counters_.answers;
    good_at_ = at;
  }
  return has_channel;
}

/// Publishes a value unless an emergency or a second sender makes it invalid.
void CanopenNode::show(std::size_t channel, const CanValue& decoded, nanoseconds at) {
  if (emergencies_[channel]) return lose(channel, *emergencies_[channel], at);
  const bool is_unheard = errors_unheard_ != 0 && supports_emergencies(channels_[channel]);
  if (is_unheard || is_doubtful(channel)) return lose(channel, Fault::device_error, at);
  readings_[channel] = {decoded.value, at, decoded.fault};
}

void CanopenNode::lose(std::size_t channel, Fault fault, nanoseconds at) {
  readings_[channel] = {not_a_number, at, fault};
}

void CanopenNode::lose_all(Fault fault, nanoseconds at) {
  for (std::size_t i = 0; i < readings_.size(); ++i) {
    lose(i, fault, at);
    raw_[i] = {};
    vouched_for_[i] = 0;
  }
}

// -------------------------------------------------------------------- polling and watching

void CanopenNode::poll(nanoseconds now) {
  if (client_.busy()) return;
  std::optional<std::size_t> due;  // channel that is longest overdue
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    if (channels_[i].way != CanopenWay::sdo || now < poll_at_[i]) continue;
    if (!due || poll_at_[i] < poll_at_[*due]) due = i;
  }
  if (!due) return;
  poll_at_[*due] = now + from_seconds(channels_[*due].poll_s);
  polled_ = due;
  ++counters_.requests;
  client_.read(channels_[*due].object, now);
}

void CanopenNode::take_poll(const SdoResult& result, nanoseconds now) {
  const std::size_t channel = *polled_;
  if (result.outcome != SdoOutcome::done) {
    const bool silent = result.outcome == SdoOutcome::timed_out;
    poll_error_ = to_string(result);
    forget_poll();
    vouched_for_[channel] = 0;
    return lose(channel, silent ? Fault::no_answer : Fault::device_error, now);
  }
  if (polled_value_) return take_status(result, now);
  poll_error_.clear();
  ++counters_.answers;
  const auto& status = channels_[channel].status;
  if (status && result.bytes.size() <= canopen_bytes_max) {
    polled_value_ = result.bytes;
    ++counters_.requests;
    return client_.read(status->object, now);
  }
  raw_[channel] = {result.bytes, {}};
  forget_poll();
  if (result.bytes.size() > canopen_bytes_max) {
    poll_error_ = to_string(result.object) + ": " + std::to_string(result.bytes.size()) +
                  " bytes are no number";
    return lose(channel, Fault::bad_frame, now);
  }
  show(channel, decode(result.bytes, channels_[channel].signal), now);
}

/// A value is accepted between two good statuses; after the first one it is read at once.
void CanopenNode::take_status(const SdoResult& result, nanoseconds now) {
  const std::size_t channel = *polled_;
  const RawReading raw{*polled_value_, result.bytes};
  forget_poll();
  const CanStatus& status = channels_[channel].status->number;
  const bool is_short = result.bytes.size() < bytes_needed(status.field);
  const Fault fault =
      is_short ? Fault::bad_frame : fault_of(status, extract_raw(result.bytes, status.field));
  const bool vouched_before = vouched_for_[channel] != 0;
  vouched_for_[channel] = fault == Fault::none ? 1 : 0;
  if (fault == Fault::none && !vouched_before) {
    poll_at_[channel] = now;
    return;
  }
  raw_[channel] = raw;
  if (fault != Fault::none) return lose(channel, fault, now);
  show(channel, decode(raw.value, channels_[channel].signal), now);
}

void CanopenNode::forget_poll() noexcept {
  polled_.reset();
  polled_value_.reset();
}

void CanopenNode::take_result(nanoseconds now) {
  const std::optional<SdoResult> result = client_.result();
  if (!result) return;
  if (result->outcome == SdoOutcome::timed_out) {
    ++counters_.timeouts;
  } else {
    good_at_ = now;
    if (result->outcome != SdoOutcome::done) ++counters_.exceptions;
  }
  if (polled_) {
    take_poll(*result, now);
  } else if (phase_ == Phase::setting_up) {
    take_job(*result, now);
  }
}

void CanopenNode::watch_heartbeat(nanoseconds now) {
  const nanoseconds timeout = from_seconds(config_.heartbeat_timeout_s);
  if (timeout == nanoseconds{0} || lost_ || phase_ != Phase::running) return;
  if (now - received_at_ <= timeout) return;
  lost_ = true;
  stop_reading(now);
}

void CanopenNode::stop_reading(nanoseconds now) {
  client_.cancel();
  forget_poll();
  lose_all(Fault::no_answer, now);
}

bool CanopenNode::is_doubtful(std::size_t channel) const noexcept {
  if (!conflict_.empty() || heartbeats_.too_often() || second_answer_until_ != nanoseconds{0}) {
    return true;
  }
  const CanopenChannel& asked = channels_[channel];
  if (asked.way == CanopenWay::sdo) return false;
  return std::any_of(watched_.begin(), watched_.end(), [&](const Watched& each) {
    return each.cob_id == asked.signal.id && each.rate.too_often();
  });
}

void CanopenNode::watch_duplicates(nanoseconds now) {
  heartbeats_.advance(now);
  for (Watched& each : watched_) each.rate.advance(now);
  if (now >= second_answer_until_) second_answer_until_ = nanoseconds{0};
  if (phase_ != Phase::running) return;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    if (is_doubtful(i) && readings_[i].fault == Fault::none) lose(i, Fault::device_error, now);
  }
}

void CanopenNode::claim_conflict(const std::string& reason, nanoseconds now) {
  conflict_ = reason;
  watch_duplicates(now);
}

void CanopenNode::advance(nanoseconds now) {
  if (phase_ == Phase::closed) return;
  client_.advance(now);
  take_result(now);
  watch_duplicates(now);
  watch_heartbeat(now);
  if (phase_ == Phase::waiting && now >= retry_at_) begin_setup(now);
  if (running()) poll(now);
}

std::optional<CanFrame> CanopenNode::next_frame() {
  // Commands first: a node must be pre-operational before a write.
  if (!frames_.empty()) {
    const CanFrame frame = frames_.front();
    frames_.pop_front();
    return frame;
  }
  return client_.next_frame();
}

}  // namespace thermocomp
