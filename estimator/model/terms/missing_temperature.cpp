#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = K LP(T): a measured place that is not in the matrix, lagged where tau_s > 0.
class MissingTemperature final : public Term {
 public:
  explicit MissingTemperature(const TermContext& context)
      : subject_(context.subject),
        gain_um_per_K_(context.per_output("gain_um_per_K")),
        rise_(context.shared("tau_s")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    const double rise_K = rise_.step(input.now, input.rise_K[subject_]);
    for (std::size_t i = 0; i < gain_um_per_K_.size(); ++i)
      displacement_um[i] += gain_um_per_K_[i] * rise_K;
  }
  void add_slope(const TermInput& /*input*/, std::size_t output,
                 std::span<double> slope_um_per_K) const noexcept override {
    slope_um_per_K[subject_] += gain_um_per_K_[output];
  }
  void restart() noexcept override { rise_.restart(); }
  void visit_state(StateArchive& archive) override { archive(rise_); }

 private:
  std::size_t subject_;
  std::vector<double> gain_um_per_K_;
  LowPass rise_;
};

}  // namespace

TermRegistration missing_temperature_registration() {
  return {{"missing_temperature",
           TermSubject::other_temperature,
           {{"gain_um_per_K", true, -term_gain_max, term_gain_max},
            {"tau_s", false, 0, term_tau_s_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<MissingTemperature>(context);
          }};
}

}  // namespace thermocomp
