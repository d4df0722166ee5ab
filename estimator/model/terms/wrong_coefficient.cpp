#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = dK T: the matrix' coefficient of one input is off by dK.
class WrongCoefficient final : public Term {
 public:
  explicit WrongCoefficient(const TermContext& context)
      : subject_(context.subject), delta_um_per_K_(context.per_output("delta_um_per_K")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    for (std::size_t i = 0; i < delta_um_per_K_.size(); ++i)
      displacement_um[i] += delta_um_per_K_[i] * input.rise_K[subject_];
  }
  void add_slope(const TermInput& /*input*/, std::size_t output,
                 std::span<double> slope_um_per_K) const noexcept override {
    slope_um_per_K[subject_] += delta_um_per_K_[output];
  }
  void restart() noexcept override {}
  void visit_state(StateArchive& /*archive*/) override {}

 private:
  std::size_t subject_;
  std::vector<double> delta_um_per_K_;
};

}  // namespace

TermRegistration wrong_coefficient_registration() {
  return {{"wrong_coefficient",
           TermSubject::model_temperature,
           {{"delta_um_per_K", true, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<WrongCoefficient>(context);
          }};
}

}  // namespace thermocomp
