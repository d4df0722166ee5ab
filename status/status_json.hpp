/// The structures of status/status.hpp as JSON, both ways.
#pragma once

#include <nlohmann/json.hpp>

#include "status/status.hpp"

namespace thermocomp {

/// Of any structure with `fields`, of an Event, and of vectors of them.
template <class Part>
[[nodiscard]] nlohmann::json json_of(const Part& part);

/// Reads without trusting the shape: what is absent or of another type stays as the structure
/// begins. A text is one line. A reason that is not known becomes a warning.
template <class Part>
[[nodiscard]] Part part_from(const nlohmann::json& value);

}  // namespace thermocomp
