#include "estimator/input_gains.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "estimator/name_index.hpp"

namespace thermocomp {

InputGains::InputGains(const ThermalModel& model)
    : columns_(model.temperature_columns().size()), matrix_um_per_K_(model.matrix_um_per_K) {
  const auto signals = model.signal_columns();
  for (const GuidewaySpec& spec : model.guideways) {
    Rows rows{
        index_of(signals, spec.axis, "guideway.axis", "is not a signal"), spec.positions_mm, {}};
    for (const std::string& output : model.outputs) {
      const auto found = spec.rows_um_per_K.find(output);
      rows.um_per_K.push_back(found == spec.rows_um_per_K.end() ? std::vector<std::vector<double>>{}
                                                                : found->second);
    }
    guideways_.push_back(std::move(rows));
  }
  for (const TermSpec& term : model.terms) add_term(model, term);
}

void InputGains::add_bank(const ThermalModel& model, const LagBankSpec& bank) {
  const auto columns = model.temperature_columns();
  for (std::size_t i = 0; i < bank.subjects.size(); ++i) {
    const bool squared = !bank.powers.empty() && bank.powers[i] > 1.5;
    if (!is_temperature_name(bank.subjects[i]) || squared) continue;
    BankShare share{index_of(columns, bank.subjects[i], "term.subjects", "is not a temperature"),
                    {}};
    for (const std::string& output : model.outputs) {
      std::vector<double>& reached = share.reached.emplace_back();
      const auto gains = bank.gain_um_per_unit.find(output);
      double sum = 0.0;
      for (std::size_t j = 0; j < bank.taus_s.size(); ++j) {
        if (gains != bank.gain_um_per_unit.end()) sum += gains->second[i][j];
        reached.push_back(sum);
      }
    }
    banks_.push_back(std::move(share));
  }
}

void InputGains::add_term(const ThermalModel& model, const TermSpec& term) {
  struct Known {
    Form form;
    const char* gain;
  };
  // What is not here has no gain of its own: an operating signal's term, or one that passes a
  // temperature on late or with play.
  static const std::map<std::string, Known> known{
      {"thermal_lag", {Form::late, "gain_um_per_K"}},
      {"missing_temperature", {Form::constant, "gain_um_per_K"}},
      {"wrong_coefficient", {Form::constant, "delta_um_per_K"}},
      {"nonlinear_expansion", {Form::squared, "gain_um_per_K2"}},
      {"position_dependence", {Form::position, "gain_um_per_K_mm"}},
      {"sensor_swap", {Form::swap, ""}},
  };
  if (term.kind == "lag_bank") add_bank(model, term.bank);
  const auto entry = known.find(term.kind);
  if (entry == known.end()) return;
  const auto columns = model.temperature_columns();
  SubjectColumns names = subject_columns(term.subject);
  Share share{entry->second.form, 0, 0, 0.0, std::vector<double>(model.outputs.size(), 0.0)};
  if (share.form == Form::position && !is_temperature_name(names.first))
    std::swap(names.first, names.second);
  share.column = index_of(columns, names.first, "term.subject", "is not a temperature");
  if (share.form == Form::position) {
    share.second =
        index_of(model.signal_columns(), names.second, "term.subject", "is not a signal");
    share.p0_mm = term.shared.at("p0_mm");
  }
  if (share.form == Form::swap)
    share.second = index_of(columns, names.second, "term.subject", "is not a temperature");
  const auto gains = term.per_output.find(entry->second.gain);
  if (gains != term.per_output.end())
    for (std::size_t i = 0; i < model.outputs.size(); ++i) {
      const auto gain = gains->second.find(model.outputs[i]);
      if (gain != gains->second.end()) share.gains[i] = gain->second;
    }
  shares_.push_back(std::move(share));
}

void InputGains::of_output(std::size_t output, std::span<const double> rise_K,
                           std::span<const double> signals,
                           std::span<double> gain_um_per_K) const noexcept {
  const std::vector<double>& row = matrix_um_per_K_[output];
  std::fill(gain_um_per_K.begin(), gain_um_per_K.end(), 0.0);
  std::copy(row.begin(), row.end(), gain_um_per_K.begin());
  for (const Rows& guideway : guideways_) {
    const auto& rows = guideway.um_per_K[output];
    if (rows.empty()) continue;
    const auto& at_mm = guideway.positions_mm;
    const double position_mm = std::clamp(signals[guideway.signal], at_mm.front(), at_mm.back());
    const auto above = std::upper_bound(at_mm.begin() + 1, at_mm.end() - 1, position_mm);
    const auto upper = static_cast<std::size_t>(above - at_mm.begin());
    const double share = (position_mm - at_mm[upper - 1]) / (at_mm[upper] - at_mm[upper - 1]);
    for (std::size_t i = 0; i < row.size(); ++i)
      gain_um_per_K[i] += (1.0 - share) * rows[upper - 1][i] + share * rows[upper][i];
  }
  for (const Share& share : shares_) {
    const double gain = share.gains[output];
    double& total = gain_um_per_K[share.column];
    if (share.form == Form::constant) total += gain;
    if (share.form == Form::squared) total += 2.0 * gain * rise_K[share.column];
    if (share.form == Form::position) total += gain * (signals[share.second] - share.p0_mm);
  }
  // A lag takes its share away at first and gives it back in the end.
  for (const Share& share : shares_) {
    double& total = gain_um_per_K[share.column];
    if (share.form != Form::late) continue;
    const double at_once = total - share.gains[output];
    if (std::abs(at_once) > std::abs(total)) total = at_once;
  }
  for (const BankShare& share : banks_) {
    double& total = gain_um_per_K[share.column];
    double largest = total;
    for (const double reached : share.reached[output])
      if (std::abs(total + reached) > std::abs(largest)) largest = total + reached;
    total = largest;
  }
  for (const Share& share : shares_)
    if (share.form == Form::swap)
      std::swap(gain_um_per_K[share.column], gain_um_per_K[share.second]);
}

}  // namespace thermocomp
