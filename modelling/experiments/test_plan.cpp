#include "modelling/experiments/test_plan.hpp"

#include <algorithm>
#include <numeric>
#include <random>
#include <set>
#include <stdexcept>

#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp::experiments {
namespace {

constexpr std::size_t factors_max = 100;
constexpr std::size_t levels_max = 30;
constexpr double rows_max = 100'000;

std::vector<std::string> read_levels(const TomlTable& table) {
  std::vector<std::string> levels;
  if (table.is_list_of_numbers("levels")) {
    for (const double level : table.numbers("levels")) levels.push_back(number_text(level));
  } else {
    levels = table.texts("levels");
  }
  if (levels.size() < 2 || levels.size() > levels_max)
    table.problem("levels", "must be 2 to " + std::to_string(levels_max) + " levels");
  std::set<std::string> seen;
  for (const std::string& level : levels)
    if (!seen.insert(level).second) table.problem("levels", level, "occurs twice");
  return levels;
}

void read_factors(const TomlTable& root, FactorsSpec& spec) {
  std::set<std::string> names;
  for (const TomlTable& table : root.tables_required("factor")) {
    Factor& factor = spec.factors.emplace_back();
    factor.name = table.text("name");
    if (!factor.name.empty() && !names.insert(factor.name).second)
      table.problem("name", "is used twice");
    factor.levels = read_levels(table);
  }
  if (spec.factors.size() < 2) root.problem("factor", "must be at least two");
  if (spec.factors.size() > factors_max)
    root.problem("factor", "must be at most " + std::to_string(factors_max));
}

/// `when = { spindle_rpm = 5000, coolant = "off" }`
Forbidden read_forbidden(const TomlTable& table, const std::vector<Factor>& factors) {
  const TomlTable when = table.table("when");
  Forbidden picks;
  for (const std::string& key : when.keys()) {
    const std::string level = when.is_text(key) ? when.text(key) : number_text(when.number(key));
    const auto factor = std::find_if(factors.begin(), factors.end(),
                                     [&](const Factor& each) { return each.name == key; });
    if (factor == factors.end()) {
      when.problem(key, "must be the name of a factor");
      continue;
    }
    const auto found = std::find(factor->levels.begin(), factor->levels.end(), level);
    if (found == factor->levels.end()) {
      when.problem(key, "must be one of the factor's levels");
      continue;
    }
    picks.push_back({static_cast<std::size_t>(factor - factors.begin()),
                     static_cast<int>(found - factor->levels.begin())});
  }
  if (when && picks.empty()) table.problem("when", "must name levels of factors");
  return picks;
}

std::vector<std::string> read_columns(const TomlTable& table, std::string_view key,
                                      bool (*fits)(std::string_view), std::string_view rule,
                                      std::vector<std::string> otherwise) {
  std::vector<std::string> names = table.texts(key, std::move(otherwise));
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (!is_column_name(name)) table.problem(key, name, column_name_rule);
    if (!fits(name)) table.problem(key, name, rule);
    if (!seen.insert(name).second) table.problem(key, name, "occurs twice");
  }
  return names;
}

/// A factor named cutting applies to each test, [test] cutting to all of them.
void read_cutting(const TomlTable& table, const std::vector<Factor>& factors, TestSpec& test) {
  const auto factor = std::find_if(factors.begin(), factors.end(),
                                   [](const Factor& each) { return each.name == "cutting"; });
  if (factor == factors.end()) {
    test.cutting = table.choice<Cutting>(
        "cutting", {{"actual", Cutting::actual}, {"simulated", Cutting::simulated}},
        Cutting::actual);
    return;
  }
  table.refuse("cutting", "must be omitted if a factor is named cutting");
  test.cutting_factor = static_cast<std::size_t>(factor - factors.begin());
  for (const std::string& level : factor->levels)
    if (level != "actual" && level != "simulated")
      table.problem("cutting", level, "the factor cutting has the levels actual and simulated");
}

/// A factor named rough_cuts applies to each test, [test] rough_cuts to all of them.
void read_rough_cuts(const TomlTable& table, const std::vector<Factor>& factors, TestSpec& test) {
  test.rough_cuts = table.integer<int>("rough_cuts", 0, 1000, test.rough_cuts);
  const auto factor = std::find_if(factors.begin(), factors.end(),
                                   [](const Factor& each) { return each.name == "rough_cuts"; });
  if (factor == factors.end()) return;
  table.refuse("rough_cuts", "must be omitted if a factor is named rough_cuts");
  test.rough_cuts_factor = static_cast<std::size_t>(factor - factors.begin());
}

void read_test(const TomlTable& table, TestSpec& test) {
  test.hours = table.number("hours", Range::above(0, 1000), test.hours);
  test.row_every_min = table.number("row_every_min", Range::above(0, 1440), test.row_every_min);
  if (!(test.hours * 60.0 / test.row_every_min <= rows_max))
    table.problem("row_every_min", "must give at most 100000 rows");
  test.temperatures = read_columns(table, "temperatures", is_temperature,
                                   "must be a temperature (*_degC)", {"t1_degC"});
  test.outputs = read_columns(table, "outputs", is_output,
                              "must be a displacement (*_um) or a tilt (*_urad)", {"z_um"});
  double running_until_h = 0.0;
  for (const TomlTable& each : table.tables("stop")) {
    const Stop stop{each.number("after_h", Range::above(0)),
                    each.number("pause_min", Range::above(0, 1440))};
    if (!(stop.after_h >= running_until_h))
      each.problem("after_h", "must not be before the stop above has ended");
    running_until_h = stop.after_h + stop.pause_min / 60.0;
    if (!(running_until_h <= test.hours)) each.problem("after_h", "must end within the test");
    test.stops.push_back(stop);
  }
  // Stops of JP7689460B2, as far as the test is long enough.
  if (!table.has("stop"))
    for (const Stop& stop : {Stop{1, 10}, Stop{3, 60}, Stop{5, 20}})
      if (stop.after_h + stop.pause_min / 60.0 <= test.hours) test.stops.push_back(stop);
}

FactorsSpec read(const TomlDocument& document) {
  const TomlTable root = document.root();
  FactorsSpec spec;
  spec.method = root.choice<Method>("method",
                                    {{"auto", Method::automatic},
                                     {"orthogonal", Method::orthogonal},
                                     {"all_pairs", Method::all_pairs}},
                                    Method::automatic);
  spec.array = root.text("array", "");
  const auto& names = array_names();
  if (!spec.array.empty() && std::find(names.begin(), names.end(), spec.array) == names.end())
    root.problem("array", "must be L4, L8, L9, L12, L16, L18 or L27");
  spec.seed = root.integer<std::uint64_t>("seed", 0, 1'000'000'000, 1);
  read_factors(root, spec);
  for (const TomlTable& table : root.tables("forbidden"))
    spec.forbidden.push_back(read_forbidden(table, spec.factors));
  if (!spec.forbidden.empty() && (spec.method == Method::orthogonal || !spec.array.empty()))
    root.problem("forbidden",
                 "an orthogonal array cannot exclude combinations; use method = \"all_pairs\"");
  if (spec.method == Method::all_pairs && !spec.array.empty())
    root.problem("array", "must be omitted with method = \"all_pairs\"");
  const TomlTable test = root.table_or_empty("test");
  read_test(test, spec.test);
  read_cutting(test, spec.factors, spec.test);
  read_rough_cuts(test, spec.factors, spec.test);
  document.finish();
  return spec;
}

}  // namespace

std::vector<int> FactorsSpec::level_counts() const {
  std::vector<int> counts;
  for (const Factor& factor : factors) counts.push_back(static_cast<int>(factor.levels.size()));
  return counts;
}

FactorsSpec load_factors(const std::filesystem::path& path) {
  return read(TomlDocument::from_file(path));
}

FactorsSpec parse_factors(const std::string& text, const std::string& name) {
  return read(TomlDocument::from_text(text, name));
}

namespace {

struct Choice {
  FittedArray fitted;
  bool found{false};
};

/// The smallest array; among equal sizes the variant with the fewest unused columns.
Choice choose_array(const std::vector<std::string>& names, const std::vector<int>& level_counts,
                    bool dummy_allowed) {
  Choice best;
  std::size_t columns = 0;
  for (const std::string& name : names) {
    for (const Design& variant : array_variants(name)) {
      FittedArray fitted = fit_to(variant, level_counts);
      if (fitted.design.rows.empty() || (fitted.dummy_levels && !dummy_allowed)) continue;
      const bool better = !best.found || (best.fitted.dummy_levels && !fitted.dummy_levels) ||
                          (best.fitted.dummy_levels == fitted.dummy_levels &&
                           variant.level_counts.size() < columns);
      if (!better) continue;
      best = {std::move(fitted), true};
      columns = variant.level_counts.size();
    }
    if (best.found) return best;
  }
  return best;
}

bool levels_balanced(const Design& design) {
  for (std::size_t factor = 0; factor < design.level_counts.size(); ++factor) {
    std::vector<std::size_t> seen(static_cast<std::size_t>(design.level_counts[factor]), 0);
    for (const auto& row : design.rows) ++seen[static_cast<std::size_t>(row[factor])];
    if (std::any_of(seen.begin(), seen.end(), [&](std::size_t count) { return count != seen[0]; }))
      return false;
  }
  return true;
}

std::vector<std::size_t> drawn_order(std::size_t count, std::uint64_t seed) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937_64 engine(seed);
  for (std::size_t i = count; i > 1; --i)
    std::swap(order[i - 1], order[static_cast<std::size_t>(engine() % i)]);
  return order;
}

}  // namespace

TestPlan make_plan(const FactorsSpec& spec) {
  TestPlan plan;
  plan.spec = spec;
  const std::vector<int> counts = spec.level_counts();
  const Constraints constraints(counts, spec.forbidden);
  const bool array_wanted = spec.method == Method::orthogonal || !spec.array.empty();
  if (array_wanted || (spec.method == Method::automatic && spec.forbidden.empty())) {
    const std::vector<std::string> names =
        spec.array.empty() ? array_names() : std::vector<std::string>{spec.array};
    Choice choice = choose_array(names, counts, false);
    if (!choice.found && array_wanted) choice = choose_array(names, counts, true);
    if (!choice.found && array_wanted)
      throw std::runtime_error(
          "no orthogonal array of this list holds these factors; method = \"all_pairs\" does");
    plan.design = choice.fitted.design;
    plan.dummy_levels = choice.fitted.dummy_levels;
  }
  if (plan.design.rows.empty()) plan.design = all_pairs(constraints, spec.seed);
  for (const auto& row : plan.design.rows)
    if (!constraints.kept_by(row))
      throw std::logic_error("the plan contains a forbidden combination");
  plan.strength = strength_of(plan.design);
  plan.levels_balanced = levels_balanced(plan.design);
  plan.pairs = count_pairs(plan.design, constraints);
  plan.order = drawn_order(plan.design.rows.size(), spec.seed);
  return plan;
}

}  // namespace thermocomp::experiments
