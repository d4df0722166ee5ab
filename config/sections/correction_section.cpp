#include "config/sections/correction_section.hpp"

#include <algorithm>
#include <set>

#include "config/sections/common.hpp"

namespace thermocomp::sections {

CorrectionConfig read_correction(const TomlTable& table) {
  constexpr std::array<NumberField<CorrectionConfig>, 11> fields{{
      {"noise_um", &CorrectionConfig::noise_um},
      {"turn_um", &CorrectionConfig::turn_um},
      {"contribution_um_min", &CorrectionConfig::contribution_um_min},
      {"gain_min", &CorrectionConfig::gain_min},
      {"gain_max", &CorrectionConfig::gain_max},
      {"step_um_max", &CorrectionConfig::step_um_max},
      {"gain_sd", &CorrectionConfig::gain_sd},
      {"gain_drift_per_sqrt_h", &CorrectionConfig::gain_drift_per_sqrt_h},
      {"bias_drift_um_per_sqrt_h", &CorrectionConfig::bias_drift_um_per_sqrt_h},
      {"outlier_sigma", &CorrectionConfig::outlier_sigma},
      {"probe_sd_um", &CorrectionConfig::probe_sd_um},
  }};
  CorrectionConfig config;
  config.form = table.choice<CorrectionForm>("form",
                                             {{"off", CorrectionForm::off},
                                              {"two_phase", CorrectionForm::two_phase},
                                              {"recursive", CorrectionForm::recursive},
                                              {"constant", CorrectionForm::constant}},
                                             config.form);
  config.measured = table.choice<MeasuredMeaning>(
      "measured", {{"remaining", MeasuredMeaning::remaining}, {"total", MeasuredMeaning::total}},
      config.measured);
  config.first_gain = table.choice<FirstGain>("first_gain",
                                              {{"consistent", FirstGain::consistent},
                                               {"eq_34", FirstGain::eq_34},
                                               {"eq_31", FirstGain::eq_31}},
                                              config.first_gain);
  read_fields(table, fields, CorrectionConfig{}, config);
  for (const TomlTable& group : table.tables("group"))
    config.groups.push_back(group.texts("inputs"));
  const std::size_t count = config.groups.size();
  if (config.form == CorrectionForm::two_phase && count != 2)
    table.problem("group", std::to_string(count),
                  "must be two for form = \"two_phase\": the heat source's inputs, then the tie's");
  if ((config.form == CorrectionForm::recursive || config.form == CorrectionForm::constant) &&
      (count < 1 || count > correction_groups_max))
    table.problem("group", std::to_string(count),
                  "must be 1 to 4 for form = \"recursive\" and \"constant\"");
  return config;
}

void check_correction(const TomlTable& table, const CorrectionConfig& config,
                      const ThermalModel& model) {
  if (model.course && config.form != CorrectionForm::off && model.course->groups != config.groups)
    table.problem("group", "must be the groups of the model's [course], in its order");
  std::set<std::string> named;
  const std::vector<TomlTable> groups = table.tables("group");
  for (std::size_t i = 0; i < config.groups.size(); ++i) {
    for (const std::string& name : config.groups[i]) {
      if (std::find(model.inputs.begin(), model.inputs.end(), name) == model.inputs.end())
        groups[i].problem("inputs", name, "must be an input of the model");
      else if (!named.insert(name).second)
        groups[i].problem("inputs", name, "is named already");
    }
  }
}

}  // namespace thermocomp::sections
