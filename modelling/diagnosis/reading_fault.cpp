#include "modelling/diagnosis/reading_fault.hpp"

#include <algorithm>
#include <iterator>

namespace thermocomp::diagnosis {
namespace {

bool named_room(const std::string& column) {
  return column.find("room") != std::string::npos || column.find("ambient") != std::string::npos ||
         column.find("air") != std::string::npos;
}

const Column* room_of(const MeasuredData& data, const MeasuredRun& run) {
  const auto find = [](const auto& names, const auto& columns) -> const Column* {
    const auto at = std::find(names.begin(), names.end(), room_among(names)) - names.begin();
    return at == std::ssize(names) ? nullptr : &columns[static_cast<std::size_t>(at)];
  };
  const Column* const other = find(data.others, run.others_degC);
  return other != nullptr ? other : find(data.model.inputs, run.inputs_degC);
}

/// reading = room + gain (T - room): the reading misses (1 / gain - 1) (reading - room).
Column lost_K(const MeasuredData& data, const MeasuredRun& run, std::size_t input) {
  const Column& reading_degC = run.inputs_degC[input];
  const Column* const room_degC = room_of(data, run);
  if (room_degC != nullptr) return *room_degC - reading_degC;
  return double(reading_degC[0]) - reading_degC.array();
}

}  // namespace

std::string room_among(const std::vector<std::string>& columns) {
  const auto room = std::find_if(columns.begin(), columns.end(), named_room);
  return room == columns.end() ? std::string() : *room;
}

Column error_of_reading(const std::string& cause, const MeasuredData& data, const MeasuredRun& run,
                        std::size_t input, double onset_s) {
  if (cause == "sensor_drift") return ((run.time_s.array() - onset_s) / 3600.0).max(0.0);
  const Column since = (run.time_s.array() >= onset_s).cast<double>();
  if (cause == "sensor_step") return since;
  return since.cwiseProduct(lost_K(data, run, input));
}

}  // namespace thermocomp::diagnosis
