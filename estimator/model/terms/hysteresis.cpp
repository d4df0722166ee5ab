#include "estimator/model/terms/play.hpp"
#include "estimator/model/terms/term.hpp"

namespace thermocomp {
namespace {

/// Play in a joint between the model's displacement and the real one: an output follows the sum of
/// matrix, guideways and terms only after the play is used up.
class OutputHysteresis final : public Term {
 public:
  explicit OutputHysteresis(const TermContext& context)
      : subject_(context.subject), joint_(context.shared("width_um")) {}

  void correct_displacement(std::span<double> displacement_um) noexcept override {
    displacement_um[subject_] = joint_.step(displacement_um[subject_]);
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void restart() noexcept override { joint_.restart(); }
  void visit_state(StateArchive& archive) override { archive(joint_); }

 private:
  std::size_t subject_;
  Play joint_;
};

/// Play of the part of the structure that one temperature moves: T becomes play(T).
class TemperatureHysteresis final : public Term {
 public:
  explicit TemperatureHysteresis(const TermContext& context)
      : subject_(context.subject), joint_(context.shared("width_K")) {}

  void correct_rise(nanoseconds /*now*/, std::span<double> rise_K) noexcept override {
    rise_K[subject_] = joint_.step(rise_K[subject_]);
  }
  void add_slope(const TermInput& /*input*/, std::size_t /*output*/,
                 std::span<double> /*slope_um_per_K*/) const noexcept override {}
  void restart() noexcept override { joint_.restart(); }
  void visit_state(StateArchive& archive) override { archive(joint_); }

 private:
  std::size_t subject_;
  Play joint_;
};

}  // namespace

TermRegistration output_hysteresis_registration() {
  return {{"hysteresis", TermSubject::output, {{"width_um", false, 0, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<OutputHysteresis>(context);
          }};
}

TermRegistration temperature_hysteresis_registration() {
  return {{"hysteresis", TermSubject::model_temperature, {{"width_K", false, 0, term_gain_max}}},
          [](const TermContext& context) -> std::unique_ptr<Term> {
            return std::make_unique<TemperatureHysteresis>(context);
          }};
}

}  // namespace thermocomp
