#include "modelling/diagnosis/causes/reading_fault.hpp"

#include "modelling/diagnosis/data/false_reading.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

/// Share of the run before which nothing is sought to have begun.
constexpr double last_onset = 0.95;

void write(const Material& material, const Subject& subject, ErrorOfReading error,
           std::size_t output, const Shapes& shapes, PanelPart into) {
  const MeasuredData& data = material.data();
  const MeasuredRun& run = data.runs[subject.run];
  Panel errors_K(run.rows(), std::ssize(shapes));
  for (std::size_t i = 0; i < shapes.size(); ++i)
    errors_K.col(static_cast<Eigen::Index>(i)) = error(data, run, subject.index, shapes[i][0]);
  answer_to_errors(data, run, output, subject.index, errors_K);
  const Block& block = material.rows().runs[subject.run];
  into.setZero();
  into.middleRows(block.begin, block.end - block.begin) =
      -errors_K.bottomRows(block.end - block.begin);
}

}  // namespace

Hypothesis of_reading_fault(const Material& material, const Subject& subject,
                            const ReadingFault& fault) {
  Hypothesis of{
      fault.cause,
      material.name_of(subject),
      Form::shared_gain,
      {{fault.onset, material.onsets_s(subject.run, fault.first, last_onset, fault.onsets)}},
      {fault.gain}};
  of.run = subject.run;
  of.sensor = subject.index;
  of.handicap = special_case_handicap;  // from the run's start on: a fault of the datum
  of.in_every_output = true;
  of.write_columns = [&material, subject, error = fault.error](const Shapes& shapes,
                                                               std::size_t output, PanelPart into) {
    write(material, subject, error, output, shapes, into);
  };
  return of;
}

void share_columns(Hypothesis& fault, const Material& material, const Subject& subject) {
  // With guideways the coefficient changes from row to row, terms answer late.
  const ThermalModel& model = material.data().model;
  if (!model.guideways.empty() || has_terms_of(model, subject.index)) return;
  fault.pattern = fault.cause + std::to_string(*fault.run);
  fault.scale = [&model, input = subject.index](std::size_t output) {
    return -model.matrix_um_per_K[output][input];
  };
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
