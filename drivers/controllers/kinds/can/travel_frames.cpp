#include "drivers/controllers/kinds/can/travel_frames.hpp"

#include <algorithm>
#include <map>

#include "drivers/can/signal_codec.hpp"
#include "drivers/controllers/travel_values.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

void check_numbers(const CanSet& set, int length_bits) {
  std::map<CanId, int> numbers;
  for (const CanSignal& number : set.numbers) {
    check(number);
    require(!number.is_float && number.scale == 1.0 && number.offset == 0.0, "set_numbers",
            number.id, "must be whole numbers without scale");
    require(number.length_bits == length_bits, "length_bits", number.length_bits,
            "the number of a set must have the same length in each frame");
    require(number.length_bits >= CanSet::number_bits_min &&
                number.length_bits <= CanSet::number_bits_max,
            "length_bits", number.length_bits, "the number of a set must have 8 to 32 bits");
    require(++numbers[id_of(number)] == 1, "set_numbers", number.id,
            "a frame must have one number of the set");
  }
  for (const CanSignal& value : set.values) {
    check(value);
    require(numbers.contains(id_of(value)), "set_numbers", value.id,
            "each frame with a value must have the number of the set");
  }
  for (const CanSignal& number : set.numbers) {
    require(std::any_of(set.values.begin(), set.values.end(),
                        [&](const CanSignal& value) { return id_of(value) == id_of(number); }),
            "set_numbers", number.id, "must be in a frame with a value of the set");
  }
}

}  // namespace

void check_travel(const CanTravel& travel) {
  check_shape(travel);
  check_count(travel, travel.sent.values.size(), "values");
  require(!travel.sent.numbers.empty(), "set_numbers", 0.0, "must be one in each frame");
  const int length_bits = travel.sent.numbers.front().length_bits;
  check_numbers(travel.sent, length_bits);
  if (travel.applied.values.empty() && travel.applied.numbers.empty()) return;
  check_count(travel, travel.applied.values.size(), "applied");
  check_numbers(travel.applied, length_bits);
}

std::uint64_t set_numbers(const CanSet& set) noexcept {
  return std::uint64_t{1} << set.numbers.front().length_bits;
}

void put_set(const CanSet& set, std::span<const double> values, std::uint64_t number,
             CanFrame& frame) {
  const std::span<std::uint8_t> data(frame.data.data(), frame.size);
  for (const CanSignal& place : set.numbers)
    if (id_of(place) == frame.id) insert_raw(data, place, number);
  for (std::size_t i = 0; i < set.values.size(); ++i)
    if (id_of(set.values[i]) == frame.id) encode(values[i], data, set.values[i]);
}

double resolution_um(const TravelShape& shape, const CanSet& set, std::size_t node) {
  std::vector<double> counts;
  counts.reserve(set.values.size());
  for (const CanSignal& value : set.values) counts.push_back(resolution(value));
  return node_resolution_um(shape, counts, node);
}

CanSetReader::CanSetReader(CanSet set)
    : set_(std::move(set)), values_(set_.values.size(), not_a_number) {
  for (const CanSignal& number : set_.numbers) {
    Part& part = parts_.emplace_back();
    part.number_place = number;
    part.size = bytes_needed(number);
    for (std::size_t i = 0; i < set_.values.size(); ++i) {
      if (id_of(set_.values[i]) != id_of(number)) continue;
      part.places.push_back(i);
      part.size = std::max(part.size, bytes_needed(set_.values[i]));
    }
    part.values.resize(part.places.size());
  }
}

CanSetReader::Taken CanSetReader::take(const CanFrame& frame) {
  const auto part = std::find_if(parts_.begin(), parts_.end(), [&](const Part& each) {
    return id_of(each.number_place) == frame.id;
  });
  if (part == parts_.end()) return Taken::nothing;
  if (frame.size < part->size) return Taken::too_short;
  for (std::size_t i = 0; i < part->places.size(); ++i)
    part->values[i] = decode(frame.payload(), set_.values[part->places[i]]).value;
  part->number = extract_raw(frame.payload(), part->number_place);
  part->received_at = frame.received_at;
  part->is_there = true;
  if (!is_whole()) return Taken::part;
  number_ = part->number;
  received_at_ = part->received_at;
  for (const Part& each : parts_) {
    received_at_ = std::min(received_at_, each.received_at);
    for (std::size_t i = 0; i < each.places.size(); ++i) values_[each.places[i]] = each.values[i];
  }
  return Taken::whole;
}

bool CanSetReader::is_whole() const noexcept {
  return std::all_of(parts_.begin(), parts_.end(), [this](const Part& part) {
    return part.is_there && part.number == parts_.front().number;
  });
}

void CanSetReader::forget_before(nanoseconds at) noexcept {
  for (Part& part : parts_) part.is_there = part.is_there && part.received_at >= at;
}

void CanSetReader::forget() noexcept {
  for (Part& part : parts_) part.is_there = false;
}

}  // namespace thermocomp
