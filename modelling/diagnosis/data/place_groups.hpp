/// Places that cannot be told apart by their temperatures.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "modelling/diagnosis/data/measured_runs.hpp"

namespace thermocomp::diagnosis {

/// Temperatures whose rises over the selected rows correlate above 0.98, by name; every temperature
/// is in its own group.
using PlaceGroups = std::map<std::string, std::vector<std::string>>;
[[nodiscard]] PlaceGroups place_groups(const MeasuredData& data);
/// Whether two subjects are the same but for places of one group.
[[nodiscard]] bool same_places(const PlaceGroups& groups, const std::string& subject,
                               const std::string& other);
/// The group of every place of a subject, without repetition, the subject's own places first; then
/// the places of other subjects.
[[nodiscard]] std::vector<std::string> group_of(const PlaceGroups& groups,
                                                const std::string& subject,
                                                const std::vector<std::string>& others = {});

}  // namespace thermocomp::diagnosis
