#include "modelling/experiments/designs.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <random>
#include <stdexcept>

namespace thermocomp::experiments {
namespace {

/// "L16 (4^1 2^12)"
std::string described(std::string_view name, const std::vector<int>& level_counts) {
  std::map<int, int, std::greater<>> columns;
  for (const int count : level_counts) ++columns[count];
  std::string text(name);
  text.append(" (");
  bool first = true;
  for (const auto& [levels, count] : columns) {
    if (!first) text.append(" ");
    first = false;
    text.append(std::to_string(levels)).append("^").append(std::to_string(count));
  }
  return text.append(")");
}

/// GF(2)^bits: a run is a vector, a column a linear form. `lines` {a, b, a+b} become four-level
/// columns, all other forms two-level columns.
Design binary_array(std::string_view name, unsigned bits,
                    const std::vector<std::array<unsigned, 2>>& lines) {
  const unsigned runs = 1u << bits;
  const auto value = [](unsigned form, unsigned run) {
    return static_cast<int>(std::popcount(form & run) & 1);
  };
  std::vector<bool> used(runs, false);
  Design design;
  design.rows.resize(runs);
  for (const auto& [a, b] : lines) {
    used[a] = used[b] = used[a ^ b] = true;
    design.level_counts.push_back(4);
    for (unsigned run = 0; run < runs; ++run)
      design.rows[run].push_back(2 * value(a, run) + value(b, run));
  }
  for (unsigned form = 1; form < runs; ++form) {
    if (used[form]) continue;
    design.level_counts.push_back(2);
    for (unsigned run = 0; run < runs; ++run) design.rows[run].push_back(value(form, run));
  }
  design.name = described(name, design.level_counts);
  return design;
}

/// GF(3)^digits: columns are the linear forms whose first nonzero coefficient is 1.
Design ternary_array(std::string_view name, int digits) {
  int runs = 1;
  for (int i = 0; i < digits; ++i) runs *= 3;
  Design design;
  design.rows.resize(static_cast<std::size_t>(runs));
  const auto digit = [](int number, int place) {
    for (; place > 0; --place) number /= 3;
    return number % 3;
  };
  for (int form = 1; form < runs; ++form) {
    int highest = digits - 1;
    while (digit(form, highest) == 0) --highest;
    if (digit(form, highest) != 1) continue;
    design.level_counts.push_back(3);
    for (int run = 0; run < runs; ++run) {
      int sum = 0;
      for (int place = 0; place < digits; ++place) sum += digit(form, place) * digit(run, place);
      design.rows[static_cast<std::size_t>(run)].push_back(sum % 3);
    }
  }
  design.name = described(name, design.level_counts);
  return design;
}

/// Plackett and Burman: one row shifted cyclically, and a row of zeros.
Design plackett_burman_12() {
  constexpr std::array<int, 11> generator{1, 1, 0, 1, 1, 1, 0, 0, 0, 1, 0};
  Design design;
  design.level_counts.assign(11, 2);
  for (std::size_t shift = 0; shift < 11; ++shift) {
    std::vector<int> row;
    for (std::size_t column = 0; column < 11; ++column)
      row.push_back(generator[(column + 11 - shift) % 11]);
    design.rows.push_back(row);
  }
  design.rows.emplace_back(11, 0);
  design.name = described("L12", design.level_counts);
  return design;
}

/// Difference matrix: the differences mod 3 of any two columns contain each of 0, 1, 2 twice. Its
/// rows developed mod 3, with the row number as a column of six levels or of 2 times 3.
Design difference_array_18(bool six_levels) {
  constexpr std::array<std::array<int, 6>, 6> matrix{{{0, 0, 0, 0, 0, 0},
                                                      {0, 0, 1, 1, 2, 2},
                                                      {0, 1, 0, 2, 1, 2},
                                                      {0, 1, 2, 0, 2, 1},
                                                      {0, 2, 1, 2, 0, 1},
                                                      {0, 2, 2, 1, 1, 0}}};
  Design design;
  design.level_counts = six_levels ? std::vector<int>{6} : std::vector<int>{2, 3};
  design.level_counts.insert(design.level_counts.end(), 6, 3);
  for (int i = 0; i < 6; ++i) {
    for (int shift = 0; shift < 3; ++shift) {
      std::vector<int> row = six_levels ? std::vector<int>{i} : std::vector<int>{i / 3, i % 3};
      for (const auto& column : matrix)
        row.push_back((column[static_cast<std::size_t>(i)] + shift) % 3);
      design.rows.push_back(row);
    }
  }
  design.name = described("L18", design.level_counts);
  return design;
}

/// Five lines without a common form fill GF(2)^4: the powers of a generator of GF(16), 5 apart.
std::vector<std::array<unsigned, 2>> lines_of_16(unsigned count) {
  std::array<unsigned, 15> power{};
  unsigned element = 1;
  for (unsigned& each : power) {
    each = element;
    element <<= 1;
    if ((element & 16u) != 0) element ^= 0b10011u;  // x^4 + x + 1
  }
  std::vector<std::array<unsigned, 2>> lines;
  for (unsigned i = 0; i < count; ++i) lines.push_back({power[i], power[i + 5]});
  return lines;
}

bool balanced(const Design& design, const std::vector<std::size_t>& columns) {
  std::size_t combinations = 1;
  for (const std::size_t column : columns)
    combinations *= static_cast<std::size_t>(design.level_counts[column]);
  if (design.rows.size() % combinations != 0) return false;
  std::vector<std::size_t> seen(combinations, 0);
  for (const auto& row : design.rows) {
    std::size_t place = 0;
    for (const std::size_t column : columns)
      place = place * static_cast<std::size_t>(design.level_counts[column]) +
              static_cast<std::size_t>(row[column]);
    ++seen[place];
  }
  const std::size_t each = design.rows.size() / combinations;
  return std::all_of(seen.begin(), seen.end(), [&](std::size_t count) { return count == each; });
}

bool all_balanced(const Design& design, std::vector<std::size_t>& columns, std::size_t size) {
  if (columns.size() == size) return balanced(design, columns);
  const std::size_t first = columns.empty() ? 0 : columns.back() + 1;
  for (std::size_t next = first; next < design.level_counts.size(); ++next) {
    columns.push_back(next);
    const bool good = all_balanced(design, columns, size);
    columns.pop_back();
    if (!good) return false;
  }
  return true;
}

}  // namespace

const std::vector<std::string>& array_names() {
  static const std::vector<std::string> names{"L4", "L8", "L9", "L12", "L16", "L18", "L27"};
  return names;
}

std::vector<Design> array_variants(std::string_view name) {
  if (name == "L4") return {binary_array(name, 2, {})};
  if (name == "L8") return {binary_array(name, 3, {}), binary_array(name, 3, {{{1, 2}}})};
  if (name == "L9") return {ternary_array(name, 2)};
  if (name == "L12") return {plackett_burman_12()};
  if (name == "L16") {
    std::vector<Design> variants;
    for (unsigned count = 0; count <= 5; ++count)
      variants.push_back(binary_array(name, 4, lines_of_16(count)));
    return variants;
  }
  if (name == "L18") return {difference_array_18(false), difference_array_18(true)};
  if (name == "L27") return {ternary_array(name, 3)};
  throw std::invalid_argument("there is no orthogonal array of the name " + std::string(name));
}

FittedArray fit_to(const Design& array, const std::vector<int>& level_counts) {
  std::vector<std::size_t> order(level_counts.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return level_counts[a] > level_counts[b]; });
  std::vector<bool> used(array.level_counts.size(), false);
  std::vector<std::size_t> column_of(level_counts.size());
  FittedArray fitted;
  for (const std::size_t factor : order) {
    std::size_t best = used.size();
    for (std::size_t column = 0; column < used.size(); ++column) {
      if (used[column] || array.level_counts[column] < level_counts[factor]) continue;
      if (best == used.size() || array.level_counts[column] < array.level_counts[best])
        best = column;
    }
    if (best == used.size()) return {};
    used[best] = true;
    column_of[factor] = best;
    if (array.level_counts[best] != level_counts[factor]) fitted.dummy_levels = true;
  }
  fitted.design.name = array.name;
  fitted.design.level_counts = level_counts;
  for (const auto& row : array.rows) {
    std::vector<int>& test = fitted.design.rows.emplace_back();
    for (std::size_t factor = 0; factor < level_counts.size(); ++factor)
      test.push_back(row[column_of[factor]] % level_counts[factor]);
  }
  return fitted;
}

int strength_of(const Design& design) {
  int strength = 0;
  const std::size_t most = std::min<std::size_t>(3, design.level_counts.size());
  for (std::size_t size = 1; size <= most; ++size) {
    std::vector<std::size_t> columns;
    if (!all_balanced(design, columns, size)) break;
    strength = static_cast<int>(size);
  }
  return strength;
}

namespace {

using Row = std::vector<int>;
constexpr std::size_t completion_steps_max = 1'000'000;
constexpr int restarts = 8;
constexpr int candidates = 25;
constexpr std::size_t annealing_moves = 400'000;
constexpr double start_temperature = 0.6;  // in uncovered pairs; falls to a hundredth

class Chance {
 public:
  explicit Chance(std::uint64_t seed) : engine_(seed) {}
  /// Uniform in [0, count), since the standard's distributions differ between libraries.
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(engine_() % count); }
  double share() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

 private:
  std::mt19937_64 engine_;
};

/// Counts each pair of levels in a plan; excludes impossible pairs.
class PairTable {
 public:
  explicit PairTable(const Constraints& constraints) : counts_(constraints.level_counts()) {
    first_.push_back(0);
    for (const int count : counts_)
      first_.push_back(first_.back() + static_cast<std::size_t>(count));
    width_ = first_.back();
    seen_.assign(width_ * width_, 0);
    for (std::size_t a = 0; a < counts_.size(); ++a)
      for (std::size_t b = a + 1; b < counts_.size(); ++b) rule_out(constraints, a, b);
    open_ = possible_;
  }

  [[nodiscard]] std::size_t open() const noexcept { return open_; }
  [[nodiscard]] std::size_t possible() const noexcept { return possible_; }
  [[nodiscard]] std::size_t impossible() const noexcept { return impossible_; }
  [[nodiscard]] bool is_open(std::size_t a, int x, std::size_t b, int y) const noexcept {
    return seen_[place(a, x, b, y)] == 0;
  }
  void add(std::size_t a, int x, std::size_t b, int y) noexcept {
    int& seen = seen_[place(a, x, b, y)];
    if (seen++ == 0) --open_;
  }
  void remove(std::size_t a, int x, std::size_t b, int y) noexcept {
    int& seen = seen_[place(a, x, b, y)];
    if (--seen == 0) ++open_;
  }
  void add(const Row& row) noexcept {
    for (std::size_t a = 0; a < row.size(); ++a)
      for (std::size_t b = a + 1; b < row.size(); ++b) add(a, row[a], b, row[b]);
  }
  void change(Row& row, std::size_t factor, int level) noexcept {
    for (std::size_t other = 0; other < row.size(); ++other)
      if (other != factor) remove(factor, row[factor], other, row[other]);
    row[factor] = level;
    for (std::size_t other = 0; other < row.size(); ++other)
      if (other != factor) add(factor, level, other, row[other]);
  }
  /// The first open pair after a random place. @pre open() > 0
  [[nodiscard]] std::pair<Pick, Pick> some_open(Chance& chance) const {
    for (std::size_t from = chance.below(seen_.size());; from = (from + 1) % seen_.size()) {
      const std::size_t i = from / width_;
      const std::size_t j = from % width_;
      const std::size_t a = factor_at(i);
      const std::size_t b = factor_at(j);
      if (a < b && seen_[from] == 0)
        return {{a, static_cast<int>(i - first_[a])}, {b, static_cast<int>(j - first_[b])}};
    }
  }

 private:
  void rule_out(const Constraints& constraints, std::size_t a, std::size_t b) {
    for (int x = 0; x < counts_[a]; ++x) {
      for (int y = 0; y < counts_[b]; ++y) {
        bool can_be = true;
        if (!constraints.empty()) {
          Row row(counts_.size(), Constraints::no_level);
          row[a] = x;
          row[b] = y;
          can_be = !constraints.completed(row).empty();
        }
        if (can_be) {
          ++possible_;
        } else {
          ++impossible_;
          seen_[place(a, x, b, y)] = 1;  // never open
        }
      }
    }
  }
  [[nodiscard]] std::size_t place(std::size_t a, int x, std::size_t b, int y) const noexcept {
    const std::size_t i = first_[a] + static_cast<std::size_t>(x);
    const std::size_t j = first_[b] + static_cast<std::size_t>(y);
    return a < b ? i * width_ + j : j * width_ + i;
  }
  [[nodiscard]] std::size_t factor_at(std::size_t place) const {
    return static_cast<std::size_t>(std::upper_bound(first_.begin(), first_.end(), place) -
                                    first_.begin()) -
           1;
  }

  std::vector<int> counts_;
  std::vector<std::size_t> first_;
  std::size_t width_{0};
  std::vector<int> seen_;
  std::size_t open_{0};
  std::size_t possible_{0};
  std::size_t impossible_{0};
};

/// The level with the most open pairs to the levels set that leaves the row completable.
int best_level(const PairTable& table, const Constraints& constraints, Row& row, std::size_t factor,
               Chance& chance) {
  int best = Constraints::no_level;
  std::size_t most = 0;
  const int count = constraints.level_counts()[factor];
  const int from = static_cast<int>(chance.below(static_cast<std::size_t>(count)));
  for (int step = 0; step < count; ++step) {
    const int level = (from + step) % count;
    std::size_t open = 0;
    for (std::size_t other = 0; other < row.size(); ++other)
      if (other != factor && row[other] != Constraints::no_level &&
          table.is_open(factor, level, other, row[other]))
        ++open;
    if (best != Constraints::no_level && open <= most) continue;
    row[factor] = level;
    if (!constraints.empty() && constraints.completed(row).empty()) continue;
    best = level;
    most = open;
  }
  row[factor] = best;
  return static_cast<int>(most);
}

Row greedy_row(const PairTable& table, const Constraints& constraints, Chance& chance) {
  const std::size_t factors = constraints.level_counts().size();
  Row best;
  int most = -1;
  for (int candidate = 0; candidate < candidates; ++candidate) {
    Row row(factors, Constraints::no_level);
    const auto [a, b] = table.some_open(chance);
    row[a.factor] = a.level;
    row[b.factor] = b.level;
    std::vector<std::size_t> order(factors);
    std::iota(order.begin(), order.end(), std::size_t{0});
    for (std::size_t i = factors; i > 1; --i) std::swap(order[i - 1], order[chance.below(i)]);
    int open = 1;
    for (const std::size_t factor : order)
      if (row[factor] == Constraints::no_level)
        open += best_level(table, constraints, row, factor, chance);
    if (open <= most) continue;
    most = open;
    best = row;
  }
  return best;
}

std::vector<Row> greedy_rows(PairTable table, const Constraints& constraints, Chance& chance,
                             std::size_t most) {
  std::vector<Row> rows;
  while (table.open() > 0 && rows.size() < most) {
    rows.push_back(greedy_row(table, constraints, chance));
    table.add(rows.back());
  }
  return table.open() > 0 ? std::vector<Row>{} : rows;
}

/// Tries to cover all pairs with the given number of rows. @return success
bool anneal(PairTable table, const Constraints& constraints, std::vector<Row>& rows,
            Chance& chance) {
  for (const Row& row : rows) table.add(row);
  const std::vector<int>& counts = constraints.level_counts();
  const double cooling = std::pow(0.01, 1.0 / static_cast<double>(annealing_moves));
  double temperature = start_temperature;
  for (std::size_t move = 0; move < annealing_moves && table.open() > 0; ++move) {
    temperature *= cooling;
    Row& row = rows[chance.below(rows.size())];
    const std::size_t factor = chance.below(counts.size());
    const int level = static_cast<int>(chance.below(static_cast<std::size_t>(counts[factor])));
    const int previous = row[factor];
    if (level == previous) continue;
    const std::size_t before = table.open();
    table.change(row, factor, level);
    const double worse = static_cast<double>(table.open()) - static_cast<double>(before);
    if ((worse > 0 && chance.share() >= std::exp(-worse / temperature)) ||
        !constraints.kept_by(row))
      table.change(row, factor, previous);
  }
  return table.open() == 0;
}

/// The smallest orthogonal array with every pair; empty rows: none.
Design smallest_array(const std::vector<int>& level_counts) {
  for (const std::string& name : array_names())
    for (const Design& variant : array_variants(name)) {
      FittedArray fitted = fit_to(variant, level_counts);
      if (!fitted.design.rows.empty()) return fitted.design;
    }
  return {};
}

}  // namespace

Constraints::Constraints(std::vector<int> level_counts, std::vector<Forbidden> forbidden)
    : level_counts_(std::move(level_counts)), forbidden_(std::move(forbidden)) {}

bool Constraints::kept_by(const std::vector<int>& row) const noexcept {
  return std::none_of(forbidden_.begin(), forbidden_.end(), [&](const Forbidden& picks) {
    return std::all_of(picks.begin(), picks.end(),
                       [&](const Pick& pick) { return row[pick.factor] == pick.level; });
  });
}

std::vector<int> Constraints::completed(std::vector<int> row) const {
  std::size_t steps = 0;
  if (!kept_by(row) || !complete(row, 0, steps)) return {};
  return row;
}

bool Constraints::complete(std::vector<int>& row, std::size_t factor, std::size_t& steps) const {
  while (factor < row.size() && row[factor] != no_level) ++factor;
  if (factor == row.size()) return true;
  for (int level = 0; level < level_counts_[factor]; ++level) {
    if (++steps > completion_steps_max)
      throw std::runtime_error(
          "the forbidden combinations are too complex: no plan found within the step limit");
    row[factor] = level;
    if (kept_by(row) && complete(row, factor + 1, steps)) return true;
  }
  row[factor] = no_level;
  return false;
}

PairCount count_pairs(const Design& design, const Constraints& constraints) {
  PairTable table(constraints);
  for (const Row& row : design.rows) table.add(row);
  return {table.possible(), table.impossible(), table.possible() - table.open()};
}

Design all_pairs(const Constraints& constraints, std::uint64_t seed) {
  const std::vector<int>& counts = constraints.level_counts();
  if (constraints.completed(Row(counts.size(), Constraints::no_level)).empty())
    throw std::runtime_error("the forbidden combinations exclude every test");
  const PairTable table(constraints);
  Chance chance(seed);
  std::vector<Row> best;
  for (int restart = 0; restart < restarts; ++restart) {
    const std::size_t most = best.empty() ? table.possible() + 1 : best.size() - 1;
    std::vector<Row> rows = greedy_rows(table, constraints, chance, most);
    if (!rows.empty()) best = std::move(rows);
  }
  Design array = constraints.empty() ? smallest_array(counts) : Design{};
  std::size_t fewest = 1;  // the two factors with the most levels need one test per pair
  std::vector<int> sorted = counts;
  std::sort(sorted.rbegin(), sorted.rend());
  if (constraints.empty() && sorted.size() > 1)
    fewest = static_cast<std::size_t>(sorted[0]) * static_cast<std::size_t>(sorted[1]);
  while (best.size() > fewest && (array.rows.empty() || array.rows.size() > fewest)) {
    std::vector<Row> rows = best;
    rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(chance.below(rows.size())));
    if (!anneal(table, constraints, rows, chance)) break;
    best = std::move(rows);
  }
  if (!array.rows.empty() && (array.rows.size() <= best.size() || best.empty())) return array;
  return {"all pairs", counts, best};
}

}  // namespace thermocomp::experiments
