/// Free, held and tied unknowns: u = T q + g, with free unknowns q and given values g.
#pragma once

#include <span>
#include <vector>

#include "modelling/structure/elements/sparse.hpp"

namespace thermocomp::structure {

/// Term of a tied node: u = sum of weight times u of node.
struct Weighted {
  Index node{0};
  double weight{0.0};
};

/// Unknowns of the full model are numbered node * components + component.
class Reduction {
 public:
  Reduction(Index nodes, Index components);

  /// Gives the unknown a value (0, or see given()); takes precedence over a tie.
  void hold(Index node, Index component);
  /// Ties the node to `masters` in all components. Masters that are tied themselves are replaced by
  /// theirs. @return false, without a change: the node is already tied or would depend on itself
  bool tie(Index node, std::span<const Weighted> masters);
  /// Numbers the free unknowns. Call after all hold() and tie().
  void finish();

  [[nodiscard]] Index full_size() const { return static_cast<Index>(held_.size()); }
  [[nodiscard]] Index free_size() const { return free_size_; }
  [[nodiscard]] bool is_held(Index node, Index component) const {
    return held_[node * components_ + component];
  }
  [[nodiscard]] const std::vector<Weighted>& masters_of(Index node) const { return ties_[node]; }
  /// Place of each free unknown in the full model, increasing.
  [[nodiscard]] std::vector<Index> places_of_free() const;
  /// g from values for all unknowns, of which only those of held ones are used. Shapes (full_size).
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
  std::vector<std::vector<Weighted>> ties_;  ///< empty: not tied
  std::vector<Term> terms_;
  std::vector<Index> term_start_;
  Index free_size_{0};
};

}  // namespace thermocomp::structure
