/// The answers of the status socket as plain structures, and their JSON.
///
/// `fields` gives each member its key in JSON; daemon/status fills it, each view shows it. Lengths
/// without a unit in their name are in the axis' unit. NaN: unknown (null in JSON). docs/socket.md
/// shows the JSON.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "estimator/types.hpp"
#include "status/event.hpp"

namespace thermocomp {

/// A read-back that no sent offset explains.
struct LatchedMismatch {
  double sent_um{not_a_number};
  double read_um{not_a_number};
  std::string likely{};   ///< text
  bool releasing{false};  ///< released; read-backs are being checked

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("sent_um", self.sent_um);
    visit("read_um", self.read_um);
    visit("likely", self.likely);
    visit("releasing", self.releasing);
  }
};

/// A probing of which the model explains less than half.
struct UnexplainedProbing {
  double measured{not_a_number};  ///< displacement without the offset
  double modelled{not_a_number};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("measured", self.measured);
    visit("modelled", self.modelled);
  }
};

struct GainStatus {
  std::vector<std::string> inputs{};
  double gain{not_a_number};
  double sd{not_a_number};
  std::optional<double> used{};  ///< this and the next two: if the model has a recorded course
  std::optional<double> recorded{};
  std::optional<double> recorded_sd{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("inputs", self.inputs);
    visit("gain", self.gain);
    visit("sd", self.sd);
    visit.if_any("used", self.used);
    visit.if_any("recorded", self.recorded);
    visit.if_any("recorded_sd", self.recorded_sd);
  }
};

/// The running correction of an axis.
struct CorrectionStatus {
  std::string form{};  ///< "two_phase", "recursive", "constant"
  std::vector<GainStatus> gains{};
  double bias_um{not_a_number};
  double sd_um{not_a_number};
  bool probing_wanted{false};
  std::uint64_t phase{0};
  std::uint64_t taken{0};
  std::uint64_t refused{0};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("form", self.form);
    visit("gains", self.gains);
    visit("bias_um", self.bias_um);
    visit("sd_um", self.sd_um);
    visit("probing_wanted", self.probing_wanted);
    visit("phase", self.phase);
    visit("taken", self.taken);
    visit("refused", self.refused);
  }
};

struct AxisStatus {
  std::string name{};
  std::string unit{"um"};
  double displacement{not_a_number};
  double target{not_a_number};
  double offset{not_a_number};      ///< sent
  double offset_max{not_a_number};  ///< bound of |offset|
  double applied{not_a_number};     ///< read-back
  double measured{not_a_number};    ///< last command `measured`
  bool synced{false};
  bool driven{false};
  bool disagrees{false};  ///< the read-back differs from the sent offset
  std::optional<LatchedMismatch> latched{};
  bool at_bound{false};
  bool proving{false};
  double offset_sd{not_a_number};  ///< standard deviation due to estimated blocks
  double offset_sd_max{not_a_number};
  /// Source of the last sent offset at start: "read_back", "registers", "record", "corridor",
  /// "released" (set to zero by an operator), "unknown".
  std::string start{"unknown"};
  std::optional<std::string> axis{};  ///< of a node: the axis' own name
  std::optional<double> at_mm{};      ///< of a node: its position
  std::optional<double> held{};       ///< update = each_cycle: displacement at the held state
  std::optional<CorrectionStatus> correction{};
  std::optional<UnexplainedProbing> unexplained{};  ///< the last probing, if nothing learns from it

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    visit("unit", self.unit);
    visit("displacement", self.displacement);
    visit("target", self.target);
    visit("offset", self.offset);
    visit("offset_max", self.offset_max);
    visit("applied", self.applied);
    visit("measured", self.measured);
    visit("synced", self.synced);
    visit("driven", self.driven);
    visit("disagrees", self.disagrees);
    visit("mismatch", self.latched);
    visit("at_bound", self.at_bound);
    visit("proving", self.proving);
    visit("offset_sd", self.offset_sd);
    visit("offset_sd_max", self.offset_sd_max);
    visit("start", self.start);
    visit.if_any("axis", self.axis);
    visit.if_any("at_mm", self.at_mm);
    visit.if_any("held", self.held);
    visit.if_any("correction", self.correction);
    visit.if_any("unexplained", self.unexplained);
  }
};

/// A temperature column of the model.
struct InputStatus {
  std::string name{};
  double temp_degC{not_a_number};
  double reference_degC{not_a_number};
  bool good{false};
  std::string block{};
  bool estimated{false};
  double sd_K{not_a_number};  ///< of the estimate
  double rate_K_per_h{not_a_number};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    visit("temp_degC", self.temp_degC);
    visit("reference_degC", self.reference_degC);
    visit("good", self.good);
    visit("block", self.block);
    visit("estimated", self.estimated);
    visit("sd_K", self.sd_K);
    visit("rate_K_per_h", self.rate_K_per_h);
  }
};

/// Error of a sensor, estimated from its neighbours.
struct SensorError {
  double size_K{not_a_number};
  double since{not_a_number};  ///< wall clock, s since 1970
  bool weighed_down{false};    ///< not used in its blocks

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("size_K", self.size_K);
    visit("since", self.since);
    visit("weighed_down", self.weighed_down);
  }
};

struct SuspectedSensor {
  std::string name{};
  SensorError suspicion{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    SensorError::fields(self.suspicion, visit);
  }
};

/// Unconfirmed change of a sensor.
struct Jump {
  double size_K{not_a_number};
  double since{not_a_number};  ///< wall clock, s since 1970

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("size_K", self.size_K);
    visit("since", self.since);
  }
};

struct JumpedSensor {
  std::string name{};
  Jump jump{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    Jump::fields(self.jump, visit);
  }
};

/// Sensors whose new values are not yet confirmed.
struct Confirmation {
  std::vector<std::string> sensors{};
  double settle_s{not_a_number};
  std::string one_value_of{};  ///< module whose channels all show one value; empty: none

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("sensors", self.sensors);
    visit("settle_s", self.settle_s);
    visit("one_value_of", self.one_value_of);
  }
};

/// A module that repeats its values, which were noisy before.
struct FrozenModule {
  std::string name{};
  double same_s{not_a_number};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    visit("same_s", self.same_s);
  }
};

struct SensorStatus {
  std::string name{};
  std::vector<std::string> blocks{};
  double raw_degC{not_a_number};
  double smoothed_degC{not_a_number};
  Fault fault{Fault::never_read};
  double age_s{not_a_number};
  std::uint64_t clipped_in_a_row{0};
  std::uint64_t clipped{0};
  std::uint64_t rejected{0};
  std::optional<SensorError> suspected{};
  std::optional<Jump> jump{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    visit("blocks", self.blocks);
    visit("raw_degC", self.raw_degC);
    visit("smoothed_degC", self.smoothed_degC);
    visit("fault", self.fault);
    visit("age_s", self.age_s);
    visit("clipped_in_a_row", self.clipped_in_a_row);
    visit("clipped", self.clipped);
    visit("rejected", self.rejected);
    visit("suspected", self.suspected);
    visit("jump", self.jump);
  }
};

struct UnitStatus {
  std::string name{};
  bool answering{false};
  std::uint64_t requests{0};
  std::uint64_t answers{0};
  std::uint64_t timeouts{0};
  std::uint64_t exceptions{0};
  std::uint64_t bad_frames{0};
  double round_trip_ms{not_a_number};
  std::string last_error{};
  std::vector<std::string> sensors{};  ///< read by this unit
  std::vector<std::string> blocks{};   ///< of these sensors
  double silent_s{not_a_number};       ///< age of the newest reading

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    visit("answering", self.answering);
    visit("requests", self.requests);
    visit("answers", self.answers);
    visit("timeouts", self.timeouts);
    visit("exceptions", self.exceptions);
    visit("bad_frames", self.bad_frames);
    visit("round_trip_ms", self.round_trip_ms);
    visit("last_error", self.last_error);
    visit("sensors", self.sensors);
    visit("blocks", self.blocks);
    visit("silent_s", self.silent_s);
  }
};

struct BusStatus {
  std::string name{};
  std::string kind{};
  bool connected{false};
  std::uint64_t connects{0};
  std::string last_error{};
  std::vector<UnitStatus> units{};
  std::optional<std::string> state{};  ///< this and the following: CAN interface only
  std::optional<double> state_s{};     ///< time in that state
  std::optional<std::uint64_t> error_frames{};
  std::optional<std::uint64_t> bus_offs{};
  std::optional<std::uint64_t> restarts{};
  std::optional<std::uint64_t> dropped{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    visit("kind", self.kind);
    visit("connected", self.connected);
    visit("connects", self.connects);
    visit("last_error", self.last_error);
    visit("units", self.units);
    visit.if_any("state", self.state);
    visit.if_any("state_s", self.state_s);
    visit.if_any("error_frames", self.error_frames);
    visit.if_any("bus_offs", self.bus_offs);
    visit.if_any("restarts", self.restarts);
    visit.if_any("dropped", self.dropped);
  }
};

/// Writes of offsets to the controller.
struct WriteStatus {
  std::uint64_t refused{0};     ///< writes that the controller answered with an exception
  std::uint64_t unanswered{0};  ///< writes without an answer
  std::uint64_t late{0};        ///< writes later than their period
  std::optional<std::uint64_t> function{};  ///< this and the next two: newest failed write
  std::optional<std::uint64_t> address{};
  std::optional<std::uint64_t> exception{};
  double last_confirmed_s{not_a_number};  ///< time since the newest confirmed write; NaN: none

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("refused", self.refused);
    visit("unanswered", self.unanswered);
    visit("late", self.late);
    visit("function", self.function);
    visit("address", self.address);
    visit("exception", self.exception);
    visit("last_confirmed_s", self.last_confirmed_s);
  }
};

struct ControllerStatus {
  std::string name{};
  std::string kind{};
  bool connected{false};
  bool online{false};
  std::uint64_t connects{0};
  std::uint64_t writes{0};
  std::uint64_t write_errors{0};
  std::uint64_t reads{0};
  std::uint64_t read_errors{0};
  std::string last_error{};
  WriteStatus write{};
  std::map<std::string, double> signals{};
  std::optional<std::map<std::string, double>>
      shown{};                         ///< dry run: offset applied by the controller itself
  std::optional<std::string> state{};  ///< this and the following: CAN interface only
  std::optional<double> state_s{};
  std::optional<std::uint64_t> bus_offs{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("name", self.name);
    visit("kind", self.kind);
    visit("connected", self.connected);
    visit("online", self.online);
    visit("connects", self.connects);
    visit("writes", self.writes);
    visit("write_errors", self.write_errors);
    visit("reads", self.reads);
    visit("read_errors", self.read_errors);
    visit("last_error", self.last_error);
    visit("write", self.write);
    visit("signals", self.signals);
    visit.if_any("shown", self.shown);
    visit.if_any("state", self.state);
    visit.if_any("state_s", self.state_s);
    visit.if_any("bus_offs", self.bus_offs);
  }
};

struct HistoryStatus {
  bool enabled{false};
  std::string file{};
  bool working{false};
  double size_MB{not_a_number};
  double last_commit_age_s{not_a_number};
  std::uint64_t lost_records{0};
  std::uint64_t errors{0};
  std::uint64_t deleted_segments{0};  ///< deleted for size or age, since the start
  std::uint64_t files_replaced{
      0};  ///< times that a file was removed or replaced by another program
  std::string last_error{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("enabled", self.enabled);
    visit("file", self.file);
    visit("working", self.working);
    visit("size_MB", self.size_MB);
    visit("last_commit_age_s", self.last_commit_age_s);
    visit("lost_records", self.lost_records);
    visit("errors", self.errors);
    visit("deleted_segments", self.deleted_segments);
    visit("files_replaced", self.files_replaced);
    visit("last_error", self.last_error);
  }
};

struct SocketStatus {
  std::uint64_t clients{0};
  std::uint64_t accepted{0};
  std::uint64_t refused{0};
  std::uint64_t requests{0};
  std::uint64_t errors{0};
  std::uint64_t cut_off{0};
  std::uint64_t delayed{0};
  std::uint64_t missed_notifications{0};
  std::uint64_t buffered_bytes{0};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("clients", self.clients);
    visit("accepted", self.accepted);
    visit("refused", self.refused);
    visit("requests", self.requests);
    visit("errors", self.errors);
    visit("cut_off", self.cut_off);
    visit("delayed", self.delayed);
    visit("missed_notifications", self.missed_notifications);
    visit("buffered_bytes", self.buffered_bytes);
  }
};

/// The answer of `timing`.
struct CycleStatus {
  std::uint64_t count{0};
  std::uint64_t missed{0};
  double rate_hz{not_a_number};
  double lateness_us_p50{not_a_number};
  double lateness_us_p99{not_a_number};
  double lateness_us_p999{not_a_number};
  double lateness_us_max{not_a_number};
  double work_us_p50{not_a_number};
  double work_us_p999{not_a_number};
  double work_us_max{not_a_number};
  bool real_time{false};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("count", self.count);
    visit("missed", self.missed);
    visit("rate_hz", self.rate_hz);
    visit("lateness_us_p50", self.lateness_us_p50);
    visit("lateness_us_p99", self.lateness_us_p99);
    visit("lateness_us_p999", self.lateness_us_p999);
    visit("lateness_us_max", self.lateness_us_max);
    visit("work_us_p50", self.work_us_p50);
    visit("work_us_p999", self.work_us_p999);
    visit("work_us_max", self.work_us_max);
    visit("real_time", self.real_time);
  }
};

struct ModelStatus {
  std::string file{};
  std::string checksum{};
  std::uint64_t inputs{0};
  std::uint64_t outputs{0};
  bool moves{true};  ///< some coefficient is not zero, or a bias is learned; `init` writes zeros
  /// Axes with all coefficients zero, unless all axes are.
  std::vector<std::string> still{};
  bool compared{true};            ///< with measured displacement, according to its file
  std::optional<bool> outside{};  ///< of its domain
  double outside_share_24h{not_a_number};
  std::map<std::string, double> claimed_sd_um{};  ///< by axis; also the next
  std::map<std::string, double> probed_rms_um{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("file", self.file);
    visit("checksum", self.checksum);
    visit("inputs", self.inputs);
    visit("outputs", self.outputs);
    visit("moves", self.moves);
    visit("still", self.still);
    visit("compared", self.compared);
    visit("outside", self.outside);
    visit("outside_share_24h", self.outside_share_24h);
    visit("claimed_sd_um", self.claimed_sd_um);
    visit("probed_rms_um", self.probed_rms_um);
  }
};

/// Displacement still to come if the load stays constant.
struct WarmStatus {
  double remaining_um{not_a_number};
  double minutes{not_a_number};  ///< until less than compensation.warm_um remains

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("remaining_um", self.remaining_um);
    visit("minutes", self.minutes);
  }
};

/// Axes whose model error requests a probing.
struct ProbeDueStatus {
  std::map<std::string, bool> axes{};
  double because_um{not_a_number};  ///< largest error of the model

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit.members("because_um", self.axes);
    visit("because_um", self.because_um);
  }
};

struct ReferenceStatus {
  std::optional<std::string> by{};  ///< "model_file", "operator", "first_values", "reload"
  double wall_s{not_a_number};      ///< time when it was taken, s since 1970
  bool lost{false};
  std::string changed{};  ///< "bed_degC +12.0 K/h": the machine was not even when it was taken
  std::map<std::string, double> temps_degC{};
  std::vector<std::string> objections{};  ///< reasons against taking one now, one sentence each

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("by", self.by);
    visit("wall_s", self.wall_s);
    visit("lost", self.lost);
    visit("changed", self.changed);
    visit("temps_degC", self.temps_degC);
    visit("objections", self.objections);
  }
};

/// The answer of `status`.
struct Status {
  Mode mode{Mode::starting};  ///< "dry_run" in JSON for `compensating` in a dry run
  bool dry_run{false};
  double mode_since_s{not_a_number};
  double compensating_s{not_a_number};  ///< time for which every axis has been driven too
  bool enabled{false};
  std::uint32_t reasons{0};  ///< a set of Reason
  std::uint64_t cycle_ends{0};
  std::string version{};
  double uptime_s{not_a_number};
  CycleStatus cycle{};
  ModelStatus model{};
  std::optional<CandidateStatus> candidate{};
  std::vector<AxisStatus> axes{};
  std::optional<ProbeDueStatus> probe_due{};  ///< none: the model has no data on its error
  std::map<std::string, WarmStatus> warm{};   ///< by axis
  std::vector<InputStatus> inputs{};
  ReferenceStatus reference{};
  std::vector<std::string> sensors_bad{};
  std::vector<JumpedSensor> sensors_jumped{};
  std::vector<SuspectedSensor> sensors_suspected{};
  std::vector<Confirmation> confirming{};  ///< an input has no value until they count
  std::vector<FrozenModule> modules_frozen{};
  std::vector<BusStatus> buses{};
  ControllerStatus controller{};
  HistoryStatus history{};
  SocketStatus socket{};
  std::vector<Event> ended{};  ///< outages ended in the last minutes, newest first
  std::vector<std::string> warnings{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("warnings", self.warnings);
    visit("dry_run", self.dry_run);
    visit.mode("mode", self.mode, self.dry_run);
    visit("mode_since_s", self.mode_since_s);
    visit("compensating_s", self.compensating_s);
    visit("enabled", self.enabled);
    visit.reasons("reasons", self.reasons, self.warnings);
    visit("cycle_ends", self.cycle_ends);
    visit("version", self.version);
    visit("uptime_s", self.uptime_s);
    visit("cycle", self.cycle);
    visit("model", self.model);
    visit.if_any("candidate", self.candidate);
    visit("axes", self.axes);
    visit.if_any("probe_due", self.probe_due);
    visit("warm", self.warm);
    visit("inputs", self.inputs);
    visit("reference", self.reference);
    visit("sensors_bad", self.sensors_bad);
    visit("sensors_jumped", self.sensors_jumped);
    visit("sensors_suspected", self.sensors_suspected);
    visit("confirming", self.confirming);
    visit("modules_frozen", self.modules_frozen);
    visit("buses", self.buses);
    visit("controller", self.controller);
    visit("history", self.history);
    visit("socket", self.socket);
    visit("ended", self.ended);
  }
};

/// The answer of `sensors`.
struct SensorsAnswer {
  std::vector<SensorStatus> sensors{};
  std::vector<InputStatus> inputs{};
  std::vector<AxisStatus> axes{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("sensors", self.sensors);
    visit("inputs", self.inputs);
    visit("axes", self.axes);
  }
};

/// The answer of `offsets`.
struct OffsetsAnswer {
  Mode mode{Mode::starting};
  bool dry_run{false};
  std::vector<AxisStatus> axes{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("dry_run", self.dry_run);
    visit.mode("mode", self.mode, self.dry_run);
    visit("axes", self.axes);
  }
};

/// The answer of `events`, oldest first.
struct EventsAnswer {
  std::vector<Event> events{};

  template <class Self, class Visitor>
  static void fields(Self& self, Visitor& visit) {
    visit("events", self.events);
  }
};

/// For any structure with `fields`, Event, and vectors of them.
template <class Part>
[[nodiscard]] nlohmann::json json_of(const Part& part);

/// Accepts any JSON: missing members and those of another type keep the structure's defaults. A
/// text is reduced to one line. An unknown reason becomes a warning.
template <class Part>
[[nodiscard]] Part part_from(const nlohmann::json& value);

}  // namespace thermocomp
