#include "modelling/diagnosis/thermal/corrected_machine.hpp"

#include "modelling/diagnosis/causes/cause.hpp"

namespace thermocomp::diagnosis {

std::optional<std::string> corrected_machine(const std::filesystem::path& path,
                                             const std::vector<NamedFinding>& findings) {
  MachineFile machine(path);
  if (machine.is_body()) return std::nullopt;
  std::string text = "# Written by thermocomp diagnose: values as the training runs have them.\n";
  for (const NamedFinding& finding : findings) {
    const Cause* const cause = find_cause(finding.cause);
    if (cause == nullptr || cause->into_machine == nullptr ||
        !cause->into_machine(machine, finding.subject, finding.parameters))
      text.append("# No key carries " + finding.cause + " of " + finding.subject + ".\n");
  }
  return text + machine.text() + "\n";
}

}  // namespace thermocomp::diagnosis
