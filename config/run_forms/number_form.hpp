/// Detection of the form of a table's numbers.
#pragma once

#include "config/run_forms/text_table.hpp"

namespace thermocomp {

/// Detects the form of the table's numbers. 1,234 alone is ambiguous (1.234 or 1234); if all are,
/// it is a problem that shows the line to add to the map.
[[nodiscard]] NumberForm number_form(const TextTable& table);

}  // namespace thermocomp
