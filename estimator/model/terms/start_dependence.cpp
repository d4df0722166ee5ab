#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = g (X - X0) LP(u): the effect of u (a temperature's rise or an operating signal) depends on
/// the temperature X of a place, at the reference or now. Unit of the gain: um per unit of u and K
/// of X. With the matrix or a missing_heat_source of the same u, two of these are the published
/// [a1 + a2 T0 + a3 T1] u with T0 at the start and T1 around the machine.
/// Source: JP7689460B2 eq. (1), (2).
class StartDependence final : public Term {
 public:
  explicit StartDependence(const TermContext& context)
      : acts_(context.subject),
        place_(context.second),
        acts_is_temperature_(is_temperature_name(subject_columns(context.spec.subject).first)),
        at_start_(context.shared("at_start") > 0.5),
        place0_degC_(context.shared("place0_degC")),
        gain_um_per_unit_K_(context.per_output("gain_um_per_unit_K")),
        late_(context.shared("tau_s")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    above_K_ = input.reference_degC[place_] - place0_degC_;
    if (!at_start_) above_K_ += input.rise_K[place_];
    late_value_ =
        late_.step(input.now, acts_is_temperature_ ? input.rise_K[acts_] : input.signals[acts_]);
    for (std::size_t i = 0; i < gain_um_per_unit_K_.size(); ++i)
      displacement_um[i] += gain_um_per_unit_K_[i] * above_K_ * late_value_;
  }
  /// At the place's temperature and the u of the last step.
  void add_slope(const TermInput& /*input*/, std::size_t output,
                 std::span<double> slope_um_per_K) const noexcept override {
    const double gain = gain_um_per_unit_K_[output];
    if (acts_is_temperature_) slope_um_per_K[acts_] += gain * above_K_;
    if (!at_start_) slope_um_per_K[place_] += gain * late_value_;
  }
  void restart() noexcept override { late_.restart(); }
  void visit_state(StateArchive& archive) override { archive(late_, above_K_, late_value_); }

 private:
  std::size_t acts_;
  std::size_t place_;
  bool acts_is_temperature_;
  bool at_start_;
  double place0_degC_;
  std::vector<double> gain_um_per_unit_K_;
  LowPass late_;
  double above_K_{0.0};     ///< X - X0 of the last step
  double late_value_{0.0};  ///< LP(u) of the last step
};

}  // namespace

TermRegistration start_dependence_registration() {
  return {{"start_dependence",
           TermSubject::column_and_temperature,
           {{"at_start", false, 0, 1, true},
            {"place0_degC", false, -term_gain_max, term_gain_max},
            {"tau_s", false, 0, term_tau_s_max},
            {"gain_um_per_unit_K", true, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<StartDependence>(context);
          }};
}

}  // namespace thermocomp
