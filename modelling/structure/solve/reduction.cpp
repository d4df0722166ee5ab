#include "modelling/structure/solve/reduction.hpp"

#include <algorithm>

#include "estimator/checks.hpp"

namespace thermocomp::structure {
namespace {

constexpr Index not_free = 0xffffffff;

struct Entry {
  Index row;
  double value;
};

void append_column(std::vector<Entry>& entries, SparseSymmetric& matrix) {
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.row < b.row; });
  for (const Entry& entry : entries) {
    const bool same =
        matrix.row.size() > matrix.column_start.back() && matrix.row.back() == entry.row;
    if (same) {
      matrix.value.back() += entry.value;
    } else {
      matrix.row.push_back(entry.row);
      matrix.value.push_back(entry.value);
    }
  }
  matrix.column_start.push_back(static_cast<Index>(matrix.row.size()));
}

}  // namespace

Reduction::Reduction(Index nodes, Index components)
    : components_(components), held_(std::size_t{nodes} * components, false), ties_(nodes) {}

void Reduction::hold(Index node, Index component) {
  held_[node * components_ + component] = true;
}

void Reduction::resolve(Index node, double weight, std::vector<Weighted>& out) const {
  if (ties_[node].empty()) {
    out.push_back({node, weight});
    return;
  }
  for (const Weighted& master : ties_[node]) resolve(master.node, weight * master.weight, out);
}

bool Reduction::tie(Index node, std::span<const Weighted> masters) {
  if (!ties_[node].empty()) return false;
  std::vector<Weighted> resolved;
  for (const Weighted& master : masters) {
    if (master.weight != 0.0) resolve(master.node, master.weight, resolved);
  }
  const bool itself = std::any_of(resolved.begin(), resolved.end(),
                                  [node](const Weighted& w) { return w.node == node; });
  if (itself || resolved.empty()) return false;
  ties_[node] = std::move(resolved);
  return true;
}

void Reduction::finish() {
  const auto nodes = static_cast<Index>(ties_.size());
  std::vector<Index> number(held_.size(), not_free);
  for (Index full = 0; full < held_.size(); ++full) {
    if (!held_[full] && ties_[full / components_].empty()) number[full] = free_size_++;
  }
  term_start_.assign(1, 0);
  std::vector<Weighted> masters;
  for (Index node = 0; node < nodes; ++node) {
    masters.clear();
    resolve(node, 1.0, masters);
    if (!ties_[node].empty()) ties_[node] = masters;
    for (Index c = 0; c < components_; ++c) {
      for (const Weighted& master : masters) {
        const Index free = number[master.node * components_ + c];
        if (free != not_free && !is_held(node, c)) terms_.push_back({free, master.weight});
      }
      term_start_.push_back(static_cast<Index>(terms_.size()));
    }
  }
}

std::vector<Index> Reduction::places_of_free() const {
  std::vector<Index> places;
  for (Index full = 0; full < held_.size(); ++full) {
    if (!held_[full] && ties_[full / components_].empty()) places.push_back(full);
  }
  return places;
}

std::vector<double> Reduction::given(std::span<const double> values) const {
  std::vector<double> result(held_.size(), 0.0);
  for (Index full = 0; full < held_.size(); ++full) {
    if (held_[full]) {
      result[full] = values[full];
      continue;
    }
    for (const Weighted& master : ties_[full / components_]) {
      const Index other = master.node * components_ + full % components_;
      if (held_[other]) result[full] += master.weight * values[other];
    }
  }
  return result;
}

SparseSymmetric Reduction::reduced(const SparseSymmetric& full) const {
  THERMOCOMP_ENSURE(full.size() == full_size());
  // A free column collects entries of several full columns: counted, placed, sorted, summed.
  const auto each_entry = [&](const auto& action) {
    for (Index column = 0; column < full.size(); ++column) {
      for (Index k = full.column_start[column]; k < full.column_start[column + 1]; ++k) {
        const Index row = full.row[k];
        for (const Term& a : terms(row)) {
          for (const Term& b : terms(column)) {
            double amount = a.weight * b.weight * full.value[k];
            // An off-diagonal entry represents two, which may both map to one free diagonal.
            if (row != column && a.free == b.free) amount *= 2.0;
            if (row == column && a.free < b.free) continue;  // the transposed pair follows
            action(std::max(a.free, b.free), std::min(a.free, b.free), amount);
          }
        }
      }
    }
  };
  std::vector<std::size_t> start(std::size_t{free_size_} + 1, 0);
  each_entry([&](Index, Index column, double) { ++start[column + 1]; });
  for (std::size_t i = 1; i < start.size(); ++i) start[i] += start[i - 1];
  std::vector<Entry> entries(start.back());
  std::vector<std::size_t> next(start.begin(), start.end() - 1);
  each_entry([&](Index row, Index column, double amount) {
    entries[next[column]++] = {row, amount};
  });
  SparseSymmetric result;
  result.column_start.assign(1, 0);
  result.row.reserve(entries.size());
  result.value.reserve(entries.size());
  std::vector<Entry> column_entries;
  for (Index column = 0; column < free_size_; ++column) {
    column_entries.assign(entries.begin() + static_cast<std::ptrdiff_t>(start[column]),
                          entries.begin() + static_cast<std::ptrdiff_t>(start[column + 1]));
    append_column(column_entries, result);
  }
  return result;
}

void Reduction::restrict_to_free(std::span<const double> full, std::span<double> free) const {
  std::fill(free.begin(), free.end(), 0.0);
  for (Index i = 0; i < full.size(); ++i) {
    for (const Term& term : terms(i)) free[term.free] += term.weight * full[i];
  }
}

std::vector<double> Reduction::expanded(std::span<const double> free) const {
  std::vector<double> full(full_size(), 0.0);
  for (Index i = 0; i < full.size(); ++i) {
    for (const Term& term : terms(i)) full[i] += term.weight * free[term.free];
  }
  return full;
}

}  // namespace thermocomp::structure
