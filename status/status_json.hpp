/// Conversion of the structures of status/status.hpp to and from JSON.
#pragma once

#include <nlohmann/json.hpp>

#include "status/status.hpp"

namespace thermocomp {

/// For any structure with `fields`, Event, and vectors of them.
template <class Part>
[[nodiscard]] nlohmann::json json_of(const Part& part);

/// Tolerates any shape: missing members and those of another type keep the structure's defaults. A
/// text is reduced to one line. An unknown reason becomes a warning.
template <class Part>
[[nodiscard]] Part part_from(const nlohmann::json& value);

}  // namespace thermocomp
