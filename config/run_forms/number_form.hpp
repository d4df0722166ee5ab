/// Numbers with a decimal point or comma, and detection of a table's form.
#pragma once

#include <optional>
#include <string_view>

namespace thermocomp {

struct TextTable;

struct NumberForm {
  char decimal{'.'};
  char thousands{'\0'};  ///< none
};

/// Detects the form of the table's numbers. 1,234 alone is ambiguous (1.234 or 1234); if all are,
/// it is a problem that shows the line to add to the map.
[[nodiscard]] NumberForm number_form(const TextTable& table);

/// @return nullopt unless `field` is one finite number of that form
[[nodiscard]] std::optional<double> number_of(std::string_view field, const NumberForm& form);

}  // namespace thermocomp
