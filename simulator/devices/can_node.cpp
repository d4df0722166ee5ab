#include "simulator/devices/can_node.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace thermocomp {
namespace {

constexpr nanoseconds retry = std::chrono::milliseconds(200);

CanId id_of(const CanSignal& signal) {
  return {signal.id, signal.extended_id};
}

}  // namespace

void CanFrames::define(const CanSignal& signal) {
  Message& message = messages_[id_of(signal)];
  const bool plain = signal.selectors.empty();
  const bool has_page =
      (plain || message.selected) &&
      std::any_of(message.pages.begin(), message.pages.end(),
                  [&](const CanFrame& page) { return carries(page.data, signal); });
  // The first multiplexed value reuses the page created for plain values.
  if (message.pages.empty() || (!has_page && message.selected)) {
    CanFrame& page = message.pages.emplace_back();
    page.id = id_of(signal);
    page.size = message.pages.front().size;
    page.fd = message.pages.front().fd;
  }
  if (!has_page && !plain) {
    for (const CanSelector& selector : signal.selectors) {
      insert_raw(message.pages.back().data, selector.field, selector.pages.front().first);
    }
    message.selected = true;
  }
  for (CanFrame& page : message.pages) {
    page.size = std::max(page.size, bytes_needed(signal));
    page.fd = page.fd || signal.fd;
  }
}

void CanFrames::define_counter(const CanSignal& signal, const CanField& counter) {
  Message& message = messages_.at(id_of(signal));
  for (CanFrame& page : message.pages) page.size = std::max(page.size, bytes_needed(counter));
  message.counters.push_back(counter);
}

template <class Write>
void CanFrames::write(const CanSignal& signal, Write write_to) {
  for (CanFrame& page : messages_.at(id_of(signal)).pages) {
    if (carries(page.data, signal)) write_to(std::span<std::uint8_t>(page.data));
  }
}

void CanFrames::set_value(const CanSignal& signal, double value) {
  if (std::isnan(value) && signal.is_float) {
    const std::uint64_t nan = signal.length_bits == 32 ? 0x7FC00000u : 0x7FF8000000000000u;
    return write(signal, [&](std::span<std::uint8_t> data) { insert_raw(data, signal, nan); });
  }
  constexpr double beyond_any_integer = 1e30;
  const double shown =
      std::isfinite(value) ? value : std::copysign(beyond_any_integer, signal.scale);
  write(signal, [&](std::span<std::uint8_t> data) { encode(shown, data, signal); });
}

void CanFrames::set_code(const CanSignal& signal, std::int64_t code) {
  CanSignal plain = signal;
  plain.scale = 1.0;
  plain.offset = 0.0;
  write(signal,
        [&](std::span<std::uint8_t> data) { encode(static_cast<double>(code), data, plain); });
}

void CanFrames::set_status(const CanSignal& signal, std::int64_t number) {
  if (!signal.status) return;
  const CanField& field = signal.status->field;
  const std::uint64_t mask = signal.status->mask;
  write(signal, [&](std::span<std::uint8_t> data) {
    const std::uint64_t others = extract_raw(data, field) & ~mask;
    insert_raw(data, field, others | (static_cast<std::uint64_t>(number) & mask));
  });
}

void CanFrames::count() {
  ++counted_;
  for (auto& [id, message] : messages_) {
    for (CanFrame& page : message.pages) {
      for (const CanField& counter : message.counters) insert_raw(page.data, counter, counted_);
    }
  }
}

std::vector<CanFrame> CanFrames::frames() const {
  std::vector<CanFrame> all;
  for (const auto& [id, message] : messages_) {
    all.insert(all.end(), message.pages.begin(), message.pages.end());
  }
  return all;
}

CanNode::CanNode(std::string interface, std::vector<CanId> wanted)
    : socket_(std::move(interface), std::move(wanted)) {
  socket_.open();
}

void CanNode::keep_open(nanoseconds now) {
  if (socket_.is_open() || now < tried_at_ + retry) return;
  tried_at_ = now;
  socket_.open();
}

void CanNode::send(const CanFrames& frames) {
  for (const CanFrame& frame : frames.frames()) {
    if (!socket_.is_open()) return;
    socket_.send(frame);
  }
}

std::vector<CanFrame> CanNode::receive() {
  std::vector<CanFrame> frames;
  while (socket_.is_open()) {
    const auto batch = socket_.receive();
    frames.insert(frames.end(), batch.begin(), batch.end());
    if (batch.size() < CanSocket::batch_max) break;
  }
  return frames;
}

}  // namespace thermocomp
