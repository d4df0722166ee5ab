/// Common parts of replay and export: a segment's setup, its inputs as its records are read, its
/// estimator stepped through them, and the history's time.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "daemon/history/format/segments.hpp"
#include "daemon/history/reading/history_reader.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

[[nodiscard]] bool is_in_a_block(const EstimatorConfig& config, std::size_t sensor);

/// Configuration and model of a segment's estimator.
struct ReplaySetup {
  EstimatorConfig estimator;
  ThermalModel model;
  bool dry_run{false};  ///< offsets were not written to the controller
};
/// Texts -> configuration and model. The default parses them as the daemon does.
using SetupParser = std::function<ReplaySetup(const SegmentSetup&)>;
[[nodiscard]] ReplaySetup parse_setup(const SegmentSetup& setup);

/// The estimator's inputs at a cycle.
struct InputsInForce {
  std::vector<Reading> readings;
  ControllerState controller;
  /// Applies a reading, link, applied or signal record.
  /// @throws HistoryError when its index is impossible
  void apply(const Record& record);
  /// Call after lost records: all inputs are unknown until recorded again.
  void forget();
};

/// @throws HistoryError when the number of readings differs from that of the sensors
[[nodiscard]] InputsInForce inputs_at(const SegmentStart& start, const EstimatorConfig& config);

/// The setups of all segments, each parsed once.
class ParsedSetups {
 public:
  /// Parse errors are reported by of().
  ParsedSetups(const HistoryReader& reader, const SetupParser& parser);
  /// @throws HistoryError when the segment's configuration is missing or cannot be used
  [[nodiscard]] const ReplaySetup& of(const SegmentInfo& segment) const;
  /// nullptr when it cannot be used
  [[nodiscard]] const ReplaySetup* find(const SegmentInfo& segment) const;
  [[nodiscard]] const std::map<std::int64_t, ReplaySetup>& all() const noexcept { return setups_; }
  /// Parse errors, by setup.
  [[nodiscard]] const std::map<std::int64_t, std::string>& failures() const noexcept {
    return failures_;
  }

 private:
  std::map<std::int64_t, ReplaySetup> setups_;    ///< by setup, in order of appearance
  std::map<std::int64_t, std::string> failures_;  ///< by setup
};

/// Comment line of a run file.
[[nodiscard]] std::string damage_line(const HistoryDamage& damage);

/// Columns of a run file written row by row.
class RunColumns {
 public:
  /// Index of the column, created if missing.
  std::size_t column(const std::string& name);
  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }

 private:
  std::vector<std::string> names_;
  std::map<std::string, std::size_t> indices_;
};

/// Appends a line; NaN becomes an empty field.
void append_row(std::string& text, const std::vector<double>& values);
void append_header(std::string& text, const std::vector<std::string>& names);

/// Steps a segment's estimator; step() takes the next cycle and passes skipped ones.
class SegmentSteps {
 public:
  /// @throws HistoryError, std::runtime_error when the start state cannot be loaded
  SegmentSteps(const HistoryReader& reader, const SegmentInfo& segment, const ReplaySetup& setup);

  /// @return false after the last complete cycle. @throws HistoryError
  [[nodiscard]] bool step();
  /// Cycle and offsets of the last step.
  [[nodiscard]] bool has_stepped() const noexcept { return stepped_; }
  [[nodiscard]] std::uint64_t cycle() const noexcept { return cycle_; }
  [[nodiscard]] const OffsetCommand& command() const noexcept { return command_; }
  [[nodiscard]] const Estimator& estimator() const noexcept { return estimator_; }

  /// The next recorded offset of that cycle; null: none left.
  [[nodiscard]] const Record* noted_offset() const noexcept {
    const bool is_one =
        stepped_ && has_record_ && record_.cycle == cycle_ && record_.kind == RecordKind::offset;
    return is_one ? &record_ : nullptr;
  }
  void next() { has_record_ = cursor_.next(record_); }
  /// Call when the segment has grown.
  void extend(std::int64_t last_cycle) {
    segment_.last_cycle = last_cycle;
    cursor_.extend(last_cycle);
    if (!has_record_) next();
  }

 private:
  [[nodiscard]] std::uint64_t take_inputs(std::uint64_t cycle);

  SegmentInfo segment_;
  Estimator estimator_;
  RecordCursor cursor_;
  InputsInForce inputs_;
  OffsetCommand command_;
  std::uint64_t next_cycle_;
  std::uint64_t cycle_{0};
  bool stepped_{false};
  Record record_;
  bool has_record_{false};
};

}  // namespace thermocomp
