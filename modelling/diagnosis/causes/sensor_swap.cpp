#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/false_reading.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "sensor_swap";

Hypothesis exchanged(const Material& material, std::size_t input, std::size_t other) {
  const MeasuredData& data = material.data();
  Hypothesis swap{name, data.model.inputs[input] + "|" + data.model.inputs[other], Form::no_gain};
  swap.columns = [&material, &data, input, other](const Shapes&, std::size_t output) {
    return material.stacked([&](const MeasuredRun& run) -> Panel {
      const Panel more_K = run.calm_inputs_K[other] - run.calm_inputs_K[input];
      return answer_to_errors(data, run, output, input, more_K) +
             answer_to_errors(data, run, output, other, -more_K);
    });
  };
  return swap;
}

/// With each input that comes later in the alphabet.
std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  const auto& inputs = material.data().model.inputs;
  std::vector<Hypothesis> all;
  for (std::size_t other = 0; other < inputs.size(); ++other)
    if (inputs[subject.index] < inputs[other])
      all.push_back(exchanged(material, subject.index, other));
  return all;
}

}  // namespace

/// Two channels are exchanged: the coefficient of each meets the temperature of the other.
Cause sensor_swap() {
  Cause cause{name, "sensor"};
  cause.texts = {"Two channels are exchanged", "these two channels are exchanged",
                 "Exchange the two plugs or the two names in the configuration."};
  cause.experiment = Experiment::steady_levels;
  cause.term = name;
  cause.hypotheses = of;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
