#include "simulator/files/can_places.hpp"

#include <algorithm>

#include "config/sections/can_signals.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

void read_form(const TomlTable& table, CanUse use, CanSignal& signal) {
  if (use == CanUse::bits) {
    signal.is_signed = false;
    return;
  }
  signal.is_signed = table.flag("signed", signal.is_signed);
  signal.is_float = table.flag("float", signal.is_float);
  signal.scale = table.number("scale", Range::between(-1e6, 1e6), signal.scale);
  const char* offset = use == CanUse::temperature ? "offset_degC" : "offset";
  signal.offset = table.number(offset, Range::between(-1e6, 1e6), signal.offset);
}

/// No frame can carry both: a common multiplexor has different values for them.
bool apart(const CanSignal& a, const CanSignal& b) {
  return std::any_of(a.selectors.begin(), a.selectors.end(), [&](const CanSelector& one) {
    return std::any_of(b.selectors.begin(), b.selectors.end(), [&](const CanSelector& other) {
      return one.field == other.field && one.pages != other.pages;
    });
  });
}

}  // namespace

CanSignal read_can(const TomlTable& table, CanUse use) {
  CanSignal signal;
  signal.id = table.integer<std::uint32_t>("id", 0, 0x1FFFFFFF);
  signal.extended_id = table.flag("extended_id", signal.extended_id);
  signal.fd = table.flag("fd", signal.fd);
  signal.start_bit = table.integer("start_bit", 0, signal.fd ? 511 : 63);
  signal.length_bits = table.integer("length_bits", 1, 64, signal.length_bits);
  signal.byte_order = table.choice<ByteOrder>(
      "byte_order",
      {{"little_endian", ByteOrder::little_endian}, {"big_endian", ByteOrder::big_endian}},
      signal.byte_order);
  read_form(table, use, signal);
  if (use == CanUse::temperature) {
    signal.selectors = sections::read_selectors(table, table, signal.fd);
    signal.status = sections::read_can_status(table, table, signal.fd);
  }
  try {
    check(signal);
  } catch (const InvalidValue& error) {
    table.problem(error.key(), error.value(), error.rule());
    return CanSignal{};
  }
  return signal;
}

std::optional<CanField> read_counter(const TomlTable& table, const CanSignal& signal) {
  return sections::read_can_field(table, table, "counter", signal.fd);
}

bool FramesTaken::take(Frame& frame, const CanField& field) {
  if (std::find(frame.fields.begin(), frame.fields.end(), field) != frame.fields.end()) return true;
  const CanBits bits = bits_of(field);
  const auto shares = [&](const auto& other) { return (bits_of(other) & bits).any(); };
  const bool free = std::none_of(frame.fields.begin(), frame.fields.end(), shares) &&
                    std::none_of(frame.values.begin(), frame.values.end(), shares);
  frame.fields.push_back(field);
  return free;
}

bool FramesTaken::take(const CanSignal& signal) {
  Frame& frame = frames_[{signal.id, signal.extended_id}];
  bool free = true;
  for (const CanSelector& selector : signal.selectors) free = take(frame, selector.field) && free;
  const CanBits bits = bits_of(signal);
  free = free && std::none_of(frame.fields.begin(), frame.fields.end(),
                              [&](const CanField& field) { return (bits_of(field) & bits).any(); });
  free = free && std::none_of(frame.values.begin(), frame.values.end(), [&](const auto& other) {
           return (bits_of(other) & bits).any() && !apart(signal, other);
         });
  frame.values.push_back(signal);
  return free;
}

bool FramesTaken::take(const CanSignal& signal, const CanField& counter) {
  return take(frames_[{signal.id, signal.extended_id}], counter);
}

}  // namespace thermocomp
