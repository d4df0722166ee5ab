#include <algorithm>

#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = c max(u - above, 0) without lag. Several of them form a piecewise linear curve, for effects
/// of an operating signal that are neither linear nor quadratic.
class SignalHinge final : public Term {
 public:
  explicit SignalHinge(const TermContext& context)
      : subject_(context.subject),
        above_(context.shared("above")),
        gain_um_per_unit_(context.per_output("gain_um_per_unit")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    const double beyond = std::max(input.signals[subject_] - above_, 0.0);
    for (std::size_t i = 0; i < gain_um_per_unit_.size(); ++i)
      displacement_um[i] += gain_um_per_unit_[i] * beyond;
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void restart() noexcept override {}
  void visit_state(StateArchive& /*archive*/) override {}

 private:
  std::size_t subject_;
  double above_;
  std::vector<double> gain_um_per_unit_;
};

}  // namespace

TermRegistration signal_hinge_registration() {
  return {{"signal_hinge",
           TermSubject::signal,
           {{"above", false, -term_gain_max, term_gain_max},
            {"gain_um_per_unit", true, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<SignalHinge>(context);
          }};
}

}  // namespace thermocomp
