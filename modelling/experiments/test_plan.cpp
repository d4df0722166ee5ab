#include "modelling/experiments/test_plan.hpp"

#include <algorithm>
#include <numeric>
#include <random>
#include <stdexcept>

namespace thermocomp::experiments {
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
