#include "estimator/model/travel_curves.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "estimator/checks.hpp"
#include "estimator/name_index.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

/// A line at equal distances from three ordered points, on alternating sides.
struct Levelled {
  std::array<std::size_t, 3> at{};
  double base{0.0};  ///< at the first point of the curve
  double slope{0.0};
  double level{0.0};  ///< of the middle point above the line; the outer ones are below by as much

  Levelled(std::span<const double> x, std::span<const double> y,
           const std::array<std::size_t, 3>& points)
      : at(points) {
    const auto [a, b, c] = points;
    slope = (y[c] - y[a]) / (x[c] - x[a]);
    level = (y[b] - (y[a] + slope * (x[b] - x[a]))) / 2.0;
    base = y[a] + level - slope * (x[a] - x[0]);
  }

  [[nodiscard]] double above(std::span<const double> x, std::span<const double> y,
                             std::size_t i) const noexcept {
    return y[i] - (base + slope * (x[i] - x[0]));
  }
};

/// Exchanges the point for its neighbour on the same side of the line.
std::array<std::size_t, 3> exchanged(const Levelled& line, std::size_t point, double above) {
  const auto [a, b, c] = line.at;
  const bool like_middle = std::signbit(above) == std::signbit(line.level);
  if (point < a) return like_middle ? std::array{point, a, b} : std::array{point, b, c};
  if (point < b) return like_middle ? std::array{a, point, c} : std::array{point, b, c};
  if (point < c) return like_middle ? std::array{a, point, c} : std::array{a, b, point};
  return like_middle ? std::array{b, c, point} : std::array{a, b, point};
}

}  // namespace

CurveLine minimax_line(std::span<const double> x, std::span<const double> y) noexcept {
  THERMOCOMP_ENSURE(x.size() >= 2 && y.size() == x.size());
  const std::size_t last = x.size() - 1;
  for (const double value : y)
    if (!std::isfinite(value)) return {not_a_number, not_a_number, not_a_number};
  if (last == 1) return {y[0], y[1], 0.0};
  // Each exchange raises the level; the count is a bound in case rounding prevents that.
  const std::size_t exchanges_max = 4 * x.size();
  std::array<std::size_t, 3> points{0, last / 2, last};
  for (std::size_t exchanges = 0;; ++exchanges) {
    const Levelled line(x, y, points);
    std::size_t worst = points[1];
    for (std::size_t i = 0; i <= last; ++i)
      if (std::abs(line.above(x, y, i)) > std::abs(line.above(x, y, worst))) worst = i;
    const double deviation = std::abs(line.above(x, y, worst));
    const double rounding = 1e-12 * (std::abs(line.base) + std::abs(line.slope * (x[last] - x[0])));
    const bool is_best = !(deviation > std::abs(line.level) + rounding);
    if (is_best || exchanges == exchanges_max)
      return {line.base, line.base + line.slope * (x[last] - x[0]), deviation};
    points = exchanged(line, worst, line.above(x, y, worst));
  }
}

namespace {

/// In addition to the kinks, for terms that are not linear between them.
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
