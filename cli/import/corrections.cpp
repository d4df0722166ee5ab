#include "cli/import/corrections.hpp"

#include <cctype>
#include <cmath>

#include "config/run_forms/long_table.hpp"
#include "config/text/units.hpp"

namespace thermocomp::cli {

RunFile displacements_of(RunFile corrections, CorrectionEntry entry) {
  bool has_axis = false;
  for (std::size_t i = 0; i < corrections.columns.size(); ++i) {
    std::string& name = corrections.columns[i];
    const Unit unit = unit_of(name);
    std::string axis = name.substr(0, name.size() - unit.suffix.size());
    if (!is_axis_letter(axis)) continue;
    const bool is_mm = unit.kind == QuantityKind::position;
    if (!is_mm && !is_output(name))
      throw ConfigurationError(
          {Problem{corrections.name, 0, name, "",
                   "has no unit of a correction: name the column of the values with it (\"value "
                   "[mm]\"), or write it under [columns] in the file of --columns"}});
    axis[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(axis[0])));
    const std::string was = name;
    const std::string displacement = axis + (is_mm ? "_um" : std::string(unit.suffix));
    if (displacement != was && corrections.find(displacement))
      throw ConfigurationError({Problem{corrections.name, 0, was, "",
                                        "is a second column of corrections of axis " + axis}});
    name = displacement;
    double sum = 0.0;
    for (double& value : corrections.values[i]) {
      if (std::isnan(value)) continue;
      const double entered = is_mm ? 1e3 * value : value;
      sum = entry == CorrectionEntry::step ? sum + entered : entered;
      value = -sum;
    }
    corrections.understood.push_back(name + ": less the " +
                                     (entry == CorrectionEntry::step ? "sum of " : "last of ") +
                                     was + ", what was corrected");
    has_axis = true;
  }
  if (!has_axis)
    throw ConfigurationError(
        {Problem{corrections.name, 0, "", "",
                 "no column is called as an axis (x, y, z, a, b, c); of several "
                 "tools or places each needs a log of its own"}});
  return corrections;
}

}  // namespace thermocomp::cli
