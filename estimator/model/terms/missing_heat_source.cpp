#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// d = c LP(u^power): heat that no sensor measures, tied to an operating signal u. Unit of the
/// gain: um per unit of u to that power.
class MissingHeatSource final : public Term {
 public:
  explicit MissingHeatSource(const TermContext& context)
      : subject_(context.subject),
        squared_(context.shared("power") > 1.5),
        gain_um_per_unit_(context.per_output("gain_um_per_unit")),
        heat_(context.shared("tau_s")) {}

  void add(const TermInput& input, std::span<double> displacement_um) noexcept override {
    const double signal = input.signals[subject_];
    const double heat = heat_.step(input.now, squared_ ? signal * signal : signal);
    for (std::size_t i = 0; i < gain_um_per_unit_.size(); ++i)
      displacement_um[i] += gain_um_per_unit_[i] * heat;
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void restart() noexcept override { heat_.restart(); }
  void visit_state(StateArchive& archive) override { archive(heat_); }

 private:
  std::size_t subject_;
  bool squared_;
  std::vector<double> gain_um_per_unit_;
  LowPass heat_;
};

}  // namespace

TermRegistration missing_heat_source_registration() {
  return {{"missing_heat_source",
           TermSubject::signal,
           {{"tau_s", false, term_tau_s_min, term_tau_s_max},
            {"power", false, 1, 2, true},
            {"gain_um_per_unit", true, -term_gain_max, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<MissingHeatSource>(context);
          }};
}

}  // namespace thermocomp
