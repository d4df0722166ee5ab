#include "simulator/devices/modbus_unit.hpp"

#include <cmath>

#include "drivers/modbus/modbus_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr std::uint8_t illegal_function = 1;
constexpr std::uint8_t illegal_address = 2;
constexpr std::uint8_t illegal_value = 3;
constexpr std::size_t bits_read_max = 2000;
constexpr std::size_t words_read_max = 125;
constexpr std::size_t bits_written_max = 1968;
constexpr std::size_t words_written_max = 123;

void append(std::vector<std::uint8_t>& bytes, std::uint16_t word) {
  bytes.push_back(static_cast<std::uint8_t>(word >> 8));
  bytes.push_back(static_cast<std::uint8_t>(word & 0xFF));
}

ModbusUnit::Answer refuse(std::span<const std::uint8_t> request, std::uint8_t code) {
  return {modbus_exception(request[0], code), false};
}

/// The answer to a write request is its first five bytes.
ModbusUnit::Answer confirm(std::span<const std::uint8_t> request) {
  return {{request.begin(), request.begin() + 5}, true};
}

/// Quiet NaN of a float encoding in register order; only its highest word is nonzero.
std::vector<std::uint16_t> nan_words(Encoding encoding, WordOrder order) {
  std::vector<std::uint16_t> words(registers_of(encoding), 0);
  const bool low_byte_first = order == WordOrder::badc || order == WordOrder::dcba;
  const bool low_word_first = order == WordOrder::cdab || order == WordOrder::dcba;
  const std::uint16_t high = encoding == Encoding::float32 ? 0x7FC0 : 0x7FF8;
  const auto swapped = static_cast<std::uint16_t>((high << 8) | (high >> 8));
  (low_word_first ? words.back() : words.front()) = low_byte_first ? swapped : high;
  return words;
}

}  // namespace

std::vector<std::uint8_t> modbus_exception(std::uint8_t function, std::uint8_t code) {
  return {static_cast<std::uint8_t>(function | 0x80), code};
}

ModbusUnit::Table& ModbusUnit::table(ModbusTable which) {
  return tables_[static_cast<std::size_t>(which)];
}
const ModbusUnit::Table& ModbusUnit::table(ModbusTable which) const {
  return tables_[static_cast<std::size_t>(which)];
}

void ModbusUnit::define(ModbusTable which, std::uint16_t address, std::size_t words,
                        bool writable) {
  for (std::size_t i = 0; i < words; ++i) {
    table(which)[static_cast<std::uint16_t>(address + i)].writable = writable;
  }
}

void ModbusUnit::define(const ModbusValue& value, bool writable) {
  define(value.table, value.address, words_of(value.table, value.encoding), writable);
}

void ModbusUnit::set(ModbusTable which, std::uint16_t address, std::uint16_t word) {
  const auto found = table(which).find(address);
  THERMOCOMP_ENSURE(found != table(which).end());
  found->second.value = word;
}

void ModbusUnit::set(ModbusTable which, std::uint16_t address,
                     std::span<const std::uint16_t> words) {
  for (const std::uint16_t word : words) set(which, address++, word);
}

std::uint16_t ModbusUnit::word(ModbusTable which, std::uint16_t address) const {
  const auto found = table(which).find(address);
  return found == table(which).end() ? std::uint16_t{0} : found->second.value;
}

void ModbusUnit::set_value(const ModbusValue& place, double offset, double value) {
  const NumberFormat format =
      format_in(place.table, {place.encoding, place.word_order, place.scale, offset});
  const bool is_float =
      format.encoding == Encoding::float32 || format.encoding == Encoding::float64;
  if (std::isnan(value) && is_float) {
    return set(place.table, place.address, nan_words(place.encoding, place.word_order));
  }
  constexpr double beyond_any_integer = 1e12;
  const double shown =
      std::isfinite(value) ? value : std::copysign(beyond_any_integer, place.scale);
  set(place.table, place.address, encode(shown, format).words());
}

void ModbusUnit::set_code(const ModbusValue& place, std::int64_t code) {
  const NumberFormat format = format_in(place.table, {place.encoding, place.word_order, 1.0, 0.0});
  set(place.table, place.address, encode(static_cast<double>(code), format).words());
}

double ModbusUnit::value(const ModbusValue& place) const {
  const NumberFormat format =
      format_in(place.table, {place.encoding, place.word_order, place.scale, 0.0});
  std::array<std::uint16_t, registers_of_value_max> words{};
  const std::size_t count = registers_of(format.encoding);
  for (std::size_t i = 0; i < count; ++i) {
    words[i] = word(place.table, static_cast<std::uint16_t>(place.address + i));
  }
  return decode(std::span(words).first(count), format, {}).value;
}

bool ModbusUnit::readable(ModbusTable which, std::size_t address, std::size_t count) const {
  const Table& words = table(which);
  return !words.empty() && address >= words.begin()->first &&
         address + count <= std::size_t{words.rbegin()->first} + 1;
}

bool ModbusUnit::writable(ModbusTable which, std::size_t address, std::size_t count) const {
  for (std::size_t i = address; i < address + count; ++i) {
    if (i > 65535) return false;
    const auto found = table(which).find(static_cast<std::uint16_t>(i));
    if (found == table(which).end() || !found->second.writable) return false;
  }
  return true;
}

ModbusUnit::Answer ModbusUnit::answer(std::span<const std::uint8_t> request) {
  THERMOCOMP_ENSURE(!request.empty());
  switch (request[0]) {
    case 1:
      return read_bits(ModbusTable::coil, request);
    case 2:
      return read_bits(ModbusTable::discrete_input, request);
    case 3:
      return read_words(ModbusTable::holding, request);
    case 4:
      return read_words(ModbusTable::input, request);
    case 5:
    case 6:
      return write_one(request);
    case 15:
      return write_bits(request);
    case 16:
      return write_words(request);
    default:
      return refuse(request, illegal_function);
  }
}

ModbusUnit::Answer ModbusUnit::read_bits(ModbusTable which,
                                         std::span<const std::uint8_t> request) const {
  if (request.size() != 5) return refuse(request, illegal_value);
  const std::uint16_t address = word_at(request, 1);
  const std::size_t count = word_at(request, 3);
  if (count < 1 || count > bits_read_max) return refuse(request, illegal_value);
  if (!readable(which, address, count)) return refuse(request, illegal_address);
  std::vector<std::uint8_t> pdu(2 + (count + 7) / 8, 0);
  pdu[0] = request[0];
  pdu[1] = static_cast<std::uint8_t>(pdu.size() - 2);
  for (std::size_t i = 0; i < count; ++i) {
    if (word(which, static_cast<std::uint16_t>(address + i)) == 0) continue;
    pdu[2 + i / 8] = static_cast<std::uint8_t>(pdu[2 + i / 8] | (1u << (i % 8)));
  }
  return {pdu, false};
}

ModbusUnit::Answer ModbusUnit::read_words(ModbusTable which,
                                          std::span<const std::uint8_t> request) const {
  if (request.size() != 5) return refuse(request, illegal_value);
  const std::uint16_t address = word_at(request, 1);
  const std::size_t count = word_at(request, 3);
  if (count < 1 || count > words_read_max) return refuse(request, illegal_value);
  if (!readable(which, address, count)) return refuse(request, illegal_address);
  std::vector<std::uint8_t> pdu{request[0], static_cast<std::uint8_t>(2 * count)};
  for (std::size_t i = 0; i < count; ++i) {
    append(pdu, word(which, static_cast<std::uint16_t>(address + i)));
  }
  return {pdu, false};
}

ModbusUnit::Answer ModbusUnit::write_one(std::span<const std::uint8_t> request) {
  if (request.size() != 5) return refuse(request, illegal_value);
  const bool bit = request[0] == 5;
  const ModbusTable which = bit ? ModbusTable::coil : ModbusTable::holding;
  const std::uint16_t address = word_at(request, 1);
  const std::uint16_t word = word_at(request, 3);
  if (bit && word != 0 && word != 0xFF00) return refuse(request, illegal_value);
  if (!writable(which, address, 1)) return refuse(request, illegal_address);
  set(which, address, bit ? static_cast<std::uint16_t>(word != 0) : word);
  return confirm(request);
}

ModbusUnit::Answer ModbusUnit::write_bits(std::span<const std::uint8_t> request) {
  if (request.size() < 6) return refuse(request, illegal_value);
  const std::uint16_t address = word_at(request, 1);
  const std::size_t count = word_at(request, 3);
  const std::size_t bytes = request[5];
  if (count < 1 || count > bits_written_max || bytes != (count + 7) / 8 ||
      request.size() != 6 + bytes) {
    return refuse(request, illegal_value);
  }
  if (!writable(ModbusTable::coil, address, count)) return refuse(request, illegal_address);
  for (std::size_t i = 0; i < count; ++i) {
    const bool on = ((request[6 + i / 8] >> (i % 8)) & 1) != 0;
    set(ModbusTable::coil, static_cast<std::uint16_t>(address + i), on ? 1 : 0);
  }
  return confirm(request);
}

ModbusUnit::Answer ModbusUnit::write_words(std::span<const std::uint8_t> request) {
  if (request.size() < 6) return refuse(request, illegal_value);
  const std::uint16_t address = word_at(request, 1);
  const std::size_t count = word_at(request, 3);
  const std::size_t bytes = request[5];
  if (count < 1 || count > words_written_max || bytes != 2 * count || request.size() != 6 + bytes) {
    return refuse(request, illegal_value);
  }
  if (!writable(ModbusTable::holding, address, count)) return refuse(request, illegal_address);
  for (std::size_t i = 0; i < count; ++i) {
    set(ModbusTable::holding, static_cast<std::uint16_t>(address + i), word_at(request, 6 + 2 * i));
  }
  return confirm(request);
}

}  // namespace thermocomp
