#include "modelling/experiments/orthogonal_array.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <numeric>
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

}  // namespace thermocomp::experiments
