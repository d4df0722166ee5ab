/// Several settings of one output, against which many columns are weighed.
#pragma once

#include <vector>

#include "modelling/diagnosis/evidence/evidence.hpp"

namespace thermocomp::diagnosis {

/// (W x)' (W a) = x' (W' W a) with W what whitens: for many columns x it takes less to whiten what
/// they are multiplied with, once and for all settings, than each of them. Their own squares need
/// their whitened values, but no place for these.
class SettingsTogether {
 public:
  SettingsTogether() = default;
  explicit SettingsTogether(std::vector<const Setting*> settings);

  /// What Setting::equations_of_groups gives.
  [[nodiscard]] std::vector<EquationsTable> equations(const Panel& columns,
                                                      Eigen::Index width) const;
  /// Of single columns that are those of `whole` from a row on and zero before; one after the
  /// other, from row after row.
  /// @param first_rows  ascending
  [[nodiscard]] std::vector<EquationsTable> equations_from_rows(
      const Panel& whole, const std::vector<Eigen::Index>& first_rows) const;

 private:
  /// Settings of one whitener.
  struct Group {
    std::vector<std::size_t> settings;  ///< those with the most common columns first
    Eigen::Index first{0};              ///< of their columns in against_
    Eigen::Index columns{0};
  };

  /// Of the columns as each group's whitener leaves them.
  [[nodiscard]] std::vector<Eigen::MatrixXd> neighbour_products_of_each(const Panel& columns,
                                                                        Eigen::Index width) const;

  std::vector<const Setting*> settings_;
  std::vector<Group> groups_;
  Panel against_;  ///< W' W a of all groups
};

}  // namespace thermocomp::diagnosis
