#include "modelling/experiments/separation.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include <nlohmann/json.hpp>

#include "modelling/identification/printed.hpp"

namespace thermocomp::experiments {
namespace {

using identification::MeasuredTests;
using identification::printed;
using identification::TestRun;

constexpr double alike = 0.98;
constexpr double apart = 0.9;

/// Columns of one kind over all runs: temperatures or operating signals.
struct Columns {
  std::vector<std::string> names;
  Eigen::MatrixXd squares;  ///< about the mean of each run [unit^2 h]
  Eigen::VectorXd range;    ///< largest within a run
  Eigen::VectorXd per_h;    ///< largest change within an hour, or in a shorter run
  bool temperatures{false};
};

Eigen::MatrixXd selected(const TestRun& run, bool temperatures) {
  const Eigen::MatrixXd& all = temperatures ? run.places_K : run.signals;
  return all.bottomRows(all.rows() - run.begin);
}

double hours_of(const TestRun& run) {
  return (run.time_s[run.time_s.size() - 1] - run.time_s[run.begin]) / 3600.0;
}

/// Largest rate between two rows an hour apart; in a shorter run, since its beginning [1/h].
double largest_per_h(const Eigen::VectorXd& hours, const Eigen::VectorXd& values) {
  double largest = 0.0;
  Eigen::Index from = 0;
  const double apart_h = std::min(1.0, hours[hours.size() - 1] - hours[0]);
  for (Eigen::Index row = 0; row < values.size(); ++row) {
    while (from + 1 < row && hours[row] - hours[from + 1] >= apart_h - 1e-9) ++from;
    const double passed_h = hours[row] - hours[from];
    if (passed_h >= apart_h - 1e-9)
      largest = std::max(largest, std::abs(values[row] - values[from]) / passed_h);
  }
  return largest;
}

Columns columns_of(const MeasuredTests& tests, bool temperatures) {
  Columns all{temperatures ? tests.places : tests.signals, {}, {}, {}, temperatures};
  const auto count = static_cast<Eigen::Index>(all.names.size());
  all.squares = Eigen::MatrixXd::Zero(count, count);
  all.range = all.per_h = Eigen::VectorXd::Zero(count);
  if (count == 0) return all;
  for (const TestRun& run : tests.runs) {
    const Eigen::MatrixXd rows = selected(run, temperatures);
    if (rows.rows() < 2) continue;
    const Eigen::MatrixXd centred = rows.rowwise() - rows.colwise().mean();
    all.squares +=
        centred.transpose() * centred * hours_of(run) / static_cast<double>(rows.rows() - 1);
    const Eigen::VectorXd hours = run.time_s.tail(rows.rows()).array() / 3600.0;
    for (Eigen::Index i = 0; i < count; ++i) {
      all.range[i] = std::max(all.range[i], rows.col(i).maxCoeff() - rows.col(i).minCoeff());
      all.per_h[i] = std::max(all.per_h[i], largest_per_h(hours, rows.col(i)));
    }
  }
  return all;
}

double correlation(const Columns& of, Eigen::Index a, Eigen::Index b) {
  const double lengths = std::sqrt(of.squares(a, a) * of.squares(b, b));
  return lengths > 0 ? of.squares(a, b) / lengths : 0.0;
}

/// Duration for which column a must move while b rests.
Move move_of(const Columns& of, Eigen::Index a, Eigen::Index b) {
  const double r = correlation(of, a, b);
  const double range = of.range[a];
  const double wanted = of.squares(a, a) * (r * r / (apart * apart) - 1.0);
  Move move{of.names[static_cast<std::size_t>(a)], {}, r, range, 0.0, of.temperatures};
  if (!of.temperatures) {
    move.hours = 4.0 * wanted / (range * range);
    return move;
  }
  const double once_h = std::cbrt(48.0 * wanted / (of.per_h[a] * of.per_h[a]));
  if (of.per_h[a] * once_h / 2.0 <= range) {
    move.hours = once_h;
    move.swing = of.per_h[a] * once_h / 2.0;
  } else {
    move.hours = 12.0 * wanted / (range * range);
  }
  return move;
}

void add_moves(const Columns& of, std::vector<Move>& moves) {
  std::vector<Eigen::Index> left(of.names.size());
  std::iota(left.begin(), left.end(), 0);
  while (!left.empty()) {
    std::vector<Eigen::Index> group;
    std::copy_if(left.begin(), left.end(), std::back_inserter(group), [&](Eigen::Index each) {
      return each == left.front() || std::abs(correlation(of, left.front(), each)) > alike;
    });
    std::erase_if(left, [&](Eigen::Index each) {
      return std::find(group.begin(), group.end(), each) != group.end();
    });
    std::vector<Move> of_group;
    for (const Eigen::Index a : group) {
      std::vector<Eigen::Index> others;
      std::copy_if(group.begin(), group.end(), std::back_inserter(others),
                   [a](Eigen::Index each) { return each != a; });
      if (others.empty()) break;
      std::stable_sort(others.begin(), others.end(), [&](Eigen::Index b, Eigen::Index c) {
        return std::abs(correlation(of, a, b)) > std::abs(correlation(of, a, c));
      });
      Move& move = of_group.emplace_back(move_of(of, a, others.front()));
      for (const Eigen::Index b : others)
        move.rest.push_back(of.names[static_cast<std::size_t>(b)]);
    }
    std::stable_sort(of_group.begin(), of_group.end(),
                     [](const Move& a, const Move& b) { return a.hours < b.hours; });
    if (!of_group.empty()) of_group.pop_back();
    moves.insert(moves.end(), of_group.begin(), of_group.end());
  }
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text.append(text.empty() ? "" : ", ").append(name);
  return text;
}

}  // namespace

double Separation::hours() const noexcept {
  return std::accumulate(moves.begin(), moves.end(), 0.0,
                         [](double sum, const Move& move) { return sum + move.hours; });
}

Separation separation(const MeasuredTests& tests) {
  Separation found;
  for (const TestRun& run : tests.runs) found.recorded_h += hours_of(run);
  add_moves(columns_of(tests, true), found.moves);
  add_moves(columns_of(tests, false), found.moves);
  std::erase_if(found.moves, [&](const Move& move) { return !tests.moved(move.column); });
  found.unmoved = tests.unmoved;
  return found;
}

std::string separation_text(const Separation& separation) {
  std::string text = printed("%.3g h recorded.\n", separation.recorded_h);
  if (separation.moves.empty() && separation.unmoved.empty())
    text.append("No two columns moved alike throughout.\n");
  for (const Move& move : separation.moves) {
    text.append("\n").append(move.column).append(" moved as ").append(listed(move.rest));
    text.append(printed(" did (correlation %.3g).\n  %.3g h: ", move.correlation, move.hours));
    text.append(move.column).append(printed(" up by %.3g", move.swing));
    text.append(move.is_temperature ? " K and back, at its fastest recorded rate"
                                    : " and down, half of the time each");
    text.append("; keep the others constant.\n");
  }
  for (const std::string& signal : separation.unmoved)
    text.append("\n").append(signal).append(
        " was constant within each run, or went one way only: record a run in which it goes up and "
        "down.\n");
  if (!separation.moves.empty())
    text.append(printed("\n%.3g h in all, from a cold machine. ", separation.hours()))
        .append("If a column cannot be moved alone, leave it or the others out of the fit.\n");
  return text;
}

std::string separation_json(const Separation& separation) {
  nlohmann::ordered_json json;
  json["recorded_h"] = separation.recorded_h;
  json["hours"] = separation.hours();
  json["moves"] = nlohmann::ordered_json::array();
  for (const Move& move : separation.moves)
    json["moves"].push_back({{"column", move.column},
                             {"rest", move.rest},
                             {"correlation", move.correlation},
                             {"swing", move.swing},
                             {"hours", move.hours}});
  json["unmoved"] = separation.unmoved;
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace thermocomp::experiments
