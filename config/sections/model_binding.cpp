#include "config/sections/model_binding.hpp"

#include <algorithm>

#include "config/sections/common.hpp"
#include "config/text/units.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/sensing/neighbours.hpp"

namespace thermocomp::sections {
namespace {

constexpr const char* like_hint =
    " (`thermocomp fit --like OLD_MODEL.toml` keeps inputs and outputs that a fit does not use)";

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void check_blocks(const BindingTables& tables, const EstimatorConfig& config,
                  const std::vector<std::string>& columns) {
  std::vector<std::string> bound;
  for (std::size_t i = 0; i < config.blocks.size(); ++i) {
    const std::string& input = config.blocks[i].input;
    if (!is_temperature(input)) continue;  // reported already
    if (!contains(columns, input)) {
      tables.blocks[i].problem(
          "input", "must be a temperature of the model: " + listed(columns) + like_hint);
    } else if (contains(bound, input)) {
      tables.blocks[i].problem("input", "is bound by another block already");
    }
    bound.push_back(input);
  }
  for (const std::string& column : columns) {
    if (!contains(bound, column)) {
      tables.root.problem("block", column, "the model's temperature needs a block with this input");
    }
  }
}

/// Refuses weigh_down where it can never take effect.
void check_weighing_down(const BindingTables& tables, const EstimatorConfig& config,
                         const ThermalModel& model) {
  if (config.compensation.suspected_sensors != SuspectedPolicy::weigh_down) return;
  if (!model.covariance_K2.empty() && model.inputs.size() >= NeighbourCheck::inputs_min) return;
  tables.root.problem("compensation.suspected_sensors", "weigh_down",
                      std::string("needs a model with [covariance] and at least ")
                          .append(std::to_string(NeighbourCheck::inputs_min))
                          .append(" inputs (`thermocomp covariance` makes it from records)"));
}

/// The displacement must be a unique function of the position by which the controller interpolates:
/// with backlash it differs between the two directions.
void check_travel(const TomlTable& table, const AxisConfig& axis, const ThermalModel& model) {
  const TomlTable travel = table.table(axis.node->form == TravelForm::line ? "line" : "table");
  std::vector<std::string> positions;
  for (const std::string& signal : model.signal_columns())
    if (signal.ends_with("_mm")) positions.push_back(signal);
  if (!contains(positions, axis.node->position))
    travel.problem("position", positions.empty()
                                   ? "the model depends on no position: give the axis an `offset`"
                                   : "must be a position of the model: " + listed(positions));
  for (const TermSpec& term : model.terms)
    if (term.kind == "hysteresis" && term.subject == axis.output)
      table.problem("output",
                    "the model gives it a hysteresis: its displacement along the travel "
                    "is no curve; give the axis an `offset`");
}

void check_diameter(const TomlTable& table, const AxisConfig& axis, const ThermalModel& model) {
  const DiameterSpec* diameter = diameter_of(model, axis.output);
  if (diameter == nullptr || diameter->axis == axis_name(axis)) return;
  std::string rule("is a diameter that the model assigns to axis ");
  rule.append(diameter->axis);
  table.problem("output", axis.output, rule);
}

void check_signals(const TomlTable& root, const EstimatorConfig& config, const ThermalModel& model,
                   const std::string& model_file) {
  const bool has_controller = root.table("controller").text("kind") != "dry_run";
  for (const std::string& signal : model.signal_columns()) {
    if (!is_operating(signal)) continue;  // reported by the model file
    if (contains(config.signals, signal)) continue;
    std::string rule = model_file;
    rule += " needs this signal";
    if (has_controller)
      rule.append(
              " from the controller: add a [[controller.signal]], or fit without it: fit "
              "--columns FILE with ignore = [\"")
          .append(signal)
          .append("\"]");
    else
      rule +=
          ", and kind = \"dry_run\" has none: give the controller's kind and dry_run = true, or "
          "use a model without signals";
    root.problem("controller.signal", signal, rule);
  }
}

}  // namespace

void check_binding(const BindingTables& tables, const EstimatorConfig& config,
                   const ThermalModel& model, const std::string& model_file) {
  check_blocks(tables, config, model.temperature_columns());
  check_weighing_down(tables, config, model);
  check_signals(tables.root, config, model, model_file);
  const std::vector<AxisSpan> spans = axis_spans(config.axes);
  for (std::size_t i = 0; i < spans.size(); ++i) {
    const AxisConfig& axis = config.axes[spans[i].first];
    if (is_output(axis.output) && !contains(model.outputs, axis.output))
      tables.axes[i].problem(
          "output", "must be an output of the model: " + listed(model.outputs) + like_hint);
    check_diameter(tables.axes[i], axis, model);
    if (axis.node) check_travel(tables.axes[i], axis, model);
  }
}

}  // namespace thermocomp::sections
