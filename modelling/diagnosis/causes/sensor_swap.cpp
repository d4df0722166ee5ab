#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/false_reading.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "sensor_swap";

void write_through_terms(const Material& material, std::size_t input, std::size_t other,
                         std::size_t output, PanelPart into) {
  const MeasuredData& data = material.data();
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const MeasuredRun& run = data.runs[i];
    const Block& block = material.rows().runs[i];
    Panel of_input = run.calm_inputs_K[other] - run.calm_inputs_K[input];
    Panel of_other = -of_input;
    answer_to_errors(data, run, output, input, of_input);
    answer_to_errors(data, run, output, other, of_other);
    into.middleRows(block.begin, block.end - block.begin) =
        (of_input + of_other).bottomRows(block.end - block.begin);
  }
}

void write_through_coefficients(const Material& material, std::size_t input, std::size_t other,
                                std::size_t output, PanelPart into) {
  const MeasuredData& data = material.data();
  for (std::size_t i = 0; i < data.runs.size(); ++i) {
    const MeasuredRun& run = data.runs[i];
    const Block& block = material.rows().runs[i];
    const Eigen::Index count = block.end - block.begin;
    into.col(0).segment(block.begin, count) =
        (data.coefficient(run, output, input) - data.coefficient(run, output, other))
            .cwiseProduct(run.calm_inputs_K[other] - run.calm_inputs_K[input])
            .tail(count);
  }
}

Hypothesis exchanged(const Material& material, std::size_t input, std::size_t other) {
  const ThermalModel& model = material.data().model;
  Hypothesis swap{name, model.inputs[input] + "|" + model.inputs[other], Form::no_gain};
  swap.in_every_output = true;
  const bool has_terms = has_terms_of(model, input) || has_terms_of(model, other);
  if (model.guideways.empty() && !has_terms)
    swap.of_readings = [&model, input, other](std::size_t output) {
      const auto& coefficients = model.matrix_um_per_K[output];
      const double weight = coefficients[input] - coefficients[other];
      return std::vector<ReadingShare>{{other, weight}, {input, -weight}};
    };
  const auto write = has_terms ? write_through_terms : write_through_coefficients;
  swap.write_columns = [&material, write, input, other](const Shapes&, std::size_t output,
                                                        PanelPart into) {
    write(material, input, other, output, into);
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
  cause.taken_by_fit = TakenByFit::all;
  cause.hypotheses = of;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
