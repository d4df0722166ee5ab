#include "drivers/controllers/kinds/modbus/travel_registers.hpp"

#include "drivers/controllers/travel_values.hpp"
#include "drivers/modbus/register_codec.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

void append(WriteField& field, const ModbusValue& place, double value, Encoding encoding) {
  const Encoded encoded = encode(value, {encoding, place.word_order, place.scale, 0.0});
  field.words.insert(field.words.end(), encoded.words().begin(), encoded.words().end());
}

/// Of a set's number: all bits are used.
Encoding count_encoding(const ModbusValue& place) noexcept {
  return place.encoding == Encoding::uint32 ? Encoding::uint32 : Encoding::uint16;
}

}  // namespace

void check_travel(const ModbusTravel& travel) {
  check_shape(travel);
  check_count(travel, travel.values.size(), "values");
  if (!travel.applied.empty()) check_count(travel, travel.applied.size(), "applied");
  std::size_t next = travel.begin.address + registers_of(travel.begin.encoding);
  const auto follows = [&next](const ModbusValue& value) {
    require(value.table == ModbusTable::holding && value.address == next, "address", value.address,
            "the registers of a set must follow one another: begin, values, end");
    next += registers_of(value.encoding);
  };
  for (const ModbusValue& value : travel.values) follows(value);
  follows(travel.end);
  for (const ModbusValue* number : {&travel.begin, &travel.end})
    require((number->encoding == Encoding::uint16 || number->encoding == Encoding::uint32) &&
                number->encoding == travel.begin.encoding && number->scale == 1.0,
            "encoding", number->address,
            "begin and end must be both uint16 or both uint32, without scale");
}

std::uint64_t travel_numbers(const ModbusTravel& travel) noexcept {
  return std::uint64_t{1} << (count_encoding(travel.begin) == Encoding::uint32 ? 32 : 16);
}

WriteField travel_field(const ModbusTravel& travel, std::uint64_t number,
                        std::span<const double> offset_um) {
  WriteField field{travel.begin.address, WriteStage::offset, {}};
  const auto add_number = [&](const ModbusValue& place) {
    append(field, place, static_cast<double>(number), count_encoding(place));
  };
  add_number(travel.begin);
  const std::vector<double> values = travel_values(travel, travel.values.size(), offset_um);
  for (std::size_t i = 0; i < values.size(); ++i)
    append(field, travel.values[i], values[i], travel.values[i].encoding);
  add_number(travel.end);
  return field;
}

double shown_resolution_um(const ModbusTravel& travel, std::size_t node) {
  std::vector<double> counts;
  counts.reserve(travel.applied.size());
  for (const ModbusValue& value : travel.applied) counts.push_back(value.scale);
  return node_resolution_um(travel, counts, node);
}

}  // namespace thermocomp
