#include <algorithm>
#include <chrono>
#include <cmath>

#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = sum over i, j of g_ij LP_j(u_i^p_i): effects of several columns on several time scales. For
/// a temperature, u is its rise.
class LagBank final : public Term {
 public:
  explicit LagBank(const TermContext& context);

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override;
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void add_transient_slope(std::size_t output,
                           std::span<double> slope_um_per_K) const noexcept override;
  void restart() noexcept override { started_ = false; }
  void visit_state(StateArchive& archive) override {
    archive(started_, at_, step_, shares_, late_);
  }

 private:
  struct Column {
    std::size_t index;
    bool temperature;
    bool squared;
  };
  void take(const TermInput& input) noexcept;
  void follow(nanoseconds now) noexcept;

  std::vector<Column> columns_;
  std::vector<double> taus_s_;
  std::vector<double> gains_;   ///< shape (outputs, time constants, columns)
  std::vector<double> values_;  ///< one per column, to its power; scratch
  bool started_{false};
  nanoseconds at_{};
  nanoseconds step_{};          ///< step length of shares_
  std::vector<double> shares_;  ///< one per time constant
  std::vector<double> late_;    ///< shape (time constants, columns)
};

LagBank::LagBank(const TermContext& context)
    : taus_s_(context.spec.bank.taus_s),
      gains_(context.bank_gains),
      values_(context.bank_columns.size()),
      shares_(taus_s_.size()),
      late_(values_.size() * taus_s_.size()) {
  const LagBankSpec& spec = context.spec.bank;
  for (std::size_t i = 0; i < values_.size(); ++i)
    columns_.push_back({context.bank_columns[i], is_temperature_name(spec.subjects[i]),
                        !spec.powers.empty() && spec.powers[i] > 1.5});
}

void LagBank::take(const TermInput& input) noexcept {
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const Column& column = columns_[i];
    const double value =
        column.temperature ? input.rise_K[column.index] : input.signals[column.index];
    values_[i] = column.squared ? value * value : value;
  }
}

void LagBank::follow(nanoseconds now) noexcept {
  const std::size_t count = columns_.size();
  if (!started_) {
    for (std::size_t i = 0; i < late_.size(); ++i) late_[i] = values_[i % count];
    started_ = true;
  } else if (now != at_) {
    if (now - at_ != step_) {
      step_ = now - at_;
      const double step_s = std::chrono::duration<double>(step_).count();
      for (std::size_t j = 0; j < taus_s_.size(); ++j)
        shares_[j] = taus_s_[j] > 0 ? -std::expm1(-step_s / taus_s_[j]) : 1.0;
    }
    for (std::size_t j = 0; j < taus_s_.size(); ++j) {
      double* late = late_.data() + j * count;
      const double share = shares_[j];
      for (std::size_t i = 0; i < count; ++i) late[i] += share * (values_[i] - late[i]);
    }
  }
  // A held state is evaluated again at its own time, with the slides at other positions.
  for (std::size_t j = 0; j < taus_s_.size(); ++j)
    if (!(taus_s_[j] > 0)) std::copy(values_.begin(), values_.end(), late_.data() + j * count);
  at_ = now;
}

void LagBank::add(const TermInput& input, std::span<double> displacement_um) noexcept {
  take(input);
  follow(input.now);
  const std::size_t states = late_.size();
  for (std::size_t output = 0; output < displacement_um.size(); ++output) {
    const double* gains = gains_.data() + output * states;
    double sum_um = 0.0;
    for (std::size_t i = 0; i < states; ++i) sum_um += gains[i] * late_[i];
    displacement_um[output] += sum_um;
  }
}

/// A rise acts through the time constants one after the other.
void LagBank::add_transient_slope(std::size_t output,
                                  std::span<double> slope_um_per_K) const noexcept {
  const double* gains = gains_.data() + output * late_.size();
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (!columns_[i].temperature || columns_[i].squared) continue;
    double& slope = slope_um_per_K[columns_[i].index];
    double largest = slope;
    double reached = 0.0;
    for (std::size_t j = 0; j < taus_s_.size(); ++j) {
      reached += gains[j * columns_.size() + i];
      if (std::abs(slope + reached) > std::abs(largest)) largest = slope + reached;
    }
    slope = largest;
  }
}

}  // namespace

TermRegistration lag_bank_registration() {
  return {{"lag_bank", TermSubject::several, {}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<LagBank>(context);
          }};
}

}  // namespace thermocomp
