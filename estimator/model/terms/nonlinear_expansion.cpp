#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = c T^2: expansion that is not proportional to the rise, equal for heating and cooling.
class NonlinearExpansion final : public Term {
 public:
  explicit NonlinearExpansion(const TermContext& context)
      : subject_(context.subject), gain_um_per_K2_(context.per_output("gain_um_per_K2")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    const double squared_K2 = input.rise_K[subject_] * input.rise_K[subject_];
    for (std::size_t i = 0; i < gain_um_per_K2_.size(); ++i)
      displacement_um[i] += gain_um_per_K2_[i] * squared_K2;
  }
  void add_slope(const TermInput& input, std::size_t output,
                 std::span<double> slope_um_per_K) const noexcept override {
    slope_um_per_K[subject_] += 2.0 * gain_um_per_K2_[output] * input.rise_K[subject_];
  }
  void restart() noexcept override {}
  void visit_state(StateArchive& /*archive*/) override {}

 private:
  std::size_t subject_;
  std::vector<double> gain_um_per_K2_;
};

}  // namespace

TermRegistration nonlinear_expansion_registration() {
  return {{"nonlinear_expansion",
           TermSubject::any_temperature,
           {{"gain_um_per_K2", true, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<NonlinearExpansion>(context);
          }};
}

}  // namespace thermocomp
