/// What replay and export share: the inputs in force while a segment's records pass, and the
/// history's own time. Only for the .cpp files of this folder.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "daemon/history/reading/history_reader.hpp"
#include "daemon/history/reading/sound_segments.hpp"
#include "daemon/history/replay/replay_setup.hpp"

namespace thermocomp {

/// The inputs of the estimator as they stood at a cycle.
struct InputsInForce {
  std::vector<Reading> readings;
  ControllerState controller;
  /// Takes over a reading, link, applied or signal record.
  /// @throws HistoryError when its index is impossible
  void apply(const Record& record);
  /// After lost records: nothing is known until it is recorded again.
  void forget();
};

/// @throws HistoryError when there are not as many readings as sensors
[[nodiscard]] InputsInForce inputs_at(const SegmentStart& start, const EstimatorConfig& config);

/// Seconds since the history's first cycle. Within a start of the daemon the grid counts; between
/// two of them the wall clock does, but time never runs backwards.
class HistoryClock {
 public:
  explicit HistoryClock(const HistoryReader& reader);
  [[nodiscard]] double seconds_at(const SegmentInfo& segment, std::uint64_t cycle) const;

 private:
  HistoryPlaces places_;
};

/// The setups of all segments, each parsed once.
class ParsedSetups {
 public:
  /// What cannot be parsed is told by of().
  ParsedSetups(const HistoryReader& reader, const SetupParser& parser);
  /// @throws HistoryError when the segment's configuration is missing or cannot be used
  [[nodiscard]] const ReplaySetup& of(const SegmentInfo& segment) const;
  [[nodiscard]] const std::map<std::int64_t, ReplaySetup>& all() const noexcept { return setups_; }

 private:
  std::map<std::int64_t, ReplaySetup> setups_;    ///< by setup, that is in order of appearance
  std::map<std::int64_t, std::string> failures_;  ///< of the others
};

/// A comment line of a run file.
[[nodiscard]] std::string damage_line(const HistoryDamage& damage);

/// Columns of a run file that is written row by row.
class RunColumns {
 public:
  /// The column of this name, made where there is none yet.
  std::size_t column(const std::string& name);
  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }

 private:
  std::vector<std::string> names_;
  std::map<std::string, std::size_t> indices_;
};

/// Appends a line; NaN becomes an empty field.
void append_row(std::string& text, const std::vector<double>& values);
void append_header(std::string& text, const std::vector<std::string>& names);

}  // namespace thermocomp
