#include "cli/scan/scan_hints.hpp"

#include <array>
#include <cmath>
#include <cstdio>

#include "cli/common/modbus_names.hpp"
#include "drivers/modbus/register_codec.hpp"
#include "status/codes.hpp"

namespace thermocomp::cli {
namespace {

std::string temperature_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.2f degC", value);
  return text;
}

Decoded decode_as(const ModbusChannel& channel, WordOrder order, double scale,
                  std::span<const std::uint16_t> words) {
  return decode(words,
                format_in(channel.table, {channel.encoding, order, scale, channel.offset_degC}),
                channel.sentinels);
}

bool fits(const ModbusChannel& channel, const Decoded& decoded, const PlausibleRange& range) {
  return decoded.fault == Fault::none && is_plausible(channel, decoded.value, range);
}

void hint_orders(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                 const PlausibleRange& range, std::vector<std::string>& hints) {
  const bool one_register = registers_of(channel.encoding) == 1;
  for (const WordOrder order :
       {WordOrder::abcd, WordOrder::cdab, WordOrder::badc, WordOrder::dcba}) {
    if (order == channel.word_order) continue;
    // In one register only the two bytes can change places: half the orders are the other half.
    if (one_register && (order == WordOrder::cdab || order == WordOrder::dcba)) continue;
    const Decoded decoded = decode_as(channel, order, channel.scale, words);
    if (!fits(channel, decoded, range)) continue;
    hints.push_back("word_order = \"" + order_name(order) + "\" would make it " +
                    temperature_text(decoded.value));
  }
}

/// Some modules put two probes into one register, a byte each.
void hint_halves(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                 const PlausibleRange& range, std::vector<std::string>& hints) {
  constexpr double apart_K_max = 20.0;  // two probes of one module; most other numbers are not so
  if (channel.encoding != Encoding::int16 && channel.encoding != Encoding::uint16) return;
  NumberFormat half = format_of(channel);
  half.mask = 0xFF00;
  const Decoded high = decode(words, half, {});
  half.mask = 0x00FF;
  const Decoded low = decode(words, half, {});
  if (!fits(channel, high, range) || !fits(channel, low, range)) return;
  if (std::abs(high.value - low.value) > apart_K_max || low.value == channel.offset_degC) return;
  hints.push_back("two probes in one register? mask = 0xFF00 would make it " +
                  temperature_text(high.value) + ", mask = 0x00FF " + temperature_text(low.value));
}

void hint_scales(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                 const PlausibleRange& range, std::vector<std::string>& hints) {
  for (const double factor : {0.1, 0.01}) {
    const double scale = channel.scale * factor;
    const Decoded decoded = decode_as(channel, channel.word_order, scale, words);
    if (!fits(channel, decoded, range) || decoded.value == channel.offset_degC) continue;
    char text[80];
    std::snprintf(text, sizeof text, "scale = %g would make it ", scale);
    hints.push_back(text + temperature_text(decoded.value));
    return;
  }
}

double raw_value(const ModbusChannel& channel, std::span<const std::uint16_t> words) {
  return decode(words, format_in(channel.table, {channel.encoding, channel.word_order}), {}).value;
}

void hint_codes(const ModbusChannel& channel, std::span<const std::uint16_t> words,
                std::vector<std::string>& hints) {
  if (const auto code = likely_open_code(channel, words)) {
    const std::string number = std::to_string(*code);
    hints.push_back(number +
                    " is what many modules send for a broken wire; if the manual says so: "
                    "open_circuit_codes = [" +
                    number + "]");
  }
  if (std::isnan(raw_value(channel, words))) hints.emplace_back(nan_text().remedy);
}

}  // namespace

std::optional<std::int64_t> likely_open_code(const ModbusChannel& channel,
                                             std::span<const std::uint16_t> words) {
  constexpr std::array ends{32767.0, 32766.0, 32000.0, -32768.0,     -32767.0,      -32000.0,
                            65535.0, 9999.0,  -9999.0, 2147483647.0, -2147483648.0, 4294967295.0};
  const double raw = raw_value(channel, words);
  for (const double end : ends)
    if (raw == end) return static_cast<std::int64_t>(raw);
  return std::nullopt;
}

bool is_plausible(const ModbusChannel& channel, double temp_degC, const PlausibleRange& range) {
  return temp_degC >= range.min_degC && temp_degC <= range.max_degC &&
         may_be_measured(channel, temp_degC);
}

std::vector<std::string> hints_for_words(const ModbusChannel& channel,
                                         std::span<const std::uint16_t> words,
                                         const PlausibleRange& range) {
  std::vector<std::string> hints;
  hint_codes(channel, words, hints);
  if (!hints.empty()) return hints;
  hint_orders(channel, words, range, hints);
  if (!hints.empty()) return hints;
  hint_halves(channel, words, range, hints);
  hint_scales(channel, words, range, hints);
  return hints;
}

std::vector<std::string> hints_for_address(const ModbusChannel& channel) {
  std::vector<std::string> hints;
  for (const auto& [first, table] :
       {std::pair{30001, ModbusTable::input}, {40001, ModbusTable::holding}}) {
    if (channel.address < first || channel.address >= first + 9999) continue;
    hints.push_back("addresses count from 0 on the wire: " + std::to_string(channel.address) +
                    " in a manual is table = \"" + table_name(table) +
                    "\", address = " + std::to_string(channel.address - first));
  }
  return hints;
}

}  // namespace thermocomp::cli
