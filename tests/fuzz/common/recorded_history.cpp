#include "recorded_history.hpp"

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include <sqlite3.h>

#include "daemon/history/writing/history_writer.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "fuzz.hpp"

namespace thermocomp::fuzz {
namespace {

using std::chrono::milliseconds;

/// Sixty cycles of 100 ms: drifting readings, a fault, a command, skipped cycles, offsets recorded
/// ten times a second.
class Recording {
 public:
  explicit Recording(const DaemonConfig& config)
      : config_(config),
        writer_(config.history, grid_, "1.0", 4096),
        readings_(config.estimator.sensors.size()) {
    begin();
  }

  void run() {
    writer_.start();
    recorder_->begin(0, *estimator_, SegmentReason::start);
    cycles(30);
    auto old_estimator = std::move(estimator_);
    auto old_recorder = std::move(recorder_);
    begin();
    estimator_->plan_adoption(*old_estimator);
    estimator_->adopt(*old_estimator);
    recorder_->begin(cycle_, *estimator_, SegmentReason::reload, old_recorder.get());
    cycles(30);
    recorder_->finish(cycle_ - 1, command_);
    writer_.stop();
  }

 private:
  void begin() {
    estimator_ = std::make_unique<Estimator>(config_.estimator, config_.model);
    recorder_ = writer_.make_recorder({config_.text, config_.model_text, config_.model_checksum},
                                      *estimator_);
  }

  void cycles(std::uint64_t count) {
    for (const std::uint64_t end = cycle_ + count; cycle_ < end; ++cycle_) {
      const nanoseconds now = grid_.time_of(cycle_);
      if (cycle_ % 20 == 15) {
        recorder_->skipped(cycle_, cycle_ + 1);
        cycle_ += 2;
      }
      const Fault fault = cycle_ % 11 == 4 ? Fault::open_circuit : Fault::none;
      const double temp_degC = 20.0 + 0.05 * static_cast<double>(cycle_);
      readings_[cycle_ % readings_.size()] = {temp_degC, now, fault};
      controller_.online = true;
      controller_.written = controller_.online;
      controller_.link_epoch = 1;
      controller_.taken_at = now;
      controller_.applied_um[0] = command_.offset_um[0];
      if (cycle_ % 25 == 12) {
        const Command asked{CommandKind::measured, 0, 3.5};
        estimator_->apply(asked);
        recorder_->command(cycle_, asked);
      }
      estimator_->step(grid_.time_of(cycle_), readings_, controller_, command_);
      recorder_->record(cycle_, readings_, controller_, command_, *estimator_);
    }
  }

  const DaemonConfig& config_;
  Grid grid_{std::chrono::hours(7), milliseconds(100)};
  HistoryWriter writer_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<CycleRecorder> recorder_;
  std::vector<Reading> readings_;
  ControllerState controller_;
  OffsetCommand command_;
  std::uint64_t cycle_{0};
};

/// Small pages for small inputs; no write-ahead log, so that reading creates no files.
void make_small(const std::filesystem::path& file) {
  sqlite3* handle = nullptr;
  const bool done =
      sqlite3_open(file.c_str(), &handle) == SQLITE_OK &&
      sqlite3_exec(handle, "PRAGMA journal_mode = DELETE; PRAGMA page_size = 512; VACUUM", nullptr,
                   nullptr, nullptr) == SQLITE_OK;
  sqlite3_close(handle);
  FUZZ_REQUIRE(done);
}

}  // namespace

std::string small_config_text() {
  return R"(format = 1
[model]
file = "model.toml"
[[bus]]
name = "can"
kind = "can"
interface = "can0"
[[device]]
name = "node"
bus = "can"
[[sensor]]
name = "bed"
device = "node"
id = 0x100
start_bit = 0
length_bits = 16
scale = 0.1
[[sensor]]
name = "spindle"
device = "node"
id = 0x100
start_bit = 16
length_bits = 16
scale = 0.1
[[block]]
name = "bed"
input = "bed_in_degC"
sensors = ["bed"]
[[block]]
name = "spindle"
input = "spindle_degC"
sensors = ["spindle"]
[controller]
name = "cnc"
kind = "dry_run"
[[axis]]
name = "z"
output = "z_um"
offset_um_max = 60.0
rate_um_per_s_max = 0.5
[compensation]
enabled_at_first_start = true
)";
}

std::string small_model_text() {
  return R"(format = 1
inputs = ["bed_in_degC", "spindle_degC"]
outputs = ["z_um"]
reference = [20.0, 20.0]
matrix_um_per_K = [[6.25, 4.5]]
)";
}

DaemonConfig small_config() {
  return parse_daemon_config(small_config_text(), "config.toml", small_model_text(), "model.toml");
}

std::vector<std::uint8_t> recorded_history() {
  const ScratchFile file("made.db");
  DaemonConfig config = small_config();
  config.history.file = file.path();
  config.history.commit_s = 0.1;
  config.history.offsets_period_s = 0.1;
  Recording(config).run();
  make_small(file.path());
  std::ifstream in(file.path(), std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace thermocomp::fuzz
