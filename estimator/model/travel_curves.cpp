#include "estimator/model/travel_curves.hpp"

#include <algorithm>

#include "estimator/checks.hpp"
#include "estimator/model/minimax_line.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

/// Beside the kinks, for terms that are no straight lines between them.
constexpr std::size_t even_samples = 9;

void check_order(const std::vector<AxisConfig>& axes, const AxisSpan& span) {
  require(span.count >= 2, "axis.nodes_mm", static_cast<double>(span.count),
          "must be two nodes at least");
  for (std::size_t i = span.first + 1; i < span.end(); ++i)
    require(axes[i].node->position_mm > axes[i - 1].node->position_mm, "axis.nodes_mm",
            axes[i].node->position_mm, "must increase");
}

}  // namespace

std::vector<double> travel_samples_mm(const ThermalModel& model, const std::string& position,
                                      double low_mm, double high_mm, std::size_t even) {
  std::vector<double> at_mm;
  const double step_mm = (high_mm - low_mm) / static_cast<double>(even - 1);
  for (std::size_t i = 0; i + 1 < even; ++i)
    at_mm.push_back(low_mm + static_cast<double>(i) * step_mm);
  at_mm.push_back(high_mm);
  for (const GuidewaySpec& guideway : model.guideways) {
    if (guideway.axis != position) continue;
    for (const double kink_mm : guideway.positions_mm)
      if (kink_mm > low_mm && kink_mm < high_mm) at_mm.push_back(kink_mm);
  }
  std::sort(at_mm.begin(), at_mm.end());
  at_mm.erase(std::unique(at_mm.begin(), at_mm.end()), at_mm.end());
  return at_mm;
}

std::vector<NodePlace> node_places(const EstimatorConfig& config, const ThermalModel& model) {
  std::vector<NodePlace> places;
  const std::vector<std::string> names = model.signal_columns();
  for (const AxisConfig& axis : config.axes) {
    NodePlace& place = places.emplace_back();
    if (!axis.node) continue;
    place.is_node = true;
    place.signal =
        index_of(names, axis.node->position, "axis.position", "is not a signal of the model");
    place.position_mm = axis.node->position_mm;
  }
  return places;
}

TravelCurves::TravelCurves(const EstimatorConfig& config, const ThermalModel& model)
    : signals_(model.signal_columns().size(), 0.0), outputs_um_(model.outputs.size(), 0.0) {
  const std::vector<NodePlace> places = node_places(config, model);
  for (const AxisSpan& span : axis_spans(config.axes)) {
    const AxisConfig& axis = config.axes[span.first];
    if (!axis.node) continue;
    check_order(config.axes, span);
    Travel& travel = travels_.emplace_back();
    travel.span = span;
    travel.form = axis.node->form;
    travel.signal = places[span.first].signal;
    travel.output =
        index_of(model.outputs, axis.output, "axis.output", "is not an output of the model");
    if (travel.form == TravelForm::line) {
      travel.at_mm = travel_samples_mm(model, axis.node->position, places[span.first].position_mm,
                                       places[span.end() - 1].position_mm, even_samples);
    } else {
      for (std::size_t i = span.first; i < span.end(); ++i)
        travel.at_mm.push_back(places[i].position_mm);
    }
    travel.curve_um.resize(travel.at_mm.size());
  }
}

void TravelCurves::begin(std::span<const double> signals) noexcept {
  THERMOCOMP_ENSURE(signals.size() == signals_.size());
  std::copy(signals.begin(), signals.end(), signals_.begin());
}

void TravelCurves::finish(const Travel& travel, std::span<double> axis_um) noexcept {
  const std::span<double> nodes_um = axis_um.subspan(travel.span.first, travel.span.count);
  if (travel.form == TravelForm::table) {
    std::copy(travel.curve_um.begin(), travel.curve_um.end(), nodes_um.begin());
    return;
  }
  const CurveLine line = minimax_line(travel.at_mm, travel.curve_um);
  nodes_um.front() = line.at_first;
  nodes_um.back() = line.at_last;
}

}  // namespace thermocomp
