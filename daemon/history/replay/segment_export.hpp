/// Rows of an exported run file, segment by segment. Only for the .cpp files of this folder.
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

/// Column indices for the values of one configuration.
struct ExportPlaces {
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  std::vector<std::size_t>
      inputs;  ///< temperatures of the model; empty with ExportContent::sensors
  std::vector<std::size_t> sensors;  ///< none: included in its block's input
  std::vector<std::size_t> signals;
  std::vector<std::size_t> displacement;  ///< by axis; none if not probed
  std::vector<std::size_t> offsets;
  std::vector<std::size_t> applied;
  std::vector<std::size_t> measured;  ///< none: probings have no columns
};

/// Creates the columns of a configuration.
/// @param probed  by axis: true if its displacement was measured anywhere in the file; nullptr: no
///                columns of probings
[[nodiscard]] ExportPlaces export_places(const ReplaySetup& setup, ExportContent content,
                                         const std::vector<bool>* probed, RunColumns& columns);

/// A displacement entered by an operator or a probe.
struct ExportedProbing {
  std::size_t axis{0};
  std::int64_t wall_ns{0};               ///< time of the measurement
  double measured_um{not_a_number};      ///< as entered
  double displacement_um{not_a_number};  ///< without the offset in effect
  double modelled_um{not_a_number};      ///< model without correction; NaN: unknown
  double claimed_um{not_a_number};       ///< standard deviation claimed by the model; NaN: none
  double sd_um{not_a_number};            ///< NaN: as configured
  MeasuredSource source{MeasuredSource::probe};
};

/// Marks the axes with a measured displacement in this segment. Damage is reported by the export
/// itself, not here.
void note_probed(const HistoryReader& reader, const SegmentInfo& segment,
                 std::vector<bool>& probed) noexcept;

/// Walks through a segment, from one cycle with recorded offsets to the next, and steps the
/// estimator as in a replay, to obtain the daemon's inputs.
class SegmentExport {
 public:
  /// @param damage  gets the damage found
  /// @throws HistoryError when the segment's start cannot be used
  SegmentExport(const HistoryReader& reader, const SegmentInfo& segment, const ReplaySetup& setup,
                const ExportPlaces& places, std::vector<HistoryDamage>& damage);

  /// Advances to the next cycle with recorded offsets. @return false if there is none
  bool next(std::uint64_t& cycle);
  [[nodiscard]] std::int64_t wall_ns(std::uint64_t cycle) const;

  /// @param row     all NaN on entry
  /// @param cycle   from next()
  void fill(std::vector<double>& row, std::uint64_t cycle);
  /// Begin and end of faults, and commands since the last call; one text each.
  [[nodiscard]] std::vector<std::string> happened();
  /// References taken after a probing of the row, which belongs to the time before them.
  [[nodiscard]] std::vector<std::string> references_after_row();
  /// Probings between the last two calls of fill().
  [[nodiscard]] std::vector<ExportedProbing> probings();
  /// Call when the segment has grown: next() continues.
  void extend(std::int64_t last_cycle);
  /// Discards the cycle of the last next(), with the commands before it.
  void skip();

 private:
  void note(const std::string& why);
  void advance();
  void take_input();
  void take_offsets();
  void take_command();
  void take_measured();
  [[nodiscard]] double read_back_um(std::size_t axis) const;
  [[nodiscard]] double effect_um(std::size_t axis) const;
  void follow(std::uint64_t cycle);
  void give_up_following(const std::string& why);
  void fill_inputs(std::vector<double>& row);
  void write_faults();
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
  std::array<double, axes_max> measured_um_{};      ///< as entered
  std::array<double, axes_max> displacement_um_{};  ///< ... without the offset in effect
  Record record_;
  bool has_record_{false};
  std::unique_ptr<SegmentSteps> steps_;  ///< null once stepping has failed
  Report report_;
  std::vector<Fault> faults_reported_;
  std::vector<std::string> happened_;
  std::vector<std::string> references_after_row_;
  std::vector<ExportedProbing> probings_;
  std::string not_followed_;  ///< why stepping has failed, until reported
};

}  // namespace thermocomp
