/// The rows of an exported run file, segment by segment. Only for the .cpp files of this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/history/replay/replay.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// Where the values of one configuration go.
struct ExportPlaces {
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  std::vector<std::size_t> inputs;  ///< temperatures of the model; none with ExportContent::sensors
  std::vector<std::size_t> sensors;  ///< none: the sensor is known by its block's input
  std::vector<std::size_t> signals;
  std::vector<std::size_t> displacement;  ///< by axis; none where nothing was probed
  std::vector<std::size_t> offsets;
  std::vector<std::size_t> applied;
  std::vector<std::size_t> measured;
};

/// Makes the columns of a configuration.
/// @param probed  by axis: whether a displacement of it was measured somewhere in the file
[[nodiscard]] ExportPlaces export_places(const ReplaySetup& setup, ExportContent content,
                                         const std::vector<bool>& probed, RunColumns& columns);

/// A displacement that an operator or a probe gave.
struct ExportedProbing {
  std::size_t axis{0};
  std::int64_t wall_ns{0};               ///< when the tool was there
  double measured_um{not_a_number};      ///< as it was given
  double displacement_um{not_a_number};  ///< without the offset in effect
  double modelled_um{not_a_number};      ///< of the model alone; NaN: not known
  double claimed_um{not_a_number};       ///< standard deviation that the model states; NaN: none
  double sd_um{not_a_number};            ///< NaN: as configured
  MeasuredSource source{MeasuredSource::probe};
};

/// Marks the axes of which an operator measured a displacement in this segment. What cannot be read
/// is not reported here but by the export itself.
void note_probed(const HistoryReader& reader, const SegmentInfo& segment,
                 std::vector<bool>& probed) noexcept;

/// Walks through a segment, from one cycle whose offsets were noted to the next. Beside it the
/// estimator is stepped as in a replay, so that the inputs are those that the daemon computed with.
class SegmentExport {
 public:
  /// @param damage  what is found on the way
  /// @throws HistoryError when its start cannot be used
  SegmentExport(const HistoryReader& reader, const SegmentInfo& segment, const ReplaySetup& setup,
                const ExportPlaces& places, std::vector<HistoryDamage>& damage);

  /// Goes on to the next cycle whose offsets were noted. @return false when there is none
  bool next(std::uint64_t& cycle);
  [[nodiscard]] std::int64_t wall_ns(std::uint64_t cycle) const;

  /// @param row     all missing before
  /// @param cycle   what next() gave
  void fill(std::vector<double>& row, std::uint64_t cycle);
  /// Since the last call: faults that begin and end, and commands; one text each.
  [[nodiscard]] std::vector<std::string> happened();
  /// What was measured between the fill() before and the last one.
  [[nodiscard]] std::vector<ExportedProbing> probings();
  /// The segment has grown: next() goes on.
  void extend(std::int64_t last_cycle);
  /// The cycle that next() gave is not wanted, nor what was commanded before it.
  void skip();

 private:
  void note(const std::string& why);
  void advance();
  void take_input();
  void take_offsets();
  void take_command();
  void take_measured();
  [[nodiscard]] double effect_um(std::size_t axis) const;
  void follow(std::uint64_t cycle);
  void give_up_following(const std::string& why);
  void fill_inputs(std::vector<double>& row);
  void tell_faults();
  [[nodiscard]] Fault fault_of(std::size_t sensor) const;

  SegmentInfo segment_;
  const EstimatorConfig& config_;
  const ThermalModel& model_;
  const bool dry_run_;
  const ExportPlaces& places_;
  std::vector<HistoryDamage>& damage_;
  int reported_{0};
  RecordCursor cursor_;
  InputsInForce inputs_;
  std::array<double, axes_max> offset_um_{};
  std::array<double, axes_max> measured_um_{};      ///< as the operator said it
  std::array<double, axes_max> displacement_um_{};  ///< ... without the offset in effect
  Record record_;
  bool has_record_{false};
  std::unique_ptr<SegmentSteps> steps_;  ///< null once it cannot be stepped any more
  Report report_;
  std::vector<Fault> faults_reported_;
  std::vector<std::string> happened_;
  std::vector<ExportedProbing> probings_;
  std::string not_followed_;  ///< why the estimator is not stepped any more, until it is reported
};

}  // namespace thermocomp
