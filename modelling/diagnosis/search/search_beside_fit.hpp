/// The search for causes in rows that the model's coefficients were fitted to.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "estimator/thermal_model.hpp"
#include "modelling/diagnosis/evidence/own_fit.hpp"
#include "modelling/diagnosis/search/search.hpp"

namespace thermocomp::diagnosis {

/// A fit takes into the coefficients what it can of a cause that acts in its rows, and leaves the
/// rest: that rest, not the cause's own displacement, is what is sought in the residual. A finding
/// says besides the cause what the coefficients were before the cause went into them.
///
/// Outputs are searched each for itself, since what is plain in one may be nothing in another whose
/// coefficients would be moved for it; those with the same first cause then together.
class SearchBesideFit {
 public:
  SearchBesideFit(const MeasuredData& data, const Thresholds& thresholds);

  /// @return empty findings where no output's coefficients come from these rows, or nothing is
  /// clear
  [[nodiscard]] SearchResult run();
  /// @param finding  one of run()'s
  /// @return what its cause had put into the coefficients, with the sign that takes it out:
  ///         `wrong_coefficient` terms, one an input
  [[nodiscard]] std::vector<TermSpec> corrections(const Finding& finding) const;

 private:
  /// Outputs that are searched together: their data, and the search that its findings point into.
  struct Group {
    std::vector<std::size_t> outputs;
    std::unique_ptr<MeasuredData> data;
    std::vector<Hypothesis> acting;  ///< the catalogue: displacements as they act
    std::unique_ptr<Search> search;
    SearchResult result;
  };
  [[nodiscard]] std::unique_ptr<Group> searched(const std::vector<std::size_t>& outputs) const;
  void fit_again(Group& group) const;
  void fit_shape_again(Group& group, Finding& finding) const;
  double refit_gains(Group& group) const;
  [[nodiscard]] static const Hypothesis& acting_of(const Group& group,
                                                   const Explanation& explanation);
  void take(std::unique_ptr<Group> group, SearchResult& result);

  const MeasuredData& data_;
  Thresholds thresholds_;
  StackedRows rows_;
  std::optional<OwnFit> fit_;
  std::vector<std::unique_ptr<Group>> groups_;
};

/// What findings leave of rows that they were not fitted to: the sum of ln(RMS after / before).
[[nodiscard]] double log_left_by(const SearchResult& result);

}  // namespace thermocomp::diagnosis
