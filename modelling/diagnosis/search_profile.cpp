#include <algorithm>
#include <cmath>

#include "modelling/diagnosis/search.hpp"

namespace thermocomp::diagnosis {
namespace {

/// An output counts as acted on when its 2 ln L gains this much beyond the price of its gains.
constexpr double output_gain_min = 6.0;
constexpr std::size_t shapes_at_once = 16;
/// Columns of smaller factors are made for themselves.
constexpr double scale_min = 1e-6;

/// Columns of each shape of each hypothesis; all hypotheses have as many.
Panel side_by_side(const std::vector<const Hypothesis*>& hypotheses, const Shapes& shapes,
                   const OutputEvidence& evidence) {
  if (hypotheses.size() == 1) return columns_of(*hypotheses.front(), shapes, evidence);
  Panel all;
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    const Panel columns = columns_of(*hypotheses[i], shapes, evidence);
    if (i == 0) all.resize(columns.rows(), columns.cols() * std::ssize(hypotheses));
    all.middleCols(columns.cols() * static_cast<Eigen::Index>(i), columns.cols()) = columns;
  }
  return all;
}

std::vector<const Setting*> of_output(const std::vector<std::vector<const Setting*>>& settings,
                                      std::size_t output) {
  std::vector<const Setting*> all;
  all.reserve(settings.size());
  for (const auto& each : settings) all.push_back(each[output]);
  return all;
}

}  // namespace

Search::Equations Search::equations_under_each(const Hypothesis& hypothesis, const Shapes& shapes,
                                               const std::vector<Settings>& settings) const {
  return std::move(equations_of_each({&hypothesis}, shapes, settings).front());
}

std::vector<Search::Equations> Search::equations_of_each(
    const Group& hypotheses, const Shapes& shapes, const std::vector<Settings>& settings) const {
  std::vector<Equations> equations =
      no_equations(hypotheses.size(), shapes.size(), settings.size());
  for (std::size_t first = 0; first < shapes.size(); first += shapes_at_once) {
    const Shapes some(shapes.begin() + static_cast<std::ptrdiff_t>(first),
                      shapes.begin() + static_cast<std::ptrdiff_t>(
                                           std::min(first + shapes_at_once, shapes.size())));
    for (const std::size_t output : measured_) {
      if (!concerns(*hypotheses.front(), output)) continue;
      const Panel columns = side_by_side(hypotheses, some, outputs_[output]);
      const std::size_t groups = some.size() * hypotheses.size();
      const Eigen::Index width = columns.cols() / static_cast<Eigen::Index>(groups);
      auto all = Setting::equations_of_groups(of_output(settings, output), columns, width);
      for (std::size_t under = 0; under < settings.size(); ++under)
        for (std::size_t i = 0; i < groups; ++i)
          equations[i / some.size()][under][first + i % some.size()][output] =
              std::move(all[under][i]);
    }
  }
  return equations;
}

Search::Equations Search::equations_of_grid(const Hypothesis& hypothesis, const Shapes& grid,
                                            const std::vector<Settings>& settings,
                                            Patterns& patterns) const {
  const auto scaled = [&](Equations equations, bool inverse) {
    for (auto& of_setting : equations)
      for (auto& of_shape : of_setting)
        for (const std::size_t output : measured_) {
          const double scale = hypothesis.scale(output);
          const double factor = inverse ? 1.0 / scale : scale;
          of_shape[output].square *= factor * factor;
          of_shape[output].right *= factor;
        }
    return equations;
  };
  const bool shares = !hypothesis.pattern.empty() &&
                      std::all_of(measured_.begin(), measured_.end(), [&](std::size_t output) {
                        return std::abs(hypothesis.scale(output)) > scale_min;
                      });
  if (!shares) return equations_under_each(hypothesis, grid, settings);
  const auto known = patterns.find(hypothesis.pattern);
  if (known != patterns.end()) return scaled(known->second, false);
  Equations equations = equations_under_each(hypothesis, grid, settings);
  patterns.emplace(hypothesis.pattern, scaled(equations, true));
  return equations;
}

std::vector<Search::Trial> Search::weigh_all(const Hypothesis& hypothesis, const Shapes& shapes,
                                             const Settings& settings) const {
  const Equations equations = equations_under_each(hypothesis, shapes, {settings});
  std::vector<Trial> trials;
  for (const auto& of_shape : equations.front())
    trials.push_back(trial_of(hypothesis, of_shape, settings));
  return trials;
}

Search::Trial Search::weigh(const Hypothesis& hypothesis, const std::vector<double>& shape,
                            const Settings& settings) const {
  return weigh_all(hypothesis, {shape}, settings).front();
}

Search::Trial Search::trial_of(const Hypothesis& hypothesis,
                               const std::vector<Setting::Equations>& equations,
                               const Settings& settings) const {
  Trial trial;
  trial.gains.resize(outputs_.size());
  double square = 0.0;
  double right = 0.0;
  for (const std::size_t output : measured_) {
    if (equations[output].right.size() == 0) continue;
    const double variance = settings[output]->squares();
    square += equations[output].square(0, 0) / variance;
    right += equations[output].right[0] / variance;
  }
  const double shared = square > 0 ? right / square : 0.0;
  if (hypothesis.form == Form::shared_gain && hypothesis.possible &&
      !hypothesis.possible(shared, 0))
    return trial;
  for (const std::size_t output : measured_) {
    const Setting::Equations& of = equations[output];
    if (of.right.size() == 0) continue;
    Eigen::VectorXd gains = Eigen::VectorXd::Ones(1);
    double gain_price = 0.0;
    if (hypothesis.form == Form::own_gains) {
      gains = of.gains();
      if (!gains.allFinite()) continue;
      if (hypothesis.possible && !hypothesis.possible(gains[0], output)) continue;
      gain_price = static_cast<double>(gains.size()) * std::log(settings[output]->present_rows());
    } else if (hypothesis.form == Form::shared_gain) {
      gains *= shared;
    }
    const double squares =
        settings[output]->squares() - 2.0 * gains.dot(of.right) + gains.dot(of.square * gains);
    const double gain = settings[output]->twice_log_likelihood(squares) -
                        settings[output]->twice_log_likelihood(settings[output]->squares()) -
                        gain_price;
    if (hypothesis.form == Form::own_gains && gain < output_gain_min) continue;
    trial.score += gain;
    trial.gains[output] = gains;
  }
  return trial;
}

std::vector<Explanation> Search::best_of_grid(const Hypothesis& hypothesis, const Shapes& grid,
                                              const Equations& equations,
                                              const std::vector<Settings>& settings) const {
  std::vector<Explanation> bests;
  for (std::size_t under = 0; under < settings.size(); ++under) {
    Explanation best{&hypothesis, grid.front(),    std::vector<Eigen::VectorXd>(outputs_.size()),
                     0.0,         settings[under], 0.0,
                     0.0};
    for (std::size_t i = 0; i < grid.size(); ++i) {
      Trial trial = trial_of(hypothesis, equations[under][i], settings[under]);
      if (!(trial.score > best.score)) continue;
      best.score = trial.score;
      best.shape = grid[i];
      best.gains = std::move(trial.gains);
    }
    best.score -= price(hypothesis);
    bests.push_back(std::move(best));
  }
  return bests;
}

/// What follows from columns that many hypotheses share is weighed with these; of the others those
/// with one shape many at once, the rest one grid after another.
std::vector<std::vector<Explanation>> Search::profile(const std::vector<Settings>& settings) const {
  std::vector<std::vector<Explanation>> under_each(settings.size());
  const auto keep = [&](const Hypothesis& hypothesis, const Shapes& grid,
                        const Equations& equations) {
    std::vector<Explanation> bests = best_of_grid(hypothesis, grid, equations, settings);
    for (std::size_t under = 0; under < settings.size(); ++under)
      if (bests[under].score > 0) under_each[under].push_back(std::move(bests[under]));
  };
  Group of_readings;
  std::map<std::pair<std::string, std::size_t>, Group> from_onset;
  std::map<std::pair<std::size_t, std::optional<std::size_t>>, Group> lone;
  Patterns patterns;
  for (const Hypothesis& hypothesis : hypotheses_) {
    if (hypothesis.of_readings)
      of_readings.push_back(&hypothesis);
    else if (hypothesis.from_onset)
      from_onset[{hypothesis.cause, *hypothesis.run}].push_back(&hypothesis);
    else if (hypothesis.shape.empty())
      lone[{hypothesis.gains.size(), hypothesis.output}].push_back(&hypothesis);
    else
      keep(hypothesis, grid_of(hypothesis),
           equations_of_grid(hypothesis, grid_of(hypothesis), settings, patterns));
  }
  const auto keep_all = [&](const Group& group, const Shapes& grid,
                            const std::vector<Equations>& equations) {
    for (std::size_t i = 0; i < group.size(); ++i) keep(*group[i], grid, equations[i]);
  };
  keep_all(of_readings, {{}}, equations_of_readings(of_readings, settings));
  for (const auto& [alike, group] : from_onset)
    keep_all(group, grid_of(*group.front()), equations_from_onset(group, settings));
  for (const auto& [alike, group] : lone)
    for (std::size_t first = 0; first < group.size(); first += shapes_at_once) {
      const Group some(group.begin() + static_cast<std::ptrdiff_t>(first),
                       group.begin() + static_cast<std::ptrdiff_t>(
                                           std::min(first + shapes_at_once, group.size())));
      keep_all(some, {{}}, equations_of_each(some, {{}}, settings));
    }
  return under_each;
}

std::vector<Search::Equations> Search::equations_of_readings(
    const Group& hypotheses, const std::vector<Settings>& settings) const {
  std::vector<Equations> equations = no_equations(hypotheses.size(), 1, settings.size());
  if (hypotheses.empty()) return equations;
  for (const std::size_t output : measured_) {
    const auto all =
        Setting::equations_of_groups(of_output(settings, output), readings_, readings_.cols());
    for (std::size_t i = 0; i < hypotheses.size(); ++i) {
      const std::vector<ReadingShare> shares = hypotheses[i]->of_readings(output);
      for (std::size_t under = 0; under < settings.size(); ++under) {
        const Setting::Equations& of = all[under].front();
        double square = 0.0;
        double right = 0.0;
        for (const ReadingShare& a : shares) {
          const auto row = static_cast<Eigen::Index>(a.input);
          right += a.weight * of.right[row];
          for (const ReadingShare& b : shares)
            square += a.weight * b.weight * of.square(row, static_cast<Eigen::Index>(b.input));
        }
        equations[i][under].front()[output] = {Eigen::MatrixXd::Constant(1, 1, square),
                                               Eigen::VectorXd::Constant(1, right)};
      }
    }
  }
  return equations;
}

std::vector<Search::Equations> Search::equations_from_onset(
    const Group& hypotheses, const std::vector<Settings>& settings) const {
  const std::vector<double>& onsets_s = hypotheses.front()->shape.front().grid;
  std::vector<Equations> equations =
      no_equations(hypotheses.size(), onsets_s.size(), settings.size());
  const Block& run = rows_.runs[*hypotheses.front()->run];
  const double* const time_s = rows_.time_s.data();
  std::vector<Eigen::Index> first_rows;
  first_rows.reserve(onsets_s.size());
  for (const double onset_s : onsets_s)
    first_rows.push_back(std::lower_bound(time_s + run.begin, time_s + run.end, onset_s) - time_s);
  Panel whole(rows_.time_s.size(), std::ssize(hypotheses));
  for (const std::size_t output : measured_) {
    for (std::size_t i = 0; i < hypotheses.size(); ++i)
      whole.col(static_cast<Eigen::Index>(i)) = hypotheses[i]->from_onset(output);
    auto all = Setting::equations_from_rows(of_output(settings, output), whole, first_rows);
    for (std::size_t i = 0; i < hypotheses.size(); ++i)
      for (std::size_t under = 0; under < settings.size(); ++under)
        for (std::size_t onset = 0; onset < onsets_s.size(); ++onset)
          equations[i][under][onset][output] = std::move(all[under][onset][i]);
  }
  return equations;
}

std::vector<Search::Equations> Search::no_equations(std::size_t hypotheses, std::size_t shapes,
                                                    std::size_t settings) const {
  using OfShapes = Equations::value_type;
  return std::vector<Equations>(
      hypotheses, Equations(settings, OfShapes(shapes, OfShapes::value_type(outputs_.size()))));
}

/// The likeliest noise without any hypothesis, and white noise where that is another.
std::vector<Search::Settings> Search::profiled_settings() const {
  Settings likeliest(outputs_.size(), nullptr);
  Settings plain(outputs_.size(), nullptr);
  for (const std::size_t output : measured_) {
    likeliest[output] = &outputs_[output].setting();
    plain[output] = outputs_[output].settings().front().get();
  }
  std::vector<Settings> settings = {likeliest};
  if (plain != likeliest) settings.push_back(plain);
  return settings;
}

}  // namespace thermocomp::diagnosis
