/// Numbers with a decimal point or comma, and which of the two a table uses.
#pragma once

#include <optional>
#include <string_view>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/problem_list.hpp"
#include "config/run_forms/spelled_unit.hpp"

namespace thermocomp {

struct TextTable;

struct NumberForm {
  char decimal{'.'};
  char thousands{'\0'};  ///< none
};

/// The form that the fields of the table show. 1,234 alone may be 1.234 or 1234 and decides
/// nothing; a table that has nothing else is a problem, with the line to write.
/// @param map  may be nullptr
[[nodiscard]] NumberForm number_form(const TextTable& table, const ColumnMap* map,
                                     ProblemList& problems);

/// @return nullopt unless all of `field` is one finite number of that form
[[nodiscard]] std::optional<double> number_of(std::string_view field, const NumberForm& form);

}  // namespace thermocomp
