#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// A slow sensor: its rise is replaced by that of a quick one.
class SlowSensor final : public Term {
 public:
  explicit SlowSensor(const TermContext& context)
      : subject_(context.subject), quick_(context.shared("tau_s")) {}

  void correct_rise(nanoseconds now, std::span<double> rise_K) noexcept override {
    rise_K[subject_] = quick_.step(now, rise_K[subject_]);
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void restart() noexcept override { quick_.restart(); }
  void visit_state(StateArchive& archive) override { archive(quick_); }

 private:
  std::size_t subject_;
  Lead quick_;
};

}  // namespace

TermRegistration slow_sensor_registration() {
  return {{"slow_sensor",
           TermSubject::model_temperature,
           {{"tau_s", false, term_tau_s_min, term_tau_s_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<SlowSensor>(context);
          }};
}

}  // namespace thermocomp
