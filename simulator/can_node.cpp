#include "simulator/can_node.hpp"

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
  CanFrame& frame = frames_[id_of(signal)];
  frame.id = id_of(signal);
  frame.size = std::max(frame.size, bytes_needed(signal));
}

void CanFrames::set_value(const CanSignal& signal, double value) {
  const std::span data(frames_.at(id_of(signal)).data);
  if (std::isnan(value) && signal.is_float) {
    insert_raw(data, signal, signal.length_bits == 32 ? 0x7FC00000u : 0x7FF8000000000000u);
    return;
  }
  constexpr double beyond_any_integer = 1e30;
  const double shown =
      std::isfinite(value) ? value : std::copysign(beyond_any_integer, signal.scale);
  encode(shown, data, signal);
}

void CanFrames::set_code(const CanSignal& signal, std::int64_t code) {
  CanSignal plain = signal;
  plain.scale = 1.0;
  plain.offset = 0.0;
  encode(static_cast<double>(code), frames_.at(id_of(signal)).data, plain);
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
  for (const auto& [id, frame] : frames.frames()) {
    if (!socket_.is_open()) return;
    socket_.send(frame);
  }
}

std::map<CanId, CanFrame> CanNode::receive() {
  std::map<CanId, CanFrame> newest;
  while (socket_.is_open()) {
    const auto batch = socket_.receive();
    for (const CanFrame& frame : batch) newest[frame.id] = frame;
    if (batch.size() < CanSocket::batch_max) break;
  }
  return newest;
}

}  // namespace thermocomp
