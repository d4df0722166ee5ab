#include "simulated_line.hpp"

#include <algorithm>

namespace thermocomp::faults {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr std::size_t head_bytes = 7;  // of a TCP frame

/// Upper limit for the combined delay: the drivers' limit for recognising late answers on a serial
/// line (LateAnswers::lateness_max).
constexpr nanoseconds lateness_max = milliseconds(2900);

std::uint16_t word_of(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>((bytes[at] << 8) | bytes[at + 1]);
}
void push_word(std::vector<std::uint8_t>& bytes, std::uint16_t word) {
  bytes.push_back(static_cast<std::uint8_t>(word >> 8));
  bytes.push_back(static_cast<std::uint8_t>(word & 0xFFu));
}
void push_checksum(std::vector<std::uint8_t>& bytes) {
  unsigned sum = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    sum ^= byte;
    for (int bit = 0; bit < 8; ++bit) sum = (sum & 1u) != 0 ? (sum >> 1) ^ 0xA001u : sum >> 1;
  }
  bytes.push_back(static_cast<std::uint8_t>(sum));
  bytes.push_back(static_cast<std::uint8_t>(sum >> 8));
}
void push_registers(std::vector<std::uint8_t>& answer, std::uint8_t function,
                    std::span<const std::uint16_t> words) {
  answer.push_back(function);
  answer.push_back(static_cast<std::uint8_t>(2 * words.size()));
  for (const std::uint16_t word : words) push_word(answer, word);
}
void refuse(std::vector<std::uint8_t>& answer, std::uint8_t function, std::uint8_t code) {
  answer = {static_cast<std::uint8_t>(function | 0x80u), code};
}

nanoseconds draw(Chance& chance, nanoseconds low, nanoseconds high) {
  return low + nanoseconds{static_cast<nanoseconds::rep>(
                   chance.fraction() * static_cast<double>((high - low).count()))};
}

}  // namespace

bool SensorUnits::silent(std::size_t place, nanoseconds time) const {
  if (schedule_.find(FaultKind::unit_dead, time, place, units_count) != nullptr) return true;
  if (schedule_.find(FaultKind::unit_reboot, time, place, units_count) != nullptr) return true;
  // No power in the first half, then answers that are not ready.
  const FaultEvent* boots = schedule_.find(FaultKind::unit_not_ready, time, place, units_count);
  return boots != nullptr && time < boots->begin + (boots->end - boots->begin) / 2;
}

void SensorUnits::ask(int unit, std::span<const std::uint8_t> request, nanoseconds time,
                      std::vector<std::uint8_t>& answer) {
  const auto& places = unit_places();
  for (std::size_t place = 0; place < places.size(); ++place) {
    if (places[place].bus != bus_ || places[place].unit != unit) continue;
    if (silent(place, time)) return;
    const FaultEvent* busy = schedule_.find(FaultKind::unit_busy, time, place, units_count);
    if (busy != nullptr && scramble(static_cast<std::uint64_t>(time.count())) % 10 < 7) {
      refuse(answer, request[0], 6);
      return;
    }
    const std::size_t count = word_of(request, 3);
    std::array<std::uint16_t, 125> words{};
    if (request[0] != 4 || count > words.size()) {
      refuse(answer, request[0], 1);
      return;
    }
    thermocouples_.read(place, word_of(request, 1), std::span(words).first(count), time);
    push_registers(answer, 4, std::span(words).first(count));
    return;
  }
}

void ControllerUnit::ask(int /*unit*/, std::span<const std::uint8_t> request, nanoseconds time,
                         std::vector<std::uint8_t>& answer) {
  const std::uint16_t address = word_of(request, 1);
  const std::size_t count = word_of(request, 3);
  std::array<std::uint16_t, 125> words{};
  if (request[0] == 3 && count <= words.size()) {
    if (controller_.read(address, std::span(words).first(count), time))
      push_registers(answer, 3, std::span(words).first(count));
    else
      refuse(answer, request[0], 2);
  } else if (request[0] == 16 && schedule_.find(FaultKind::writes_unanswered, time) != nullptr) {
    controller_.link_broke();
    return;
  } else if (request[0] == 16 && request.size() == 6 + 2 * count) {
    for (std::size_t i = 0; i < count; ++i) words[i] = word_of(request, 6 + 2 * i);
    if (controller_.write(address, std::span(words).first(count), time))
      answer.assign(request.begin(), request.begin() + 5);
    else
      refuse(answer, request[0], 4);
  } else {
    refuse(answer, request[0], 1);
  }
}

/// Only reads are slow, as in a controller that looks values up one by one.
nanoseconds ControllerUnit::takes(std::uint8_t function, nanoseconds time) const {
  const bool slow = function == 3 && schedule_.find(FaultKind::controller_slow, time) != nullptr;
  return slow ? patience_ * 3 / 4 - milliseconds(20) : nanoseconds{};
}

bool SimulatedLine::up(nanoseconds time) const {
  return schedule_.find(FaultKind::bus_down, time, line_, lines_count) == nullptr &&
         end_.powered(time);
}

bool SimulatedLine::hit(FaultKind kind, std::uint64_t one_in) {
  const bool is_hit =
      schedule_.find(kind, clock_, line_, lines_count) != nullptr && chance_.one_in(one_in);
  if (is_hit) end_.link_broke();
  return is_hit;
}

bool SimulatedLine::gone() {
  end_.link_broke();
  return true;
}

bool SimulatedLine::open(std::string& why) {
  clock_ += milliseconds(1);
  frames_.clear();
  open_ = serial_ || up(clock_);
  end_.link_broke();
  broken_ = false;
  mute_ = false;
  if (!open_) why = "connection refused";
  return open_;
}

void SimulatedLine::close() noexcept {
  open_ = false;
  if (!serial_) frames_.clear();
}

bool SimulatedLine::send(std::span<const std::uint8_t> bytes) noexcept {
  if (!open_ || broken_) return false;
  const std::size_t head = serial_ ? 1 : head_bytes;
  if (serial_)  // a port discards unsolicited bytes
    std::erase_if(frames_, [this](const Frame& frame) { return frame.arrives_at <= clock_; });
  if (!up(clock_)) {
    // A disconnected cable is silent; a restarted peer resets the connection.
    broken_ = !serial_ && chance_.one_in(2);
    return gone();
  }
  if (mute_ || hit(FaultKind::frames_lost, 3)) return gone();
  clock_ += microseconds(200);
  answer_.clear();
  const std::size_t tail = serial_ ? 2 : 0;  // the checksum
  end_.ask(bytes[head - 1], bytes.subspan(head, bytes.size() - head - tail), clock_, answer_);
  if (answer_.empty() || hit(FaultKind::frames_lost, 3)) return true;
  Frame frame;
  frame.bytes.assign(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(head));
  if (!serial_) {
    frame.bytes[4] = 0;
    frame.bytes[5] = static_cast<std::uint8_t>(answer_.size() + 1);
  }
  frame.bytes.insert(frame.bytes.end(), answer_.begin(), answer_.end());
  if (serial_) push_checksum(frame.bytes);
  frame.arrives_at =
      clock_ + draw(chance_, milliseconds(1), milliseconds(25)) + end_.takes(bytes[head], clock_);
  if (hit(FaultKind::frames_late, 2))
    frame.arrives_at += draw(chance_, milliseconds(40), milliseconds(2700));
  if (hit(FaultKind::frames_reordered, 2))
    frame.arrives_at += draw(chance_, milliseconds(20), milliseconds(900));
  if (hit(FaultKind::frames_garbled, 2)) spoil(frame);
  if (hit(FaultKind::frames_truncated, 2)) {
    frame.bytes.resize(1 + chance_.below(frame.bytes.size() - 1));
    frame.cut = true;
    mute_ = !serial_;  // no bytes follow lost ones in a stream
  }
  if (!mute_ && hit(FaultKind::frames_doubled, 2)) {
    Frame again = frame;
    // On a serial line directly behind the first: if a gateway held it longer, it could not be
    // distinguished from the answer to another request.
    again.arrives_at += serial_ ? draw(chance_, microseconds(200), milliseconds(1))
                                : draw(chance_, milliseconds(1), milliseconds(400));
    deliver(std::move(again));
  }
  deliver(std::move(frame));
  return true;
}

/// On a serial line the checksum detects it. TCP protects its data; a bad gateway damages what it
/// writes itself: header, function and length.
void SimulatedLine::spoil(Frame& frame) {
  if (serial_) {
    frame.bytes.back() = static_cast<std::uint8_t>(frame.bytes.back() ^ 0x40u);
    return;
  }
  // Not the transaction number: another request's answer with this number is undetectable.
  const std::size_t at = 2 + chance_.below(std::min(frame.bytes.size(), head_bytes + 2) - 2);
  frame.bytes[at] = static_cast<std::uint8_t>(frame.bytes[at] ^ (1u << chance_.below(8)));
}

void SimulatedLine::deliver(Frame frame) {
  frame.arrives_at = std::min(frame.arrives_at, clock_ + lateness_max);
  const auto later = std::find_if(frames_.begin(), frames_.end(), [&](const Frame& other) {
    return other.arrives_at > frame.arrives_at;
  });
  frames_.insert(later, std::move(frame));
}

PortWait SimulatedLine::wait_for_input(nanoseconds deadline) noexcept {
  if (broken_) return PortWait::ready;
  if (!frames_.empty() && frames_.front().arrives_at <= deadline) {
    clock_ = std::max(clock_, frames_.front().arrives_at);
    return PortWait::ready;
  }
  clock_ = std::max(clock_, deadline);
  return PortWait::late;
}

PortBytes SimulatedLine::receive(std::span<std::uint8_t> into) noexcept {
  if (!frames_.empty() && frames_.front().arrives_at <= clock_) {
    const Frame frame = std::move(frames_.front());
    frames_.erase(frames_.begin());
    if (!serial_ && frame.cut) frames_.clear();  // late frames do not fill the gap
    const std::size_t size = std::min(into.size(), frame.bytes.size());
    std::copy_n(frame.bytes.begin(), size, into.begin());
    return {PortBytes::Kind::bytes, size};
  }
  return {broken_ ? PortBytes::Kind::lost : PortBytes::Kind::nothing};
}

bool SimulatedLine::pause_until(nanoseconds time) noexcept {
  clock_ = std::max(clock_, time);
  return true;
}

}  // namespace thermocomp::faults
