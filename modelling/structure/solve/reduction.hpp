/// Which unknowns are free: u = T q + g, with q the free ones and g what is given.
#pragma once

#include <span>
#include <vector>

#include "modelling/structure/elements/sparse.hpp"

namespace thermocomp::structure {

/// A node that follows others: u = sum of weight times u of node.
struct Weighted {
  Index node{0};
  double weight{0.0};
};

/// Unknowns of the full model are counted node by node: node * components + component.
class Reduction {
 public:
  Reduction(Index nodes, Index components);

  /// The unknown has a given value (0, or see set_given()); it wins over a tie.
  void hold(Index node, Index component);
  /// The node follows `masters` in all components. Masters that follow others themselves are
  /// replaced by those. @return false, and nothing done, where the node follows already or would
  /// follow itself
  bool tie(Index node, std::span<const Weighted> masters);
  /// Numbers the free unknowns. Nothing may be held or tied after it.
  void finish();

  [[nodiscard]] Index full_size() const { return static_cast<Index>(held_.size()); }
  [[nodiscard]] Index free_size() const { return free_size_; }
  [[nodiscard]] bool is_held(Index node, Index component) const {
    return held_[node * components_ + component];
  }
  [[nodiscard]] const std::vector<Weighted>& masters_of(Index node) const { return ties_[node]; }
  /// For each free unknown its place in the full model, increasing.
  [[nodiscard]] std::vector<Index> places_of_free() const;
  /// g with the values of the held unknowns and of what follows them, from values for all
  /// unknowns (only those of held ones count). Shapes (full_size).
  [[nodiscard]] std::vector<double> given(std::span<const double> values) const;

  /// T^T A T, shape (free_size).
  [[nodiscard]] SparseSymmetric reduced(const SparseSymmetric& full) const;
  /// T^T f
  void restrict_to_free(std::span<const double> full, std::span<double> free) const;
  /// T q
  [[nodiscard]] std::vector<double> expanded(std::span<const double> free) const;

 private:
  struct Term {
    Index free{0};
    double weight{0.0};
  };
  [[nodiscard]] std::span<const Term> terms(Index full) const {
    return {terms_.data() + term_start_[full], term_start_[full + 1] - term_start_[full]};
  }
  void resolve(Index node, double weight, std::vector<Weighted>& out) const;

  Index components_;
  std::vector<bool> held_;
  std::vector<std::vector<Weighted>> ties_;  ///< empty: the node follows none
  std::vector<Term> terms_;
  std::vector<Index> term_start_;
  Index free_size_{0};
};

}  // namespace thermocomp::structure
