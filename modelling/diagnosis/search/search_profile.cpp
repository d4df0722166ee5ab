#include <algorithm>
#include <cmath>

#include "modelling/diagnosis/search/search.hpp"

namespace thermocomp::diagnosis {
namespace {

/// An output counts as acted on when its 2 ln L gains this much beyond the price of its gains.
constexpr double output_gain_min = 6.0;
/// As many as stay near the processor.
constexpr Eigen::Index columns_at_once = 32;
/// Columns of smaller factors are made for themselves.
constexpr double scale_min = 1e-6;

/// Shapes of a hypothesis whose columns lie in one panel.
struct Piece {
  std::size_t part{0};
  std::size_t first{0};  ///< of its shapes
  std::size_t count{0};
};

/// @param counts  shapes of each part
/// @return for each panel its pieces
std::vector<std::vector<Piece>> pieces_of(const std::vector<std::size_t>& counts,
                                          std::size_t shapes_at_once) {
  std::vector<std::vector<Piece>> panels;
  std::size_t free = 0;
  for (std::size_t part = 0; part < counts.size(); ++part)
    for (std::size_t first = 0; first < counts[part];) {
      if (free == 0) {
        panels.emplace_back();
        free = shapes_at_once;
      }
      const std::size_t count = std::min(free, counts[part] - first);
      panels.back().push_back({part, first, count});
      first += count;
      free -= count;
    }
  return panels;
}

std::vector<const Setting*> of_output(const std::vector<std::vector<const Setting*>>& settings,
                                      std::size_t output) {
  std::vector<const Setting*> all;
  all.reserve(settings.size());
  for (const auto& each : settings) all.push_back(each[output]);
  return all;
}

}  // namespace

std::vector<Search::Equations> Search::equations_of_each(const std::vector<Part>& parts,
                                                         std::size_t settings,
                                                         const std::vector<Weigh>& weigh) const {
  const Eigen::Index width = parts.front().hypothesis->width();
  std::vector<Equations> equations;
  std::vector<std::size_t> counts;
  for (const Part& part : parts) {
    equations.push_back(no_equations(width, part.shapes.size(), settings));
    counts.push_back(part.shapes.size());
  }
  const auto at_once = static_cast<std::size_t>(std::max<Eigen::Index>(1, columns_at_once / width));
  for (const std::size_t output : measured_) {
    if (!concerns(*parts.front().hypothesis, output)) continue;
    for (const std::vector<Piece>& pieces : pieces_of(counts, at_once)) {
      Eigen::Index groups = 0;
      for (const Piece& piece : pieces) groups += static_cast<Eigen::Index>(piece.count);
      Panel columns(rows_.time_s.size(), groups * width);
      Eigen::Index at = 0;
      for (const Piece& piece : pieces) {
        const auto first =
            parts[piece.part].shapes.begin() + static_cast<std::ptrdiff_t>(piece.first);
        const Eigen::Index count = static_cast<Eigen::Index>(piece.count) * width;
        parts[piece.part].hypothesis->write_columns(
            {first, first + static_cast<std::ptrdiff_t>(piece.count)}, output,
            columns.middleCols(at, count));
        at += count;
      }
      outputs_[output].clear_missing(columns);
      const std::vector<EquationsTable> tables = weigh[output](columns, width);
      std::size_t group = 0;
      for (const Piece& piece : pieces)
        for (std::size_t i = 0; i < piece.count; ++i, ++group)
          for (std::size_t under = 0; under < settings; ++under) {
            Equations& of = equations[piece.part];
            of.table.copy(tables[under], group, of.place(under, piece.first + i, output));
          }
    }
  }
  return equations;
}

Search::Equations Search::scaled(const Equations& equations, const Hypothesis& from,
                                 const Hypothesis& to, std::size_t settings) const {
  Equations all = equations;
  for (const std::size_t output : measured_) {
    const double times = to.scale(output) / from.scale(output);
    for (std::size_t under = 0; under < settings; ++under)
      for (std::size_t shape = 0; shape < all.shapes; ++shape) {
        const std::size_t place = all.place(under, shape, output);
        all.table.copy(equations.table, place, place, times);
      }
  }
  return all;
}

std::vector<Search::Trial> Search::weigh_all(const Hypothesis& hypothesis, const Shapes& shapes,
                                             const Settings& settings) const {
  std::vector<Weigh> weigh(outputs_.size());
  for (const std::size_t output : measured_)
    weigh[output] = [of = settings[output]](const Panel& columns, Eigen::Index width) {
      return Setting::equations_of_groups({of}, columns, width);
    };
  const Equations equations =
      std::move(equations_of_each({{&hypothesis, shapes}}, 1, weigh).front());
  std::vector<Trial> trials(shapes.size());
  for (std::size_t shape = 0; shape < shapes.size(); ++shape)
    trials[shape].score = score_of(hypothesis, equations, 0, shape, settings, &trials[shape].gains);
  return trials;
}

Search::Trial Search::weigh(const Hypothesis& hypothesis, const std::vector<double>& shape,
                            const Settings& settings) const {
  return weigh_all(hypothesis, {shape}, settings).front();
}

double Search::shared_gain(const Equations& equations, std::size_t under, std::size_t shape,
                           const Hypothesis& hypothesis, const Settings& settings) const {
  double square = 0.0;
  double right = 0.0;
  for (const std::size_t output : measured_) {
    if (!concerns(hypothesis, output)) continue;
    const std::size_t place = equations.place(under, shape, output);
    const double variance = settings[output]->squares();
    square += equations.table.square(place)(0, 0) / variance;
    right += equations.table.right(place)[0] / variance;
  }
  return square > 0 ? right / square : 0.0;
}

double Search::score_of(const Hypothesis& hypothesis, const Equations& equations, std::size_t under,
                        std::size_t shape, const Settings& settings,
                        std::vector<Eigen::VectorXd>* gains) const {
  if (gains != nullptr) gains->assign(outputs_.size(), Eigen::VectorXd());
  double score = 0.0;
  double single = 1.0;  // gain of a single column
  if (hypothesis.form == Form::shared_gain) {
    single = shared_gain(equations, under, shape, hypothesis, settings);
    if (hypothesis.possible && !hypothesis.possible(single, 0)) return score;
  }
  const EquationsTable& table = equations.table;
  for (const std::size_t output : measured_) {
    if (!concerns(hypothesis, output)) continue;
    const std::size_t place = equations.place(under, shape, output);
    Eigen::VectorXd several;
    double taken = 0.0;
    if (table.width() > 1) {
      several = table.gains(place);
      if (!several.allFinite()) continue;
      single = several[0];
      taken = table.taken(place, several);
    } else {
      const double square = table.square(place)(0, 0);
      const double right = table.right(place)[0];
      if (hypothesis.form == Form::own_gains) single = square > 0 ? right / square : 0.0;
      taken = single * (2.0 * right - square * single);
    }
    double gain = settings[output]->gain(taken);
    if (hypothesis.form == Form::own_gains) {
      if (!std::isfinite(single)) continue;
      if (hypothesis.possible && !hypothesis.possible(single, output)) continue;
      gain -= static_cast<double>(table.width()) * std::log(settings[output]->present_rows());
      if (gain < output_gain_min) continue;
    }
    score += gain;
    if (gains == nullptr) continue;
    (*gains)[output] = table.width() > 1 ? several : Eigen::VectorXd::Constant(1, single);
  }
  return score;
}

void Search::add_best_of_grid(const Hypothesis& hypothesis, const Equations& equations,
                              const std::vector<Settings>& settings,
                              std::vector<std::vector<Explanation>>& under_each) const {
  const double cost = price(hypothesis);
  for (std::size_t under = 0; under < settings.size(); ++under) {
    double best = 0.0;
    std::size_t at = 0;
    for (std::size_t shape = 0; shape < equations.shapes; ++shape) {
      const double score = score_of(hypothesis, equations, under, shape, settings[under], nullptr);
      if (!(score > best)) continue;
      best = score;
      at = shape;
    }
    if (!(best - cost > 0)) continue;
    Explanation explanation{
        &hypothesis, point_of_grid(hypothesis, at), {}, best - cost, settings[under]};
    static_cast<void>(
        score_of(hypothesis, equations, under, at, settings[under], &explanation.gains));
    under_each[under].push_back(std::move(explanation));
  }
}

/// What follows from columns that many hypotheses share is weighed with these; of the others those
/// of one width and output many at once.
std::vector<std::vector<Explanation>> Search::profile(const std::vector<Settings>& settings) const {
  std::vector<std::vector<Explanation>> under_each(settings.size());
  std::vector<SettingsTogether> together(outputs_.size());
  std::vector<Weigh> weigh(outputs_.size());
  for (const std::size_t output : measured_) {
    together[output] = SettingsTogether(of_output(settings, output));
    weigh[output] = [&together, output](const Panel& columns, Eigen::Index width) {
      return together[output].equations(columns, width);
    };
  }
  Group of_readings;
  std::map<std::pair<std::string, std::size_t>, Group> from_onset;
  std::map<std::pair<Eigen::Index, std::optional<std::size_t>>, std::vector<Part>> alike;
  std::map<std::string, Group> of_pattern;
  for (const Hypothesis& hypothesis : hypotheses_) {
    if (hypothesis.of_readings) {
      of_readings.push_back(&hypothesis);
      continue;
    }
    if (hypothesis.from_onset) {
      from_onset[{hypothesis.cause, *hypothesis.run}].push_back(&hypothesis);
      continue;
    }
    if (shares_columns(hypothesis)) {
      Group& group = of_pattern[hypothesis.pattern];
      group.push_back(&hypothesis);
      if (group.size() > 1) continue;
    }
    alike[{hypothesis.width(), hypothesis.output}].push_back({&hypothesis, grid_of(hypothesis)});
  }
  for (const auto& [key, parts] : alike) {
    const std::vector<Equations> equations = equations_of_each(parts, settings.size(), weigh);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Hypothesis& first = *parts[i].hypothesis;
      add_best_of_grid(first, equations[i], settings, under_each);
      if (!shares_columns(first)) continue;
      for (const Hypothesis* other : of_pattern[first.pattern])
        if (other != &first)
          add_best_of_grid(*other, scaled(equations[i], first, *other, settings.size()), settings,
                           under_each);
    }
  }
  const auto add_all = [&](const Group& group, const std::vector<Equations>& equations) {
    for (std::size_t i = 0; i < group.size(); ++i)
      add_best_of_grid(*group[i], equations[i], settings, under_each);
  };
  add_all(of_readings, equations_of_readings(of_readings, settings));
  for (const auto& [key, group] : from_onset)
    add_all(group, equations_from_onset(group, settings.size(), together));
  return under_each;
}

bool Search::shares_columns(const Hypothesis& hypothesis) const {
  return !hypothesis.pattern.empty() &&
         std::all_of(measured_.begin(), measured_.end(), [&](std::size_t output) {
           return std::abs(hypothesis.scale(output)) > scale_min;
         });
}

std::vector<Search::Equations> Search::equations_of_readings(
    const Group& hypotheses, const std::vector<Settings>& settings) const {
  std::vector<Equations> equations(hypotheses.size(), no_equations(1, 1, settings.size()));
  if (hypotheses.empty()) return equations;
  for (const std::size_t output : measured_) {
    const auto all =
        Setting::equations_of_groups(of_output(settings, output), readings_, readings_.cols());
    for (std::size_t i = 0; i < hypotheses.size(); ++i) {
      const std::vector<ReadingShare> shares = hypotheses[i]->of_readings(output);
      for (std::size_t under = 0; under < settings.size(); ++under) {
        const auto of_square = all[under].square(0);
        const auto of_right = all[under].right(0);
        double square = 0.0;
        double right = 0.0;
        for (const ReadingShare& a : shares) {
          const auto row = static_cast<Eigen::Index>(a.input);
          right += a.weight * of_right[row];
          for (const ReadingShare& b : shares)
            square += a.weight * b.weight * of_square(row, static_cast<Eigen::Index>(b.input));
        }
        const std::size_t place = equations[i].place(under, 0, output);
        equations[i].table.square(place)(0, 0) = square;
        equations[i].table.right(place)[0] = right;
      }
    }
  }
  return equations;
}

std::vector<Search::Equations> Search::equations_from_onset(
    const Group& hypotheses, std::size_t settings,
    const std::vector<SettingsTogether>& together) const {
  const std::vector<double>& onsets_s = hypotheses.front()->shape.front().grid;
  std::vector<Equations> equations(hypotheses.size(), no_equations(1, onsets_s.size(), settings));
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
    const auto all = together[output].equations_from_rows(whole, first_rows);
    for (std::size_t i = 0; i < hypotheses.size(); ++i)
      for (std::size_t under = 0; under < settings; ++under)
        for (std::size_t onset = 0; onset < onsets_s.size(); ++onset)
          equations[i].table.copy(all[under], onset * hypotheses.size() + i,
                                  equations[i].place(under, onset, output));
  }
  return equations;
}

Search::Equations Search::no_equations(Eigen::Index width, std::size_t shapes,
                                       std::size_t settings) const {
  return {EquationsTable(settings * shapes * outputs_.size(), width), shapes, outputs_.size()};
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
