#include "modelling/diagnosis/data/room.hpp"

#include <algorithm>
#include <iterator>

#include "config/runs/model_inputs.hpp"

namespace thermocomp::diagnosis {

std::string room_among(const std::vector<std::string>& columns) {
  const auto room = std::find_if(columns.begin(), columns.end(), is_called_like_a_room);
  return room == columns.end() ? std::string() : *room;
}

const Column* room_degC(const MeasuredData& data, const MeasuredRun& run) {
  const auto find = [](const auto& names, const auto& columns) -> const Column* {
    const auto at = std::find(names.begin(), names.end(), room_among(names)) - names.begin();
    return at == std::ssize(names) ? nullptr : &columns[static_cast<std::size_t>(at)];
  };
  const Column* const other = find(data.others, run.others_degC);
  return other != nullptr ? other : find(data.model.inputs, run.inputs_degC);
}

}  // namespace thermocomp::diagnosis
