/// Reports of a bridge (`controller_state`) and their answers: any lines with pauses between them,
/// while an estimator compensates by these reports.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "common/fuzz.hpp"
#include "common/recorded_history.hpp"
#include "daemon/methods/methods.hpp"
#include "daemon/socket/rpc.hpp"
#include "estimator/pipeline/estimator.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;
using nlohmann::json;

namespace {

constexpr std::uint8_t waits = 0xFF;  ///< not part of UTF-8: a pause of a quarter of a second
constexpr nanoseconds cycle = 50ms;
constexpr double rounding_um = 0.11;  ///< a read-back's excess over the bound

nanoseconds clock_now{};

DaemonConfig with_bridge() {
  std::string text = fuzz::small_config_text();
  const std::string old = "kind = \"dry_run\"\n";
  text.replace(text.find(old), old.size(),
               "kind = \"linuxcnc\"\nsilent_after_s = 0.6\n[[controller.signal]]\n"
               "name = \"z_mm\"\n[[controller.signal]]\nname = \"cutting_on\"\n");
  DaemonConfig config =
      parse_daemon_config(text, "config.toml", fuzz::small_model_text(), "model.toml");
  for (SensorConfig& sensor : config.estimator.sensors) {
    sensor.smoothing.form = SmoothingForm::off;
    sensor.screening.settle_s = 0.0;
  }
  return config;
}

/// A daemon without socket and threads, and the promises of its answers.
class Daemon {
 public:
  explicit Daemon(const DaemonConfig& config)
      : config_(config),
        places_(std::get<BridgeControllerConfig>(config.controller)),
        bridge_(places_, []() noexcept { return clock_now; }),
        dispatcher_(config.socket),
        estimator_(config.estimator, config.model),
        readings_(config.estimator.sensors.size()),
        report_(estimator_.make_report()) {
    clock_now = 1h;
    bridge_.start();
    dispatcher_.add_method("controller_state", AccessClass::bridge, [this](const json& params) {
      json result = answer_bridge(bridge_, places_, to_string(report_.mode), params);
      check_taken(params, result);
      return result;
    });
    for (int i = 0; i < 4; ++i) step();
  }

  void take(std::string_view line) {
    const ControllerState before = state();
    results_ = 0;
    const thermocomp::Answer answer = dispatcher_.answer({true, true, true}, line);
    check_line(answer);
    // A refused report has changed nothing.
    if (results_ == 0) {
      FUZZ_REQUIRE(state().taken_at == before.taken_at);
      FUZZ_REQUIRE(state().link_epoch == before.link_epoch);
    }
    for (const char c : bridge_.health().last_error) FUZZ_REQUIRE(c >= 0x20);
  }

  void wait() {
    for (int i = 0; i < 5; ++i) step();
  }

 private:
  /// One cycle, with a small temperature rise.
  void step() {
    clock_now += cycle;
    warm_K_ = std::min(warm_K_ + 0.02, 20.0);
    for (Reading& reading : readings_) reading = {20.0 + warm_K_, clock_now, Fault::none};
    OffsetCommand command;
    estimator_.step(clock_now, readings_, state(), command);
    bridge_.offer(command);
    estimator_.report(report_);
  }
  const ControllerState& state() {
    bridge_.newest(state_);
    return state_;
  }

  static void check_line(const thermocomp::Answer& answer) {
    if (answer.text.empty()) return;
    FUZZ_REQUIRE(std::count(answer.text.begin(), answer.text.end(), '\n') == 1);
    const json line = json::parse(answer.text, nullptr, false);
    FUZZ_REQUIRE(line.is_object() && line.contains("result") != line.contains("error"));
    FUZZ_REQUIRE(answer.is_error == line.contains("error"));
    // No client input causes an internal error.
    if (answer.is_error) FUZZ_REQUIRE(line["error"]["code"] != rpc::internal_error);
  }

  /// An accepted report and its answer.
  void check_taken(const json& params, const json& result) {
    ++results_;
    const auto session = params["session"].get<std::uint64_t>();
    FUZZ_REQUIRE(session == session_ || session_ == 0 ||
                 clock_now - taken_at_ > from_seconds(places_.silent_after_s));
    session_ = session;
    taken_at_ = clock_now;
    const auto epoch = result["epoch"].get<std::uint32_t>();
    FUZZ_REQUIRE(epoch >= epoch_ && (result["anew"] == (epoch != epoch_)));
    FUZZ_REQUIRE(state().online && state().taken_at == clock_now && state().link_epoch == epoch);
    if (epoch != epoch_) {
      applied_um_.clear();
      answered_at_ = clock_now;
    }
    epoch_ = epoch;
    FUZZ_REQUIRE(result["mode"].is_string());
    for (std::size_t i = 0; i < places_.axes.size(); ++i) {
      const std::string& axis = places_.axes[i];
      check_offset(params["taking"].get<bool>(), params["applied_um"][axis],
                   result["offsets_um"].at(axis));
    }
  }

  /// The offset continues from the applied or last answered one, at most at the slew limit.
  void check_offset(bool taking, const json& applied, const json& offset) {
    if (!taking || !applied.is_number()) {
      FUZZ_REQUIRE(offset.is_null());
      applied_um_.clear();
      return;
    }
    applied_um_.push_back(applied.get<double>());
    if (applied_um_.size() > 64) applied_um_.erase(applied_um_.begin());
    if (offset.is_null()) return;
    const LimiterConfig& limiter = config_.estimator.axes[0].limiter;
    const double offset_um = offset.get<double>();
    FUZZ_REQUIRE(std::abs(offset_um) <= limiter.offset_um_max);
    const auto [low, high] = std::minmax_element(applied_um_.begin(), applied_um_.end());
    const double moved_um = limiter.rate_um_per_s_max * seconds_d(clock_now - answered_at_).count();
    FUZZ_REQUIRE(offset_um >= *low - moved_um - rounding_um);
    FUZZ_REQUIRE(offset_um <= *high + moved_um + rounding_um);
    applied_um_.push_back(offset_um);
    answered_at_ = clock_now;
  }

  const DaemonConfig& config_;
  const BridgeControllerConfig places_;
  BridgeController bridge_;
  RpcDispatcher dispatcher_;
  Estimator estimator_;
  std::vector<Reading> readings_;
  Report report_;
  ControllerState state_;
  double warm_K_{0.0};
  int results_{0};  ///< of the current line
  std::uint64_t session_{0};
  std::uint32_t epoch_{0};
  nanoseconds taken_at_{};
  nanoseconds answered_at_{};
  std::vector<double> applied_um_;  ///< reported as applied or answered recently
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const DaemonConfig config = with_bridge();
  Daemon daemon(config);
  std::string line;
  for (std::size_t i = 0; i < size; ++i) {
    if (data[i] == waits) {
      daemon.wait();
    } else if (data[i] == '\n') {
      daemon.take(line);
      line.clear();
    } else {
      line.push_back(static_cast<char>(data[i]));
    }
  }
  return 0;
}
