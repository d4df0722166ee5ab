#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = c u^2 without lag: centrifugal growth of the spindle and the bearing's seat.
class SpeedGrowth final : public Term {
 public:
  explicit SpeedGrowth(const TermContext& context)
      : subject_(context.subject), gain_um_per_unit2_(context.per_output("gain_um_per_unit2")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    const double squared = input.signals[subject_] * input.signals[subject_];
    for (std::size_t i = 0; i < gain_um_per_unit2_.size(); ++i)
      displacement_um[i] += gain_um_per_unit2_[i] * squared;
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void restart() noexcept override {}
  void visit_state(StateArchive& /*archive*/) override {}

 private:
  std::size_t subject_;
  std::vector<double> gain_um_per_unit2_;
};

}  // namespace

TermRegistration speed_growth_registration() {
  return {{"speed_growth",
           TermSubject::signal,
           {{"gain_um_per_unit2", true, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<SpeedGrowth>(context);
          }};
}

}  // namespace thermocomp
