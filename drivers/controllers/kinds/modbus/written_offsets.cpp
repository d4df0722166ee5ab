#include "drivers/controllers/kinds/modbus/written_offsets.hpp"

#include <algorithm>

#include "drivers/controllers/travel_values.hpp"
#include "drivers/modbus/register_codec.hpp"

namespace thermocomp {
namespace {

double value_of(const ModbusValue& place, std::span<const std::uint16_t> words) {
  return thermocomp::decode(words, {place.encoding, place.word_order, place.scale, 0.0}, {}).value;
}

ReadRequest request_of(const ModbusAxis& axis) {
  if (!axis.travel)
    return {axis.offset.table, axis.offset.address, registers_of(axis.offset.encoding)};
  const ModbusValue& end = axis.travel->end;
  const std::uint16_t begin = axis.travel->begin.address;
  return {ModbusTable::holding, begin, end.address + registers_of(end.encoding) - begin};
}

}  // namespace

WrittenOffsets::WrittenOffsets(const ModbusAxis& axis) : axis_(axis), request_(request_of(axis)) {}

std::vector<double> WrittenOffsets::decode(std::span<const std::uint16_t> words) const {
  std::vector<double> offsets(axis_.offsets(), not_a_number);
  if (words.size() != request_.count) return offsets;
  if (!axis_.travel) return {value_of(axis_.offset, words)};
  const ModbusTravel& travel = *axis_.travel;
  const auto at = [&](const ModbusValue& place) {
    return words.subspan(place.address - request_.address);
  };
  const auto number = [&](const ModbusValue& place) {
    return bits_of(at(place).first(registers_of(place.encoding)), place.encoding, place.word_order);
  };
  // A set that was broken off is not in effect.
  if (number(travel.begin) != number(travel.end)) return offsets;
  std::vector<double> values;
  for (const ModbusValue& value : travel.values) values.push_back(value_of(value, at(value)));
  offsets_shown(travel, values, offsets);
  return offsets;
}

bool WrittenOffsets::is_to_be_compared() const noexcept {
  // Zeros are what registers show that hold nothing.
  return held_ == Held::not_known &&
         std::any_of(words_.begin(), words_.end(), [](std::uint16_t word) { return word != 0; });
}

void WrittenOffsets::compare(std::span<const std::uint16_t> words) noexcept {
  held_ =
      std::equal(words.begin(), words.end(), words_.begin(), words_.end()) ? Held::yes : Held::no;
}

}  // namespace thermocomp
