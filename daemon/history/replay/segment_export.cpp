#include "daemon/history/replay/segment_export.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <span>
#include <utility>

#include "config/text/printable_text.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t none = ExportPlaces::none;

double good_value(const Reading& reading) {
  return reading.fault == Fault::none ? reading.temp_degC : not_a_number;
}

/// Mean of the block's good readings, each relative to its reference sensor if it has one.
double block_mean(const BlockConfig& block, const EstimatorConfig& config,
                  const std::vector<Reading>& readings) {
  double sum = 0.0;
  int count = 0;
  for (const std::size_t sensor : block.sensors) {
    double value = good_value(readings[sensor]);
    if (const auto reference = config.sensors[sensor].reference_sensor)
      value -= good_value(readings[*reference]);
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? sum / count : not_a_number;
}

}  // namespace

ExportPlaces export_places(const ReplaySetup& setup, ExportContent content,
                           const std::vector<bool>* probed, RunColumns& columns) {
  const EstimatorConfig& config = setup.estimator;
  const bool as_read = content == ExportContent::sensors;
  ExportPlaces places;
  for (const std::string& column : setup.model.temperature_columns())
    places.inputs.push_back(as_read ? none : columns.column(column));
  for (std::size_t i = 0; i < config.sensors.size(); ++i) {
    const bool is_exported = as_read || !is_in_a_block(config, i);
    places.sensors.push_back(is_exported ? columns.column(sensor_column(config.sensors[i].name))
                                         : none);
  }
  for (const std::string& signal : config.signals) places.signals.push_back(columns.column(signal));
  for (std::size_t i = 0; i < config.axes.size(); ++i) {
    const bool is_probed = probed != nullptr && i < probed->size() && (*probed)[i];
    places.displacement.push_back(is_probed ? columns.column(config.axes[i].output) : none);
  }
  for (const AxisConfig& axis : config.axes) {
    places.offsets.push_back(columns.column(axis.name + "_offset_um"));
    places.applied.push_back(columns.column(axis.name + "_applied_um"));
    places.measured.push_back(probed != nullptr ? columns.column(axis.name + "_measured_um")
                                                : none);
  }
  return places;
}

void note_probed(const HistoryReader& reader, const SegmentInfo& segment,
                 std::vector<bool>& probed) noexcept {
  try {
    RecordCursor cursor(reader, segment);
    for (bool is_there = true; is_there;) {
      try {
        Record record;
        is_there = cursor.next(record);
        const bool is_probing = is_there && record.kind == RecordKind::command &&
                                record.detail == static_cast<std::uint8_t>(CommandKind::measured);
        if (is_probing && record.index < probed.size()) probed[record.index] = true;
      } catch (const HistoryError&) {
        is_there = cursor.resume();
      }
    }
  } catch (const std::exception&) {
    return;
  }
}

SegmentExport::SegmentExport(const HistoryReader& reader, const SegmentInfo& segment,
                             const ReplaySetup& setup, const ExportPlaces& places,
                             std::vector<HistoryDamage>& damage)
    : segment_(segment),
      config_(setup.estimator),
      model_(setup.model),
      dry_run_(setup.dry_run),
      places_(places),
      damage_(damage),
      cursor_(reader, segment),
      faults_reported_(config_.sensors.size(), Fault::never_read) {
  inputs_ = inputs_at(reader.start(segment), config_);
  measured_um_.fill(not_a_number);
  displacement_um_.fill(not_a_number);
  offset_um_.fill(not_a_number);
  try {
    steps_ = std::make_unique<SegmentSteps>(reader, segment, setup);
    report_ = steps_->estimator().make_report();
  } catch (const std::exception& error) {
    give_up_following(error.what());
  }
  advance();
}

bool SegmentExport::next(std::uint64_t& cycle) {
  while (has_record_) {
    if (record_.kind == RecordKind::offset) {
      cycle = record_.cycle;
      take_offsets();
      return true;
    }
    take_input();
    advance();
  }
  if (cursor_.wall_time_was_impossible())
    note("a wall time is impossible (clock set wrong?); the records are used");
  return false;
}

std::int64_t SegmentExport::wall_ns(std::uint64_t cycle) const {
  return segment_.grid.time_of(cycle).count() + cursor_.wall_minus_grid_ns();
}

void SegmentExport::fill(std::vector<double>& row, std::uint64_t cycle) {
  follow(cycle);
  fill_inputs(row);
  for (std::size_t i = 0; i < places_.sensors.size(); ++i)
    if (places_.sensors[i] != none) row[places_.sensors[i]] = good_value(inputs_.readings[i]);
  write_faults();
  // The last report of an absent controller is outdated.
  const bool is_read = inputs_.controller.online;
  for (std::size_t i = 0; i < places_.signals.size(); ++i)
    row[places_.signals[i]] = is_read ? inputs_.controller.signals[i] : not_a_number;
  for (std::size_t i = 0; i < places_.offsets.size(); ++i) {
    row[places_.offsets[i]] = offset_um_[i];
    // The offset shown in a dry run was not applied.
    row[places_.applied[i]] = dry_run_ || !is_read ? not_a_number : read_back_um(i);
    if (places_.measured[i] != none) row[places_.measured[i]] = measured_um_[i];
    if (places_.displacement[i] != none) row[places_.displacement[i]] = displacement_um_[i];
  }
  // -0 would be printed as "-0".
  std::replace(row.begin(), row.end(), -0.0, 0.0);
  measured_um_.fill(not_a_number);
  displacement_um_.fill(not_a_number);
}

std::vector<std::string> SegmentExport::happened() {
  std::vector<std::string> all = std::exchange(happened_, {});
  if (!not_followed_.empty()) all.push_back(std::move(not_followed_));
  not_followed_.clear();
  return all;
}

std::vector<std::string> SegmentExport::references_after_row() {
  return std::exchange(references_after_row_, {});
}

std::vector<ExportedProbing> SegmentExport::probings() {
  std::vector<ExportedProbing> all = std::exchange(probings_, {});
  for (ExportedProbing& probing : all) {
    if (!steps_) continue;
    probing.claimed_um = report_.axes[probing.axis].claimed_sd_um;
    const auto& outputs = model_.outputs;
    const auto output =
        std::find(outputs.begin(), outputs.end(), config_.axes[probing.axis].output);
    if (output != outputs.end())
      probing.modelled_um =
          report_.displacement_um[static_cast<std::size_t>(output - outputs.begin())];
  }
  return all;
}

void SegmentExport::extend(std::int64_t last_cycle) {
  segment_.last_cycle = last_cycle;
  cursor_.extend(last_cycle);
  try {
    if (steps_) steps_->extend(last_cycle);
  } catch (const std::exception& error) {
    give_up_following(error.what());
  }
  if (!has_record_) advance();
}

void SegmentExport::skip() {
  happened_.clear();
  references_after_row_.clear();
  probings_.clear();
  measured_um_.fill(not_a_number);
  displacement_um_.fill(not_a_number);
}

void SegmentExport::note(const std::string& why) {
  constexpr int shown_max = 10;
  if (++reported_ <= shown_max) damage_.push_back({segment_.id, why});
  if (reported_ == shown_max + 1) damage_.push_back({segment_.id, "and more of the kind"});
}

/// Advances to the next readable record.
void SegmentExport::advance() {
  for (;;) {
    try {
      has_record_ = cursor_.next(record_);
      return;
    } catch (const HistoryError& error) {
      note(error.what());
      inputs_.forget();
      offset_um_.fill(not_a_number);
      has_record_ = cursor_.resume();
      if (!has_record_) return;
    }
  }
}

void SegmentExport::take_input() {
  try {
    if (record_.kind == RecordKind::command) {
      take_command();
    } else if (record_.kind != RecordKind::skipped) {
      inputs_.apply(record_);
    }
  } catch (const HistoryError& error) {
    note(error.what());
  }
}

void SegmentExport::take_offsets() {
  const std::uint64_t cycle = record_.cycle;
  while (has_record_ && record_.kind == RecordKind::offset && record_.cycle == cycle) {
    if (record_.index < places_.offsets.size()) {
      offset_um_[record_.index] = record_.value;
    } else {
      note("an offset of no axis");
    }
    advance();
  }
}

void SegmentExport::take_command() {
  if (record_.detail >= command_kinds_count) throw HistoryError("damaged: unknown command");
  const auto kind = static_cast<CommandKind>(record_.detail);
  if (kind == CommandKind::saved) return;  // not from an operator
  const bool names_axis =
      kind == CommandKind::measured || kind == CommandKind::prove || kind == CommandKind::release;
  if (names_axis && record_.index >= config_.axes.size()) return;
  if (kind == CommandKind::accept && record_.index >= config_.sensors.size()) return;
  std::string text = "command " + std::string(to_string(kind));
  if (names_axis) text.append(" ").append(config_.axes[record_.index].name);
  if (kind == CommandKind::accept) text.append(" ").append(config_.sensors[record_.index].name);
  if (names_axis && kind != CommandKind::release)
    text.append(" ").append(number_text(record_.value)).append(" um");
  if (kind == CommandKind::measured && !references_after_row_.empty()) {
    // The row has one displacement of an axis: the one that counts from the new reference.
    std::move(references_after_row_.begin(), references_after_row_.end(),
              std::back_inserter(happened_));
    references_after_row_.clear();
    displacement_um_.fill(not_a_number);
  }
  const bool is_after_probing = kind == CommandKind::reference &&
                                std::any_of(displacement_um_.begin(), displacement_um_.end(),
                                            [](double each_um) { return std::isfinite(each_um); });
  (is_after_probing ? references_after_row_ : happened_).push_back(std::move(text));
  if (kind == CommandKind::measured) take_measured();
}

/// Records the displacement as the estimator uses it: without the offset in effect.
void SegmentExport::take_measured() {
  const std::size_t axis = record_.index;
  measured_um_[axis] = record_.value;
  displacement_um_[axis] = record_.value;
  if (config_.correction.measured == MeasuredMeaning::remaining)
    displacement_um_[axis] -= config_.axes[axis].sign * effect_um(axis);
  Command command;
  set_measured_bits(record_.time_ns, command);
  constexpr std::int64_t ns_per_s = 1'000'000'000;
  probings_.push_back({.axis = axis,
                       .wall_ns = wall_ns(record_.cycle) - ns_per_s * command.ago_s,
                       .measured_um = record_.value,
                       .displacement_um = displacement_um_[axis],
                       .sd_um = command.sd_nm > 0 ? 1e-3 * command.sd_nm : not_a_number,
                       .source = command.source});
}

/// NaN without read-back: the recorded content of the registers may be an older offset.
double SegmentExport::read_back_um(std::size_t axis) const {
  return config_.controller_reads_back ? inputs_.controller.applied_um[axis] : not_a_number;
}

/// Offset in effect; with nodes, interpolated at the slide's position.
double SegmentExport::effect_um(std::size_t axis) const {
  const AxisSpan span = span_of(config_.axes, axis);
  std::array<double, axes_max> nodes_um{};
  for (std::size_t i = 0; i < span.count; ++i) {
    const double applied_um = read_back_um(span.first + i);
    nodes_um[i] = std::isfinite(applied_um) ? applied_um : offset_um_[span.first + i];
  }
  if (span.count == 1) return nodes_um[0];
  const auto& names = config_.signals;
  const auto signal = std::find(names.begin(), names.end(), config_.axes[axis].node->position);
  if (signal == names.end()) return not_a_number;
  return value_on_travel(
      std::span(config_.axes).subspan(span.first, span.count), nodes_um,
      inputs_.controller.signals[static_cast<std::size_t>(signal - names.begin())]);
}

/// Steps the estimator up to and including the cycle.
void SegmentExport::follow(std::uint64_t cycle) {
  if (!steps_) return;
  try {
    while (!(steps_->has_stepped() && steps_->cycle() >= cycle)) {
      if (!steps_->step()) return give_up_following("damaged: cycles are missing");
    }
    steps_->estimator().report(report_);
  } catch (const std::exception& error) {
    give_up_following(error.what());
  }
}

void SegmentExport::give_up_following(const std::string& why) {
  steps_.reset();
  not_followed_ =
      "from here on the inputs are means of the raw readings, neither screened nor smoothed: " +
      why;
}

void SegmentExport::fill_inputs(std::vector<double>& row) {
  if (steps_) {
    for (std::size_t i = 0; i < places_.inputs.size(); ++i)
      if (places_.inputs[i] != none && report_.inputs[i].good)
        row[places_.inputs[i]] = report_.inputs[i].temp_degC;
    return;
  }
  const std::vector<std::string> columns = model_.temperature_columns();
  for (std::size_t i = 0; i < places_.inputs.size(); ++i) {
    if (places_.inputs[i] == none) continue;
    for (const BlockConfig& block : config_.blocks)
      if (block.input == columns[i])
        row[places_.inputs[i]] = block_mean(block, config_, inputs_.readings);
  }
}

/// The fault after screening if the estimator is stepped, else the driver's.
Fault SegmentExport::fault_of(std::size_t sensor) const {
  return steps_ ? report_.sensors[sensor].fault : inputs_.readings[sensor].fault;
}

void SegmentExport::write_faults() {
  for (std::size_t i = 0; i < faults_reported_.size(); ++i) {
    const Fault fault = fault_of(i);
    if (fault == faults_reported_[i]) continue;
    // A settling value ends the reported fault only when it counts.
    if (steps_ && report_.sensors[i].settles()) continue;
    const bool is_first_value = faults_reported_[i] == Fault::never_read && fault == Fault::none;
    faults_reported_[i] = fault;
    if (is_first_value) continue;  // the first value is not a recovery
    happened_.push_back("sensor " + config_.sensors[i].name + ": " +
                        (fault == Fault::none ? "good again" : std::string(to_string(fault))));
  }
}

}  // namespace thermocomp
