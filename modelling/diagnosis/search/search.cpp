#include "modelling/diagnosis/search/search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "modelling/diagnosis/evidence/left_out.hpp"
#include "modelling/diagnosis/search/shortlist.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr std::size_t shortlist_of_each = 20;
/// Explanations are as good as each other when what they leave differs by less than this share.
constexpr double tie_share = 0.1;

/// @param equations  one a setting
/// @param place  of the explanation
const Setting* likeliest_of(const std::vector<const Setting*>& settings,
                            const std::vector<EquationsTable>& equations, std::size_t place,
                            const Explanation& explanation, std::size_t output) {
  const Setting* likeliest = settings.front();
  double best = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const double taken = explanation.hypothesis->form == Form::own_gains
                             ? equations[i].taken(place, equations[i].gains(place))
                             : equations[i].taken(place, explanation.gains[output]);
    const double likelihood = settings[i]->twice_log_likelihood(settings[i]->squares() - taken);
    if (!(likelihood > best)) continue;
    best = likelihood;
    likeliest = settings[i];
  }
  return likeliest;
}

/// What adds nothing to a simpler explanation is no rival of it.
void leave_out_no_likelier_than_special_case(std::vector<Explanation>& candidates) {
  std::map<std::pair<std::string, std::string>, double> scores;
  for (const Explanation& each : candidates)
    scores[{each.hypothesis->cause, each.hypothesis->subject}] = each.score;
  std::erase_if(candidates, [&](const Explanation& each) {
    const std::optional<Named>& special = each.hypothesis->special_case;
    if (!special) return false;
    const auto simpler = scores.find({special->cause, special->subject});
    return simpler != scores.end() && simpler->second >= each.score;
  });
}

}  // namespace

Search::Search(const MeasuredData& data, const Thresholds& thresholds)
    : Search(data, thresholds, hypotheses(data, stacked_rows(data)), {}) {}

Search::Search(const MeasuredData& data, const Thresholds& thresholds,
               std::vector<Hypothesis> hypotheses, Accepted accepted)
    : data_(data),
      thresholds_(thresholds),
      rows_(stacked_rows(data)),
      groups_(place_groups(data)),
      witness_(data_, rows_),
      hypotheses_(std::move(hypotheses)),
      accepted_(std::move(accepted)) {
  readings_.resize(rows_.time_s.size(), std::ssize(data.model.inputs));
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const Block& block = rows_.runs[i];
    const Eigen::Index count = block.end - block.begin;
    for (std::size_t input = 0; input < data.runs[i].calm_inputs_K.size(); ++input)
      readings_.col(static_cast<Eigen::Index>(input)).segment(block.begin, count) =
          data.runs[i].calm_inputs_K[input].tail(count);
  }
  for (std::size_t output = 0; output < data.model.outputs.size(); ++output) {
    outputs_.emplace_back(data, rows_, output);
    if (outputs_.back().measured()) measured_.push_back(output);
  }
}

bool Search::concerns(const Hypothesis& hypothesis, std::size_t output) const {
  return outputs_[output].measured() && (!hypothesis.output || *hypothesis.output == output);
}

double Search::price(const Hypothesis& hypothesis) const {
  const double rows = static_cast<double>(rows_.time_s.size());
  double sum = 0.0;
  for (const ShapeParameter& parameter : hypothesis.shape)
    if (!parameter.discrete) sum += std::log(rows);
  if (hypothesis.form == Form::shared_gain) sum += std::log(rows);
  return sum + hypothesis.handicap;
}

bool Search::acts(const Explanation& explanation) {
  return std::any_of(explanation.gains.begin(), explanation.gains.end(),
                     [](const Eigen::VectorXd& gains) { return gains.size() > 0; });
}

/// Each explanation's noise becomes the one under which it is likeliest, gains fitted anew where
/// they are its own.
void Search::take_likeliest_settings(const std::vector<Explanation*>& explanations) const {
  for (const std::size_t output : measured_) {
    std::map<std::size_t, std::vector<Explanation*>> by_gains;
    for (Explanation* each : explanations)
      if (concerns(*each->hypothesis, output) &&
          (each->hypothesis->form == Form::own_gains || each->gains[output].size() > 0))
        by_gains[each->hypothesis->gains.size()].push_back(each);
    std::vector<const Setting*> settings;
    for (const auto& setting : outputs_[output].settings()) settings.push_back(setting.get());
    for (const auto& [gains, alike] : by_gains) {
      Panel columns;
      for (std::size_t i = 0; i < alike.size(); ++i) {
        const Panel of =
            columns_of(*alike[i]->hypothesis, Shapes{alike[i]->shape}, outputs_[output]);
        if (i == 0) columns.resize(of.rows(), of.cols() * std::ssize(alike));
        columns.middleCols(of.cols() * static_cast<Eigen::Index>(i), of.cols()) = of;
      }
      const auto equations =
          Setting::equations_of_groups(settings, columns, columns.cols() / std::ssize(alike));
      for (std::size_t i = 0; i < alike.size(); ++i)
        alike[i]->settings[output] = likeliest_of(settings, equations, i, *alike[i], output);
    }
  }
}

Search::Trial Search::refine(Explanation& explanation) const {
  const Hypothesis& hypothesis = *explanation.hypothesis;
  Trial best = weigh(hypothesis, explanation.shape, explanation.settings);
  for (std::size_t i = 0; i < hypothesis.shape.size(); ++i) {
    const ShapeParameter& parameter = hypothesis.shape[i];
    if (parameter.discrete || parameter.grid.size() < 2) continue;
    const auto value_of = [&](double x) { return parameter.logarithmic ? std::exp(x) : x; };
    const auto x_of = [&](double value) { return parameter.logarithmic ? std::log(value) : value; };
    const auto above = std::upper_bound(parameter.grid.begin(), parameter.grid.end(),
                                        explanation.shape[i] * (1.0 + 1e-12));
    const auto below =
        std::lower_bound(parameter.grid.begin(), parameter.grid.end(), explanation.shape[i]);
    double low = below == parameter.grid.begin() ? parameter.grid.front() : *(below - 1);
    double high = above == parameter.grid.end() ? parameter.grid.back() : *above;
    if (parameter.logarithmic && !(low > 0)) continue;  // no lag at all is a point of its own
    low = x_of(low);
    high = x_of(high);
    double best_x = x_of(explanation.shape[i]);
    constexpr int points = 6;
    for (int round = 0; round < 4; ++round) {
      const double step = (high - low) / (points + 1);
      Shapes shapes(points, explanation.shape);
      for (int k = 1; k <= points; ++k)
        shapes[static_cast<std::size_t>(k - 1)][i] = value_of(low + step * k);
      std::vector<Trial> trials = weigh_all(hypothesis, shapes, explanation.settings);
      const double origin = low;
      for (int k = 1; k <= points; ++k) {
        Trial& trial = trials[static_cast<std::size_t>(k - 1)];
        if (!(trial.score > best.score)) continue;
        best = std::move(trial);
        best_x = origin + step * k;
      }
      low = std::max(low, best_x - step);
      high = std::min(high, best_x + step);
    }
    explanation.shape[i] = value_of(best_x);
  }
  explanation.gains = best.gains;
  return best;
}

/// Shapes, noise and gains of explanations whose shapes are near the peak.
void Search::settle(std::vector<Explanation*> explanations) const {
  // Near the peak first: under wandering noise a jump that is a few rows off explains nothing.
  for (Explanation* each : explanations) refine(*each);
  for (int round = 0; round < 2; ++round) {
    take_likeliest_settings(explanations);
    for (Explanation* each : explanations) each->score = refine(*each).score;
    std::erase_if(explanations, [](const Explanation* each) { return !acts(*each); });
  }
  for (Explanation* each : explanations) {
    each->score -= price(*each->hypothesis);
    // The other noise has a price too: what counts is against the likeliest without the hypothesis.
    for (const std::size_t output : measured_) {
      if (each->gains[output].size() == 0) continue;
      const Setting& without = outputs_[output].setting();
      const Setting& with = *each->settings[output];
      each->score += with.twice_log_likelihood(with.squares()) -
                     without.twice_log_likelihood(without.squares());
    }
  }
}

/// Settles an explanation beside others than before, from the shape that it had. A new search over
/// the grid could lose it: under wandering noise a jump that is a few rows off explains nothing.
void Search::settle_anew(Explanation& explanation) const {
  for (const std::size_t output : measured_)
    explanation.settings[output] = outputs_[output].settings().front().get();
  explanation.gains = weigh(*explanation.hypothesis, explanation.shape, explanation.settings).gains;
  settle({&explanation});
  explanation.witness = 0.0;
}

std::vector<Explanation> Search::ranked() {
  return judged(profile(profiled_settings()));
}

/// The best few under each of the settings, settled and chosen among.
std::vector<Explanation> Search::judged(std::vector<std::vector<Explanation>> under_each) {
  std::vector<Place> places;
  for (std::vector<Explanation>& all : under_each)
    for (Place& place : shortlist(std::move(all), measured_, shortlist_of_each))
      places.push_back(std::move(place));
  std::vector<Explanation*> first;
  first.reserve(places.size());
  for (Place& place : places) first.push_back(&place.first);
  settle(std::move(first));
  std::vector<Explanation> candidates;
  for (const Place& place : places)
    for (Explanation& each : witnessed(place, measured_, witness_))
      candidates.push_back(std::move(each));
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.score > b.score; });
  std::erase_if(candidates, [](const Explanation& each) { return !acts(each); });
  choose(candidates);
  // A hypothesis may have several peaks, and under wandering noise the highest is often a quick one
  // that explains little: which of them it stands for, the rows left out have chosen too.
  std::vector<Explanation> once;
  for (Explanation& candidate : candidates) {
    const bool known = std::any_of(once.begin(), once.end(), [&](const Explanation& each) {
      return each.hypothesis == candidate.hypothesis;
    });
    if (!known) once.push_back(std::move(candidate));
  }
  leave_out_no_likelier_than_special_case(once);
  return once;
}

/// By what each leaves of rows it was not fitted to; among those that leave nearly the same, by
/// likelihood.
void Search::choose(std::vector<Explanation>& candidates) const {
  measure_left_out(candidates);
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.log_left < b.log_left; });
  if (candidates.empty()) return;
  const double least = candidates.front().log_left;
  const auto tie = std::find_if(candidates.begin(), candidates.end(), [&](const auto& each) {
    return each.log_left > least + tie_share;
  });
  std::stable_sort(candidates.begin(), tie,
                   [](const auto& a, const auto& b) { return a.score > b.score; });
}

void Search::measure_left_out(std::vector<Explanation>& candidates) const {
  LeftOut left_out(rows_, outputs_);
  for (auto each = candidates.begin(); each != candidates.end(); ++each) {
    const auto twin = std::find_if(candidates.begin(), each, [&](const Explanation& before) {
      return of_one_place(before, *each, measured_);
    });
    if (twin == each) {
      measure_left_out(*each, left_out);
    } else {
      each->left_out_gain = twin->left_out_gain;
      each->left_out_gain_of_best = twin->left_out_gain_of_best;
      each->log_left = twin->log_left;
    }
  }
}

/// The same in white noise. What a model leaves is not quite the noise of this search: where it is
/// small beside slow motion, weighing that motion down costs rows left out more than it saves.
Explanation Search::in_white_noise(const Explanation& explanation) const {
  Explanation plain = explanation;
  for (const std::size_t output : measured_)
    if (plain.gains[output].size() > 0)
      plain.settings[output] = outputs_[output].settings().front().get();
  return plain;
}

LeftOutGain Search::left_out_gain(const Explanation& explanation, LeftOut& left_out) const {
  if (explanation.hypothesis->run) return left_out.gain_on_fitted_rows(explanation);
  const LeftOutGain gain = left_out.gain_on_left_out_blocks(explanation);
  const Explanation plain = in_white_noise(explanation);
  if (plain.settings == explanation.settings) return gain;
  const LeftOutGain of_plain = left_out.gain_on_left_out_blocks(plain);
  return of_plain.log_left < gain.log_left ? of_plain : gain;
}

void Search::measure_left_out(Explanation& explanation, LeftOut& left_out) const {
  const LeftOutGain gain = left_out_gain(explanation, left_out);
  explanation.left_out_gain = thresholds_.one_unit ? gain.share_of_all : gain.share;
  explanation.left_out_gain_of_best = gain.share_of_best;
  explanation.log_left = gain.log_left;
  for (const std::size_t output : measured_)
    if (explanation.gains[output].size() == 0) explanation.log_left += log_left_without_[output];
}

}  // namespace thermocomp::diagnosis
