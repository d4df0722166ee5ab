#include "modelling/diagnosis/causes/reading_fault.hpp"

#include "modelling/diagnosis/data/false_reading.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

/// Share of the run before which nothing is sought to have begun.
constexpr double last_onset = 0.95;

}  // namespace

Hypothesis of_reading_fault(const Material& material, const Subject& subject,
                            const ReadingFault& fault) {
  const MeasuredRun& run = material.data().runs[subject.run];
  Hypothesis of{fault.cause,
                material.name_of(subject),
                Form::shared_gain,
                {{fault.onset, material.onsets_s(subject.run, fault.first, last_onset, fault.onsets,
                                                 run.inputs_K[subject.index])}},
                {fault.gain}};
  of.run = subject.run;
  of.sensor = subject.index;
  const auto errors_K = [&material, &run, input = subject.index,
                         error = fault.error](const Shapes& shapes) {
    return error(material.data(), run, input, firsts_of(shapes));
  };
  of.errors_K = [&material, number = subject.run, errors_K](const Shapes& shapes) {
    return material.in_run(number, errors_K(shapes));
  };
  of.columns = [&material, &run, subject, errors_K](const Shapes& shapes, std::size_t output) {
    return material.in_run(subject.run, -answer_to_errors(material.data(), run, output,
                                                          subject.index, errors_K(shapes)));
  };
  return of;
}

NetworkHypothesis of_reading_in_network(
    const NetworkMaterial& material, const NetworkSubject& subject, const char* cause,
    const char* gain, std::function<double(double time_s, const Shape& shape)> value) {
  NetworkHypothesis of;
  of.hypothesis.cause = cause;
  of.hypothesis.subject = material.plant.network.sensors[subject.index].column;
  of.hypothesis.gains = {gain};
  of.hypothesis.output = subject.index;
  of.hypothesis.run = subject.second;
  of.fault = [&rows = material.rows, run = subject.second,
              value = std::move(value)](const Shape& shape) {
    Column column = Column::Zero(rows.time_s.size());
    for (Eigen::Index row = rows.runs[run].begin; row < rows.runs[run].end; ++row)
      column[row] = value(rows.time_s[row], shape);
    return column;
  };
  return of;
}

std::vector<double> inner_times_s(const NetworkMaterial& material, std::size_t run,
                                  std::size_t count) {
  const Block& block = material.rows.runs[run];
  const double first_s = material.rows.time_s[block.begin];
  const double length_s = material.rows.time_s[block.end - 1] - first_s;
  std::vector<double> times_s;
  for (std::size_t i = 1; i <= count; ++i)
    times_s.push_back(first_s + length_s * static_cast<double>(i) / static_cast<double>(count + 1));
  return times_s;
}

}  // namespace thermocomp::diagnosis::causes
