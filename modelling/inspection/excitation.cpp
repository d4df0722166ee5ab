#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <Eigen/Cholesky>

#include "config/text/units.hpp"
#include "modelling/inspection/checks.hpp"

namespace thermocomp::inspection {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double alike_correlation = 0.98;  // as for groups of places in diagnose
constexpr double structure_s = 900.0;       // response time of a structure to a signal
constexpr double own_share_min = 0.1;       // of its variance not explained by other signals
constexpr int changes_min = 2;              // up and down

MatrixXd from_means(const Recording& recording, MatrixXd columns) {
  for (std::size_t r = 0; r < recording.runs(); ++r) {
    auto rows =
        columns.middleRows(recording.begins[r], recording.begins[r + 1] - recording.begins[r]);
    if (rows.rows() > 0) rows.rowwise() -= rows.colwise().mean().eval();
  }
  return columns;
}

/// Crossings of the middle of a signal's range, with a hysteresis of a tenth of it.
int changes_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  const double low = values.minCoeff();
  const double high = values.maxCoeff();
  if (!(high > low)) return 0;
  const double middle = 0.5 * (low + high);
  const double play = 0.05 * (high - low);
  int changes = 0;
  int side = values[0] > middle ? 1 : -1;
  for (const double value : values) {
    const int now = value > middle + play ? 1 : value < middle - play ? -1 : side;
    if (now != side) ++changes;
    side = now;
  }
  return changes;
}

}  // namespace

std::vector<std::vector<std::string>> groups_of(const Recording& recording) {
  const Index places = recording.temps_K.cols();
  const MatrixXd rises = from_means(recording, recording.temps_K);
  const MatrixXd products = rises.transpose() * rises;
  std::vector<std::vector<Index>> groups;
  for (Index place = 0; place < places; ++place) {
    const auto joins = [&](const std::vector<Index>& group) {
      return std::all_of(group.begin(), group.end(), [&](Index other) {
        const double scale = std::sqrt(products(place, place) * products(other, other));
        return scale > 0 && products(place, other) > alike_correlation * scale;
      });
    };
    const auto found = std::find_if(groups.begin(), groups.end(), joins);
    if (found == groups.end())
      groups.push_back({place});
    else
      found->push_back(place);
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  std::vector<std::vector<std::string>> names;
  for (const auto& group : groups) {
    names.emplace_back();
    for (const Index place : group)
      names.back().push_back(recording.temps[static_cast<std::size_t>(place)]);
  }
  return names;
}

void judge_excitation(const Recording& recording, Inspection& inspection) {
  const Index signals = recording.values.cols();
  if (recording.time_s.size() == 0) return;
  const MatrixXd slow = from_means(recording, low_pass(recording, recording.values, structure_s));
  const MatrixXd products = slow.transpose() * slow;
  std::set<std::pair<Index, Index>> reported;
  const auto add_pair = [&](Index i, Index nearest) {
    if (reported.contains({nearest, i})) return;
    reported.emplace(i, nearest);
    const std::string& name = recording.signals[static_cast<std::size_t>(i)];
    const std::string other =
        nearest >= 0 ? recording.signals[static_cast<std::size_t>(nearest)] : "the others";
    // A temperature cannot be run alone, even if it changes in steps like a setpoint.
    inspection.experiments.push_back(name + " always went with " + other +
                                     (is_temperature(name)
                                          ? ": a model cannot tell them apart."
                                          : ": run one of them alone for an hour."));
  };
  for (Index i = 0; i < signals; ++i) {
    const std::string& name = recording.signals[static_cast<std::size_t>(i)];
    const int changes = changes_of(recording.values.col(i));
    double own = products(i, i) > 0 ? 1.0 : 0.0;
    Index nearest = -1;
    if (own > 0 && signals > 1) {
      MatrixXd rest = products;
      rest.diagonal().array() += 1e-9 * (1.0 + products.diagonal().array());
      const MatrixXd inverse = rest.ldlt().solve(MatrixXd::Identity(signals, signals));
      own = 1.0 / (inverse(i, i) * rest(i, i));
      double most = 0.0;
      for (Index k = 0; k < signals; ++k) {
        if (k == i || !(products(k, k) > 0)) continue;
        const double alike = std::abs(products(i, k)) / std::sqrt(products(i, i) * products(k, k));
        if (alike > most) nearest = k;
        most = std::max(most, alike);
      }
    }
    const bool excited = changes >= changes_min && own >= own_share_min;
    inspection.excited.emplace_back(name, excited);
    if (excited) continue;
    if (changes == 0)
      inspection.experiments.push_back(
          name +
          " never changed, so its effect is unknown. Run it at two levels for an hour each and "
          "keep everything else constant.");
    else if (changes < changes_min)
      inspection.experiments.push_back(
          name +
          " changed once, so its effect cannot be separated from a drift. Change it back and "
          "again, for an hour each.");
    else
      add_pair(i, nearest);
  }
  for (const auto& group : inspection.groups) {
    if (group.size() < 2) continue;
    std::string names;
    for (const std::string& name : group) names += (names.empty() ? "" : ", ") + name;
    inspection.experiments.push_back(
        names +
        " moved alike, so a model cannot separate them, and one of them is enough. To separate "
        "them, heat only one of them.");
  }
}

}  // namespace thermocomp::inspection
