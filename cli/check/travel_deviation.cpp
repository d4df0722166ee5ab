#include "cli/check/travel_deviation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <span>
#include <vector>

#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "estimator/axis_spans.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/travel_curves.hpp"

namespace thermocomp::cli {
namespace {

constexpr double rise_K = 10.0;
/// Beside the kinks of the model, where a curve is straight from one to the next.
constexpr std::size_t even_places = 201;

struct Deviation {
  double um{0.0};
  double at_mm{0.0};
  double range_um{0.0};  ///< of the curve over the travel
};

class Deviations {
 public:
  Deviations(const DaemonConfig& config, const AxisSpan& span)
      : nodes_(std::span(config.estimator.axes).subspan(span.first, span.count)),
        model_(config.model),
        columns_(config.model.temperature_columns()),
        signal_(node_places(config.estimator, config.model)[span.first].signal),
        signals_(config.model.signal_columns().size(), 0.0),
        outputs_um_(config.model.outputs.size()) {
    const auto& outputs = config.model.outputs;
    output_ = static_cast<std::size_t>(std::find(outputs.begin(), outputs.end(), nodes_[0].output) -
                                       outputs.begin());
    EstimatorConfig alone;
    alone.axes.assign(nodes_.begin(), nodes_.end());
    curves_.emplace(alone, config.model);
    at_mm_ =
        travel_samples_mm(config.model, nodes_[0].node->position, nodes_.front().node->position_mm,
                          nodes_.back().node->position_mm, even_places);
  }

  [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }

  /// @param column  the temperature that has risen; columns().size(): all have
  [[nodiscard]] Deviation of(std::size_t column) {
    DisplacementModel model(model_);
    const std::vector<double> reference_degC(columns_.size(), 20.0);
    std::vector<double> temps_degC = reference_degC;
    for (std::size_t i = 0; i < temps_degC.size(); ++i)
      if (i == column || column == columns_.size()) temps_degC[i] += rise_K;
    const auto at = [&](std::span<const double> signals, std::span<double> out_um) {
      model.step(nanoseconds{}, temps_degC, reference_degC, signals, out_um);
    };
    std::vector<double> node_um(nodes_.size());
    curves_->step(at, signals_, node_um);
    Deviation found;
    double low_um = node_um[0];
    double high_um = node_um[0];
    for (const double position_mm : at_mm_) {
      signals_[signal_] = position_mm;
      at(signals_, outputs_um_);
      const double curve_um = outputs_um_[output_];
      low_um = std::min(low_um, curve_um);
      high_um = std::max(high_um, curve_um);
      const double off_um = std::abs(curve_um - value_on_travel(nodes_, node_um, position_mm));
      if (off_um <= found.um) continue;
      found.um = off_um;
      found.at_mm = position_mm;
    }
    found.range_um = high_um - low_um;
    return found;
  }

 private:
  std::span<const AxisConfig> nodes_;
  const ThermalModel& model_;
  std::vector<std::string> columns_;
  std::size_t signal_;
  std::size_t output_{0};
  std::vector<double> signals_;
  std::vector<double> outputs_um_;
  std::optional<TravelCurves> curves_;
  std::vector<double> at_mm_;
};

std::string hundredths(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f", value);
  return text.data();
}

/// "2.50 um of 40.00 um"
std::string size_text(const Deviation& deviation, const std::string& unit) {
  std::string text = hundredths(deviation.um);
  text.append(" ").append(unit).append(" of ").append(hundredths(deviation.range_um));
  return text.append(" ").append(unit);
}

/// "a line over x_mm 0 to 800 mm"
std::string form_text(std::span<const AxisConfig> nodes) {
  const TravelNode& first = *nodes.front().node;
  std::string text("a line");
  if (first.form == TravelForm::table) {
    text = "a table of ";
    text.append(std::to_string(nodes.size())).append(" nodes");
  }
  text.append(" over ").append(first.position).append(" ");
  text.append(number_text(first.position_mm)).append(" to ");
  return text.append(number_text(nodes.back().node->position_mm)).append(" mm");
}

std::string text_of(const DaemonConfig& config, const AxisSpan& span) {
  const auto nodes = std::span(config.estimator.axes).subspan(span.first, span.count);
  const std::string unit(unit_of(nodes.front().output).symbol);
  Deviations deviations(config, span);
  const Deviation all = deviations.of(deviations.columns().size());
  Deviation worst;
  std::string column;
  for (std::size_t i = 0; i < deviations.columns().size(); ++i) {
    const Deviation alone = deviations.of(i);
    if (!column.empty() && alone.um <= worst.um) continue;
    worst = alone;
    column = deviations.columns()[i];
  }
  std::string text("axis ");
  text.append(axis_name(nodes.front())).append(": ").append(form_text(nodes));
  text.append("; largest deviation from the model's curve for 10 K: ");
  text.append(size_text(all, unit)).append(" (all temperatures)");
  if (deviations.columns().size() > 1) {
    text.append(", ").append(size_text(worst, unit)).append(" at ");
    text.append(number_text(worst.at_mm)).append(" mm (").append(column).append(" alone)");
  }
  return text.append("\n");
}

}  // namespace

std::string travel_deviation_text(const DaemonConfig& config) {
  std::string text;
  for (const AxisSpan& span : axis_spans(config.estimator.axes))
    if (config.estimator.axes[span.first].node) text += text_of(config, span);
  return text;
}

}  // namespace thermocomp::cli
