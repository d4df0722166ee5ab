#include "modelling/diagnosis/evidence/settings_together.hpp"

#include <utility>

namespace thermocomp::diagnosis {

SettingsTogether::SettingsTogether(std::vector<const Setting*> settings)
    : settings_(std::move(settings)) {
  Eigen::Index columns = 0;
  for (std::vector<std::size_t>& of_whitener : Setting::alike(settings_)) {
    const Eigen::Index count = settings_[of_whitener.front()]->against().cols();
    groups_.push_back({std::move(of_whitener), columns, count});
    columns += count;
  }
  against_.resize(settings_.front()->against().rows(), columns);
  for (const Group& group : groups_) {
    const Setting& most = *settings_[group.settings.front()];
    against_.middleCols(group.first, group.columns) = most.whitener().transposed(most.against());
  }
}

std::vector<EquationsTable> SettingsTogether::equations(const Panel& columns,
                                                        Eigen::Index width) const {
  std::vector<EquationsTable> all(
      settings_.size(), EquationsTable(static_cast<std::size_t>(columns.cols() / width), width));
  const Eigen::MatrixXd products = cross_products(against_, columns, 0, columns.rows());
  const std::vector<Eigen::MatrixXd> own = neighbour_products_of_each(columns, width);
  for (std::size_t g = 0; g < groups_.size(); ++g)
    for (const std::size_t i : groups_[g].settings)
      settings_[i]->without_common(products.middleRows(groups_[g].first, groups_[g].columns),
                                   own[g], 0, all[i]);
  return all;
}

std::vector<Eigen::MatrixXd> SettingsTogether::neighbour_products_of_each(
    const Panel& columns, Eigen::Index width) const {
  std::vector<Eigen::MatrixXd> all(groups_.size());
  Eigen::MatrixXd plain;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Whitener& whitener = settings_[groups_[g].settings.front()]->whitener();
    if (whitener.changes_nothing()) continue;
    if (width > 1) {
      all[g] = neighbour_products(whitener.apply(columns), width, 0, columns.rows());
    } else {
      Whitener::Squares of = whitener.squares(columns);
      all[g] = std::move(of.white);
      plain = std::move(of.plain);
    }
  }
  for (Eigen::MatrixXd& own : all)
    if (own.size() == 0)
      own = plain.size() > 0 ? plain : neighbour_products(columns, width, 0, columns.rows());
  return all;
}

std::vector<EquationsTable> SettingsTogether::equations_from_rows(
    const Panel& whole, const std::vector<Eigen::Index>& first_rows) const {
  const auto columns = static_cast<std::size_t>(whole.cols());
  std::vector<EquationsTable> all(settings_.size(), EquationsTable(first_rows.size() * columns, 1));
  std::vector<Eigen::MatrixXd> own;
  for (const Group& group : groups_)
    own.push_back(
        settings_[group.settings.front()]->whitener().squares_from_rows(whole, first_rows));
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(against_.cols(), whole.cols());
  Eigen::Index end = whole.rows();
  for (std::size_t row = first_rows.size(); row-- > 0;) {
    products += cross_products(against_, whole, first_rows[row], end);
    end = first_rows[row];
    for (std::size_t g = 0; g < groups_.size(); ++g)
      for (const std::size_t i : groups_[g].settings)
        settings_[i]->without_common(products.middleRows(groups_[g].first, groups_[g].columns),
                                     own[g].row(static_cast<Eigen::Index>(row)), row * columns,
                                     all[i]);
  }
  return all;
}

}  // namespace thermocomp::diagnosis
