#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/false_reading.hpp"
#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis::causes {
namespace {

constexpr const char* name = "slow_sensor";
constexpr CauseParameter tau{"tau_s", "s", 20.0, 3600.0, "time constant"};
/// A derivative is taken of readings smoothed with this share of the time constant that it is for.
constexpr double slope_smoothing = 0.25;

std::vector<Hypothesis> of(const Material& material, const Subject& subject) {
  if (subject.kind != SubjectKind::input) return {};
  Hypothesis slow{name,
                  material.name_of(subject),
                  Form::no_gain,
                  {{std::string(tau.name), material.lag_times_s(tau.low, tau.high, 16), true}}};
  slow.columns = [&material, input = subject.index](const Shapes& shapes, std::size_t output) {
    return material.stacked([&](const MeasuredRun& run) {
      // A reading that is late misses tau times its slope.
      Panel missed_K(run.rows(), std::ssize(shapes));
      for (std::size_t i = 0; i < shapes.size(); ++i)
        missed_K.col(static_cast<Eigen::Index>(i)) =
            shapes[i][0] * slope(run.time_s, run.inputs_K[input], slope_smoothing * shapes[i][0]);
      return answer_to_errors(material.data(), run, output, input, missed_K);
    });
  };
  return {std::move(slow)};
}

constexpr double shortest_in_network_s = 30.0;

std::vector<NetworkHypothesis> in_network(const NetworkMaterial& material,
                                          const NetworkSubject& subject) {
  if (subject.kind != NetworkSubjectKind::sensor) return {};
  NetworkHypothesis slow;
  slow.hypothesis.cause = name;
  slow.hypothesis.subject = material.plant.network.sensors[subject.index].column;
  slow.hypothesis.form = Form::no_gain;
  slow.hypothesis.shape = {
      {std::string(tau.name), logarithmic_grid(shortest_in_network_s, tau.high, 12), true, false}};
  slow.hypothesis.output = subject.index;
  slow.apply = [sensor = subject.index](HeatNetwork& network, const Shape& shape, double gain) {
    network.sensors[sensor].lag_s += gain * shape[0];
  };
  return {std::move(slow)};
}

bool into_machine(MachineFile& machine, const std::string& subject,
                  const std::vector<Parameter>& parameters) {
  return machine.add_to_thermocouple(subject.substr(0, subject.rfind("_degC")), "lag_s",
                                     shared_value(parameters, "tau_s"));
}

}  // namespace

/// The reading is LP(T): the displacement leads it.
Cause slow_sensor() {
  Cause cause{name, "structure"};
  cause.parameters = {tau};
  cause.texts = {
      "A sensor follows its place late",
      "the displacement leads the reading: the sensor follows its place late",
      "Look at how the sensor is mounted (paste, clamp, tape); until then use the extended model."};
  cause.experiment = Experiment::up_and_down;
  cause.term = name;
  cause.hypotheses = of;
  cause.in_network = in_network;
  cause.into_machine = into_machine;
  return cause;
}

}  // namespace thermocomp::diagnosis::causes
