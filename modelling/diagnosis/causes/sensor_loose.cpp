#include <algorithm>

#include "modelling/diagnosis/causes/reading_fault.hpp"
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
Panel errors_K(const MeasuredData& data, const MeasuredRun& run, std::size_t input,
               const std::vector<double>& onsets_s) {
  const Column& reading_degC = run.inputs_degC[input];
  const Column* const room = room_degC(data, run);
  Column lost_K = double(reading_degC[0]) - reading_degC.array();
  if (room != nullptr) lost_K = *room - reading_degC;
  return lost_K.asDiagonal() * since(run.time_s, onsets_s);
}

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input_in_run) return {};
  const MeasuredData& data = material.data();
  if (room_among(data.model.inputs) == material.name_of(subject)) return {};
  Hypothesis loose =
      of_reading_fault(material, subject, {name, "at_s", "gain", 0.03, 40, errors_K});
  loose.bounds = [](std::size_t) { return Interval{lost_min, lost_max}; };
  loose.shrinks_reading = true;
  return {std::move(loose)};
}

/// Of what is lost, what is left.
std::vector<Parameter> gain(const FoundGains& found) {
  const std::size_t output = first_output(found);
  const Interval& lost = found.ci95[output].front();
  return {{"gain",
           {{"", kept(found.gains[output][0])}},
           {{"", {kept(lost.high), kept(std::max(lost.low, lost_min))}}}}};
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
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
