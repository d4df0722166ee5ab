#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = c (p - p0) T: the effect of a temperature grows along an axis.
class PositionDependence final : public Term {
 public:
  explicit PositionDependence(const TermContext& context)
      : temperature_(context.subject),
        position_(context.second),
        p0_mm_(context.shared("p0_mm")),
        gain_um_per_K_mm_(context.per_output("gain_um_per_K_mm")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    const double lever_K_mm = (input.signals[position_] - p0_mm_) * input.rise_K[temperature_];
    for (std::size_t i = 0; i < gain_um_per_K_mm_.size(); ++i)
      displacement_um[i] += gain_um_per_K_mm_[i] * lever_K_mm;
  }
  void add_slope(const TermInput& input, std::size_t output,
                 std::span<double> slope_um_per_K) const noexcept override {
    slope_um_per_K[temperature_] += gain_um_per_K_mm_[output] * (input.signals[position_] - p0_mm_);
  }
  void restart() noexcept override {}
  void visit_state(StateArchive& /*archive*/) override {}

 private:
  std::size_t temperature_;
  std::size_t position_;
  double p0_mm_;
  std::vector<double> gain_um_per_K_mm_;
};

}  // namespace

TermRegistration position_dependence_registration() {
  return {{"position_dependence",
           TermSubject::temperature_and_position,
           {{"gain_um_per_K_mm", true, -term_gain_max, term_gain_max},
            {"p0_mm", false, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<PositionDependence>(context);
          }};
}

}  // namespace thermocomp
