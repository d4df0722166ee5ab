#include "modelling/diagnosis/causes/reading_fault.hpp"
#include "modelling/diagnosis/data/false_reading.hpp"
#include "modelling/diagnosis/data/room.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "sensor_loose";
/// 1 / gain - 1: what is lost of the motion, over what is left.
constexpr double lost_min = 0.02;
constexpr double lost_max = 20.0;

double kept(double lost) {
  return 1.0 / (1.0 + lost);
}

/// reading = room + gain (T - room): the reading misses (1 / gain - 1) (reading - room), from the
/// onset on. Without a column of the room, its first value stands for it.
Column error_K(const MeasuredData& data, const MeasuredRun& run, std::size_t input,
               double onset_s) {
  const Column since = (run.time_s.array() >= onset_s).cast<double>();
  const Column& reading_degC = run.inputs_degC[input];
  const Column* const room = room_degC(data, run);
  Column lost_K = double(reading_degC[0]) - reading_degC.array();
  if (room != nullptr) lost_K = *room - reading_degC;
  return since.cwiseProduct(lost_K);
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input_in_run) return {};
  const MeasuredData& data = material.data();
  if (room_among(data.model.inputs) == material.name_of(subject)) return {};
  Hypothesis loose = of_reading_fault(material, subject, {name, "at_s", "gain", 0.03, 48, error_K});
  loose.possible = [](double lost, std::size_t) { return lost > lost_min && lost < lost_max; };
  if (has_terms_of(data.model, subject.index)) return {std::move(loose)};
  const auto whole = [&data, subject](std::size_t output) -> Column {
    const MeasuredRun& run = data.runs[subject.run];
    const Column lost_K = error_K(data, run, subject.index, run.time_s[0]);
    return -data.coefficient(run, output, subject.index).cwiseProduct(lost_K);
  };
  loose.write_columns = [&material, subject, whole](const Shapes& shapes, std::size_t output,
                                                    PanelPart into) {
    material.write_since(subject.run, firsts_of(shapes), whole(output), into);
  };
  loose.from_onset = [&material, subject, whole](std::size_t output) {
    return material.in_run(subject.run, [&](const MeasuredRun&) { return whole(output); });
  };
  return {std::move(loose)};
}

/// Of what is lost, what is left.
std::vector<Parameter> gain(const FoundGains& found) {
  const std::size_t output = first_output(found);
  const double left = kept(found.gains[output][0]);
  return {{"gain", {{"", left}}, {{"", around(left, found.reach[output][0] * left * left)}}}};
}

}  // namespace

/// From a time on the reading is room + gain (T - room).
Cause sensor_loose() {
  Cause cause{name, "sensor"};
  cause.parameters = {{.name = "at_s",
                       .unit = "s",
                       .says = "from the start of the recording on",
                       .of_a_jump = true},
                      {.name = "gain",
                       .unit = "1",
                       .low = kept(lost_max),
                       .high = kept(lost_min),
                       .says = "of its motion left:",
                       .of_a_jump = true}};
  cause.texts = {"A sensor has come loose",
                 "from a time on this sensor shows more of the room than of its place",
                 "Fasten the sensor; leave the rest of the run out of any fit."};
  cause.experiment = Experiment::another_run;
  cause.hypotheses = of;
  cause.gains = gain;
  cause.error_of_reading = error_K;
  cause.shrinks_reading = true;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
