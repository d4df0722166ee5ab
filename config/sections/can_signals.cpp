#include "config/sections/can_signals.hpp"

#include <algorithm>
#include <cfloat>
#include <cmath>

#include "config/sections/common.hpp"

namespace thermocomp::sections {
namespace {

constexpr int classic_bits_max = 64;
constexpr int fd_bits_max = 512;
constexpr std::int64_t standard_id_max = 0x7FF;
constexpr std::int64_t extended_id_max = 0x1FFFFFFF;

const Names<ByteOrder>& byte_orders() {
  static const Names<ByteOrder> names{{"little_endian", ByteOrder::little_endian},
                                      {"big_endian", ByteOrder::big_endian}};
  return names;
}

/// Range of valid raw values of a sentinel. A float is compared as a number.
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

bool has_key(const TomlTable& own, const TomlTable& base, std::string_view key) {
  const bool in_base = base.has(key);  // marks the key as known
  return own.has(key) || in_base;
}

/// An integer in `own` or else `base`. Both are checked.
int whole(const TomlTable& own, const TomlTable& base, std::string_view key, int low, int high,
          int otherwise, bool is_required) {
  if (is_required && !has_key(own, base, key)) own.problem(key, "must be given");
  return own.integer(key, low, high, base.integer(key, low, high, otherwise));
}

/// The first bit of the same bytes in the other byte order; none for partial bytes.
std::optional<int> turned(const CanSignal& signal) {
  const bool was_little = signal.byte_order == ByteOrder::little_endian;
  if (signal.length_bits % 8 != 0 || signal.start_bit % 8 != (was_little ? 0 : 7)) return {};
  return signal.start_bit + (was_little ? 7 : -7);
}

std::string too_long(const CanSignal& signal) {
  return "a signal of " + std::to_string(signal.length_bits) +
         " bits from here does not fit into " + (signal.fd ? "64" : "8") +
         " bytes in its byte order";
}

void read_identifier(const TomlTable& own, const TomlTable& base, bool is_required,
                     CanSignal& signal) {
  signal.extended_id = own.flag("extended_id", base.flag("extended_id", signal.extended_id));
  const bool is_given = has_key(own, base, "id");
  if (is_required && !is_given) own.problem("id", "must be given");
  if (!is_given) {
    if (signal.id > standard_id_max && !signal.extended_id)
      own.problem("extended_id", "is false, but the file's number has more than 11 bits");
    return;
  }
  const TomlTable& source = own.has("id") ? own : base;
  const std::int64_t id_max = signal.extended_id ? extended_id_max : standard_id_max;
  signal.id = static_cast<std::uint32_t>(source.integer<std::int64_t>("id", 0, id_max, 0));
  signal.id_mask = CanSignal{}.id_mask;  // this sender only, not the whole group
}

void read_place(const TomlTable& own, const TomlTable& base, bool is_required, CanSignal& signal) {
  read_identifier(own, base, is_required, signal);
  signal.fd = own.flag("fd", base.flag("fd", signal.fd));
  const int bits = signal.fd ? fd_bits_max : classic_bits_max;
  signal.length_bits = whole(own, base, "length_bits", 1, 64, signal.length_bits, is_required);
  const std::optional<int> other_first = turned(signal);
  const ByteOrder before = signal.byte_order;
  signal.byte_order = own.choice("byte_order", byte_orders(),
                                 base.choice("byte_order", byte_orders(), signal.byte_order));
  if (!is_required && signal.byte_order != before && !has_key(own, base, "start_bit")) {
    if (!other_first) own.problem("start_bit", "must be given: the value is not in whole bytes");
    signal.start_bit = other_first.value_or(signal.start_bit);
  }
  signal.start_bit = whole(own, base, "start_bit", 0, bits - 1, signal.start_bit, is_required);
  if (frame_bits(signal).none()) {
    own.problem("start_bit", std::to_string(signal.start_bit), too_long(signal));
    signal.start_bit = signal.byte_order == ByteOrder::little_endian ? 0 : 7;
  }
}

void read_form(const TomlTable& own, const TomlTable& base, CanSignal& signal) {
  signal.is_signed = own.flag("signed", base.flag("signed", signal.is_signed));
  signal.is_float = own.flag("float", base.flag("float", signal.is_float));
  if (signal.is_float && signal.length_bits != 32 && signal.length_bits != 64) {
    own.problem("length_bits", std::to_string(signal.length_bits), "a float has 32 or 64 bits");
  }
}

/// The number described by `table`; none if it does not fit into the frame.
std::optional<CanField> read_field(const TomlTable& table, bool fd) {
  CanSignal number;
  number.fd = fd;
  number.start_bit = table.integer("start_bit", 0, (fd ? fd_bits_max : classic_bits_max) - 1);
  number.length_bits = table.integer("length_bits", 1, 64);
  number.byte_order = table.choice("byte_order", byte_orders(), number.byte_order);
  if (table && frame_bits(number).none()) {
    table.problem("start_bit", std::to_string(number.start_bit), too_long(number));
    return std::nullopt;
  }
  return CanField{number.start_bit, number.length_bits, number.byte_order};
}

std::int64_t greatest_of(const CanField& field) {
  return field.length_bits >= 63 ? INT64_MAX : (std::int64_t{1} << field.length_bits) - 1;
}

}  // namespace

std::optional<CanField> read_can_field(const TomlTable& own, const TomlTable& base,
                                       std::string_view key, bool fd) {
  const TomlTable& source = own.has(key) ? own : base;
  if (!source.has(key)) return std::nullopt;
  return read_field(source.table(key), fd);
}

CanStatus read_status_numbers(const TomlTable& table, const CanField& field) {
  const std::int64_t greatest = greatest_of(field);
  const std::int64_t mask = table.integer<std::int64_t>("mask", 1, greatest, greatest);
  return {field, static_cast<std::uint64_t>(mask), read_status_codes(table, greatest, mask)};
}

std::optional<CanStatus> read_can_status(const TomlTable& own, const TomlTable& base, bool fd) {
  const TomlTable& source = own.has("status") ? own : base;
  if (!source.has("status")) return std::nullopt;
  const TomlTable table = source.table("status");
  const auto field = read_field(table, fd);
  if (field) return read_status_numbers(table, *field);
  table.ignore_rest();
  return std::nullopt;
}

std::vector<CanSelector> read_selectors(const TomlTable& own, const TomlTable& base, bool fd) {
  const auto field = read_can_field(own, base, "multiplexor", fd);
  if (!field) {
    own.refuse("multiplexor_value", "does not apply without a multiplexor");
    return {};
  }
  const std::int64_t greatest = greatest_of(*field);
  if (!own.has("multiplexor_value")) own.problem("multiplexor_value", "must be given");
  const auto page =
      static_cast<std::uint64_t>(own.integer<std::int64_t>("multiplexor_value", 0, greatest, 0));
  return {{*field, {{page, page}}}};
}

std::vector<Sentinel> read_can_codes(const TomlTable& own, const TomlTable& base,
                                     const CanSignal& signal) {
  const auto [low, high] = codes_of(signal);
  return read_codes(own, base, low, high);
}

std::string read_interface(const TomlTable& table) {
  constexpr std::size_t name_max = 15;  // IFNAMSIZ less the end
  std::string name = table.text("interface");
  if (name.size() > name_max || name.find_first_of("/ \t\n:") != std::string::npos || name == "." ||
      name == "..") {
    table.problem("interface", "must be an interface's name such as \"can0\"");
  }
  return name;
}

CanSignal read_can_signal(const TomlTable& own, const TomlTable& base, CanUse use,
                          const CanSignal* file) {
  CanSignal signal = file != nullptr ? *file : CanSignal{};
  read_place(own, base, file == nullptr, signal);
  if (use == CanUse::bits) {
    refuse_all(own, {"scale", "signed", "float"}, "does not apply to a count or bits");
    signal.is_signed = false;
    return signal;
  }
  read_form(own, base, signal);
  signal.scale = read_scale(own, read_scale(base, signal.scale));
  if (use == CanUse::signal) signal.offset = own.number("offset", Range::any(), 0.0);
  if (use == CanUse::temperature) {
    const Range range = Range::between(-1e5, 1e5);  // for unsigned numbers with many bits
    signal.offset =
        own.number("offset_degC", range, base.number("offset_degC", range, signal.offset));
    signal.sentinels = read_can_codes(own, base, signal);
    if (file == nullptr) signal.selectors = read_selectors(own, base, signal.fd);
    signal.status = read_can_status(own, base, signal.fd);
  }
  return signal;
}

FrameBits frame_bits(const CanSignal& signal) {
  FrameBits bits;
  int bit = signal.start_bit;
  for (int i = 0; i < signal.length_bits; ++i) {
    if (bit < 0 || bit >= (signal.fd ? fd_bits_max : classic_bits_max)) return {};
    bits.set(static_cast<std::size_t>(bit));
    if (signal.byte_order == ByteOrder::little_endian) {
      ++bit;
    } else {
      bit = bit % 8 == 0 ? bit + 15 : bit - 1;  // after bit 0 continues with bit 7 of the next byte
    }
  }
  return bits;
}

void TakenBits::add(const TomlTable& table, std::string_view key, const CanSignal& signal) {
  FrameBits& used = used_[{signal.id, signal.extended_id}];
  const FrameBits bits = frame_bits(signal);
  if ((used & bits).any()) table.problem(key, "shares bits with another value of its frame");
  used |= bits;
}

bool TakenBits::has_frame_of(const CanSignal& signal) const {
  return std::any_of(used_.begin(), used_.end(), [&](const auto& frame) {
    const auto& [id, is_extended] = frame.first;
    return is_extended == signal.extended_id && ((id ^ signal.id) & signal.id_mask) == 0;
  });
}

double count_of(const CanSignal& signal) {
  if (!signal.is_float) return std::abs(signal.scale);
  return (signal.length_bits == 32 ? FLT_TRUE_MIN : DBL_TRUE_MIN) * std::abs(signal.scale);
}

Range reach(const CanSignal& signal) {
  if (signal.is_float) {
    const double most = signal.length_bits == 32 ? FLT_MAX : DBL_MAX;
    return Range::between(-most * std::abs(signal.scale), most * std::abs(signal.scale));
  }
  const double counts = std::ldexp(1.0, signal.length_bits);
  const double low = signal.is_signed ? -counts / 2 : 0.0;
  const double high = signal.is_signed ? counts / 2 - 1 : counts - 1;
  const double a = low * signal.scale + signal.offset;
  const double b = high * signal.scale + signal.offset;
  return Range::between(std::min(a, b), std::max(a, b));
}

}  // namespace thermocomp::sections
