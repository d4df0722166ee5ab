#include "config/sections/can_travel.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "config/sections/common.hpp"
#include "config/text/number_text.hpp"

namespace thermocomp::sections {
namespace {

using FrameId = std::pair<std::uint32_t, bool>;

FrameId id_of(const CanSignal& signal) {
  return {signal.id, signal.extended_id};
}

Carried carried(const CanSignal& signal) {
  return {reach(signal), count_of(signal)};
}

/// Sets that follow one another, in so many bits.
bool can_count(int bits) {
  return bits >= CanSet::number_bits_min && bits <= CanSet::number_bits_max;
}

template <class Places>
std::vector<CanSignal> signals_of(const Places& places) {
  std::vector<CanSignal> signals;
  signals.reserve(places.size());
  for (const auto& place : places) signals.push_back(place.signal);
  return signals;
}

}  // namespace

CanTravelSection::CanTravelSection(const TomlTable& axis, const LimiterConfig& limiter,
                                   TakenBits& sent)
    : section_(axis, limiter), travel_{section_.shape(), {}, {}} {
  const TomlTable& table = section_.table();
  refuse_registers(table);
  const std::vector<Place> values = read_values(table);
  const std::vector<Place> numbers = read_numbers(table);
  check_values(values);
  check_numbers(values, numbers);
  for (const std::vector<Place>* places : {&values, &numbers})
    for (const Place& place : *places)
      if (place.table) sent.add(place.table, "start_bit", place.signal);
  travel_.sent = {signals_of(values), signals_of(numbers)};
}

void CanTravelSection::refuse_registers(const TomlTable& own) {
  refuse_all(own, {"begin", "end"},
             "makes no sense in frames: each of them has the number of the set (set_numbers)");
  own.refuse("p0_register_mm", "makes no sense in frames: it is called p0_signal_mm");
}

void CanTravelSection::read_applied(const TakenBits& sent) {
  const TomlTable own = section_.table().table_or_empty("applied");
  if (!own) return;
  refuse_registers(own);
  const std::vector<Place> values = read_values(own);
  const std::vector<Place> numbers = read_numbers(own);
  check_values(values);
  check_numbers(values, numbers);
  TakenBits shown;
  for (const std::vector<Place>* places : {&values, &numbers}) {
    for (const Place& place : *places) {
      if (!place.table) continue;
      shown.add(place.table, "start_bit", place.signal);
      if (sent.has_frame_of(place.signal))
        place.table.problem("id", "is in a frame that is sent, not received");
    }
  }
  travel_.applied = {signals_of(values), signals_of(numbers)};
  if (numbers.empty() || travel_.sent.numbers.empty()) return;
  const int bits = travel_.sent.numbers.front().length_bits;
  if (can_count(bits) && numbers.front().signal.length_bits != bits)
    numbers.front().table.problem("length_bits",
                                  "must be as in the frames that are sent: it is the same number");
}

void CanTravelSection::check_round(double period_s, double silent_after_s) const {
  if (travel_.applied.values.empty() || travel_.sent.numbers.empty()) return;
  const double round_s = std::ldexp(period_s, travel_.sent.numbers.front().length_bits);
  if (round_s > silent_after_s) return;
  section_.table().problem("set_numbers", "must have more bits: the numbers come round after " +
                                              number_text(round_s) + " s, within silent_after_s");
}

std::vector<CanTravelSection::Place> CanTravelSection::read_values(const TomlTable& own) const {
  std::vector<Place> places;
  const auto add = [&places](const TomlTable& table) {
    places.push_back({table, read_can_signal(table, table, CanUse::offset)});
  };
  if (section_.is_line()) {
    add(own.table("k0_um"));
    add(own.table("slope_um_per_m"));
    if (own.has("p0_signal_mm")) add(own.table("p0_signal_mm"));
    return places;
  }
  for (const TomlTable& table : own.tables_required("offsets")) add(table);
  const std::size_t nodes = section_.shape().nodes_mm.size();
  if (!places.empty() && places.size() != nodes)
    own.problem("offsets", std::to_string(places.size()) + " places",
                "must be " + std::to_string(nodes) + ", one a node");
  return places;
}

std::vector<CanTravelSection::Place> CanTravelSection::read_numbers(const TomlTable& own) {
  std::vector<Place> places;
  for (const TomlTable& table : own.tables_required("set_numbers"))
    places.push_back({table, read_can_signal(table, table, CanUse::bits)});
  return places;
}

void CanTravelSection::check_values(const std::vector<Place>& values) const {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const TomlTable& table = values[i].table;
    if (!table) continue;
    const Carried place = carried(values[i].signal);
    if (!section_.is_line() || i == 0)
      section_.check_offset(table, "length_bits", place);
    else if (i == 1)
      section_.check_slope(table, "length_bits", place);
    else
      section_.check_p0(table, "length_bits", place);
  }
}

void CanTravelSection::check_numbers(const std::vector<Place>& values,
                                     const std::vector<Place>& numbers) {
  std::set<FrameId> numbered;
  std::set<FrameId> carrying;
  for (const Place& value : values)
    if (value.table) carrying.insert(id_of(value.signal));
  for (const Place& number : numbers) {
    const int bits = number.signal.length_bits;
    if (!can_count(bits))
      number.table.problem("length_bits", "must be in [8, 32]: a number of sets that counts up");
    else if (bits != numbers.front().signal.length_bits)
      number.table.problem("length_bits", "must be the same in each frame: it is one number");
    if (!numbered.insert(id_of(number.signal)).second)
      number.table.problem("id", "the frame has a number of the set already");
    else if (!carrying.contains(id_of(number.signal)))
      number.table.problem("id", "the frame carries no value of the set");
  }
  if (numbers.empty()) return;  // told already
  for (const Place& value : values) {
    if (!value.table || numbered.contains(id_of(value.signal))) continue;
    value.table.problem("id",
                        "the frame carries no number of the set: name its place in set_numbers");
    numbered.insert(id_of(value.signal));  // once a frame
  }
}

}  // namespace thermocomp::sections
