#include "config/sections/can_signals.hpp"

#include <algorithm>
#include <cmath>

#include "config/sections/common.hpp"

namespace thermocomp::sections {
namespace {

constexpr int frame_bits_max = 64;
constexpr std::int64_t standard_id_max = 0x7FF;
constexpr std::int64_t extended_id_max = 0x1FFFFFFF;

const Names<ByteOrder>& byte_orders() {
  static const Names<ByteOrder> names{{"little_endian", ByteOrder::little_endian},
                                      {"big_endian", ByteOrder::big_endian}};
  return names;
}

/// Raw values that a sentinel may have. A float is compared as a number.
std::pair<std::int64_t, std::int64_t> codes_of(const CanSignal& signal) {
  if (signal.is_float) return {-(1LL << 53), 1LL << 53};
  if (signal.length_bits >= 64) return {signal.is_signed ? INT64_MIN : 0, INT64_MAX};
  if (!signal.is_signed) {
    return {0, static_cast<std::int64_t>((1ULL << static_cast<unsigned>(signal.length_bits)) - 1)};
  }
  const auto half =
      static_cast<std::int64_t>(1ULL << static_cast<unsigned>(signal.length_bits - 1));
  return {-half, half - 1};
}

/// A whole number that may stand in `own` or in `base`. Both are checked.
int required_integer(const TomlTable& own, const TomlTable& base, std::string_view key, int low,
                     int high, int otherwise) {
  const bool in_base = base.has(key);
  if (!own.has(key) && !in_base) own.problem(key, "must be given");
  return own.integer(key, low, high, base.integer(key, low, high, otherwise));
}

void read_place(const TomlTable& own, const TomlTable& base, CanSignal& signal) {
  signal.extended_id = own.flag("extended_id", base.flag("extended_id", false));
  const bool in_base = base.has("id");
  if (!own.has("id") && !in_base) own.problem("id", "must be given");
  const TomlTable& source = !own.has("id") && in_base ? base : own;
  const std::int64_t id_max = signal.extended_id ? extended_id_max : standard_id_max;
  signal.id = static_cast<std::uint32_t>(source.integer<std::int64_t>("id", 0, id_max, 0));
  signal.start_bit =
      required_integer(own, base, "start_bit", 0, frame_bits_max - 1, signal.start_bit);
  signal.length_bits =
      required_integer(own, base, "length_bits", 1, frame_bits_max, signal.length_bits);
  signal.byte_order = own.choice("byte_order", byte_orders(),
                                 base.choice("byte_order", byte_orders(), signal.byte_order));
  if (frame_bits(signal) == 0) {
    own.problem("start_bit", std::to_string(signal.start_bit),
                "a signal of " + std::to_string(signal.length_bits) +
                    " bits from here does not fit into 8 bytes in its byte order");
    signal.start_bit = signal.byte_order == ByteOrder::little_endian ? 0 : 7;
  }
}

void read_form(const TomlTable& own, const TomlTable& base, CanSignal& signal) {
  signal.is_signed = own.flag("signed", base.flag("signed", true));
  signal.is_float = own.flag("float", base.flag("float", false));
  if (signal.is_float && signal.length_bits != 32 && signal.length_bits != 64) {
    own.problem("length_bits", std::to_string(signal.length_bits), "a float has 32 or 64 bits");
  }
}

}  // namespace

std::string read_interface(const TomlTable& table) {
  constexpr std::size_t name_max = 15;  // IFNAMSIZ less the end
  std::string name = table.text("interface");
  if (name.size() > name_max || name.find_first_of("/ \t\n:") != std::string::npos || name == "." ||
      name == "..") {
    table.problem("interface", "must be an interface's name such as \"can0\"");
  }
  return name;
}

CanSignal read_can_signal(const TomlTable& own, const TomlTable& base, CanUse use) {
  CanSignal signal;
  read_place(own, base, signal);
  if (use == CanUse::bits) {
    refuse_all(own, {"scale", "signed", "float"}, "makes no sense for a count or bits");
    signal.is_signed = false;
    return signal;
  }
  read_form(own, base, signal);
  signal.scale = read_scale(own, read_scale(base, 1.0));
  if (use == CanUse::signal) signal.offset = own.number("offset", Range::any(), 0.0);
  if (use == CanUse::temperature) {
    const Range range = Range::between(-1e4, 1e4);
    signal.offset =
        own.number("offset_degC", range, base.number("offset_degC", range, signal.offset));
    const auto [low, high] = codes_of(signal);
    signal.sentinels = read_codes(own, base, low, high);
  }
  return signal;
}

std::uint64_t frame_bits(const CanSignal& signal) {
  std::uint64_t mask = 0;
  int bit = signal.start_bit;
  for (int i = 0; i < signal.length_bits; ++i) {
    if (bit < 0 || bit >= frame_bits_max) return 0;
    mask |= 1ULL << static_cast<unsigned>(bit);
    if (signal.byte_order == ByteOrder::little_endian) {
      ++bit;
    } else {
      bit = bit % 8 == 0 ? bit + 15 : bit - 1;  // from bit 0 on to bit 7 of the next byte
    }
  }
  return mask;
}

Range reach(const CanSignal& signal) {
  if (signal.is_float) return {};
  const double counts = std::ldexp(1.0, signal.length_bits);
  const double low = signal.is_signed ? -counts / 2 : 0.0;
  const double high = signal.is_signed ? counts / 2 - 1 : counts - 1;
  const double a = low * signal.scale + signal.offset;
  const double b = high * signal.scale + signal.offset;
  return Range::between(std::min(a, b), std::max(a, b));
}

}  // namespace thermocomp::sections
