#include <cmath>

#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = g (LP(T) - T): a share of the structure lags behind the sensor's temperature.
class ThermalLag final : public Term {
 public:
  explicit ThermalLag(const TermContext& context)
      : subject_(context.subject),
        gain_um_per_K_(context.per_output("gain_um_per_K")),
        late_(context.shared("tau_s")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    const double rise_K = input.rise_K[subject_];
    const double lag_K = late_.step(input.now, rise_K) - rise_K;
    for (std::size_t i = 0; i < gain_um_per_K_.size(); ++i)
      displacement_um[i] += gain_um_per_K_[i] * lag_K;
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void add_transient_slope(std::size_t output,
                           std::span<double> slope_um_per_K) const noexcept override {
    double& slope = slope_um_per_K[subject_];
    const double at_once = slope - gain_um_per_K_[output];
    if (std::abs(at_once) > std::abs(slope)) slope = at_once;
  }
  void restart() noexcept override { late_.restart(); }
  void visit_state(StateArchive& archive) override { archive(late_); }

 private:
  std::size_t subject_;
  std::vector<double> gain_um_per_K_;
  LowPass late_;
};

}  // namespace

TermRegistration thermal_lag_registration() {
  return {{"thermal_lag",
           TermSubject::model_temperature,
           {{"tau_s", false, term_tau_s_min, term_tau_s_max},
            {"gain_um_per_K", true, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<ThermalLag>(context);
          }};
}

}  // namespace thermocomp
