// 10,000 real cycles with a real Modbus source, history and a reload: the cycle thread must not
// allocate, lock, page-fault or make system calls except the sleep. With --plant it does one of
// these on purpose, which must be detected (exit status 1).
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <unistd.h>

#include <sys/mman.h>

#include "daemon/cycle/cycle.hpp"
#include "daemon/cycle/real_time_thread.hpp"
#include "daemon/history/writing/history_writer.hpp"
#include "drivers/controllers/kinds/make_controller.hpp"
#include "drivers/sensors/make_source.hpp"
#include "tests/real_time/thread_watch.hpp"

namespace {

using namespace thermocomp;
using namespace std::chrono_literals;

constexpr std::uint64_t cycles_before = 300;
constexpr std::uint64_t cycles_watched = 10'000;
constexpr std::size_t sensors = 16;

enum class Plant { nothing, allocation, lock, fault, system_call };

/// Estimator with 12 s per cycle: sensors are compared with their neighbours every minute; one of
/// four is wrong in three of every six hours.
class WithWrongSensor {
 public:
  WithWrongSensor() : estimator_(config(), model()), report_(estimator_.make_report()) {
    controller_.online = true;
    controller_.written = controller_.online;
    controller_.link_epoch = 1;
    controller_.applied_um.fill(0.0);
  }
  void step(std::uint64_t cycle) noexcept {
    const nanoseconds now = std::chrono::seconds(12) * static_cast<std::int64_t>(cycle);
    const bool is_wrong = cycle / 900 % 2 == 1;
    for (std::size_t i = 0; i < readings_.size(); ++i)
      readings_[i] = {20.0 + 1e-3 * static_cast<double>((cycle + i) % 100), now, Fault::none};
    if (is_wrong) readings_[1].temp_degC += 2.0;
    controller_.taken_at = now;
    estimator_.step(now, readings_, controller_, command_);
    estimator_.report(report_);
    if (report_.sensors[1].weighed_down) weighed_down_.store(true);
  }
  [[nodiscard]] bool was_weighed_down() const noexcept { return weighed_down_.load(); }

 private:
  static constexpr std::size_t count = 4;
  static EstimatorConfig config() {
    EstimatorConfig config;
    for (const char* name : {"a", "b", "c", "d"}) {
      SensorConfig sensor;
      sensor.name = name;
      sensor.screening.stale_after_s = 60.0;
      sensor.screening.settle_s = 0.0;
      config.blocks.push_back({name, std::string(name) + "_degC", {config.sensors.size()}});
      config.sensors.push_back(sensor);
    }
    config.axes.push_back({"z", "z_um", 1.0, {}});
    config.controller_reads_back = false;
    config.compensation.enabled_at_first_start = true;
    config.compensation.suspected_sensors = SuspectedPolicy::weigh_down;
    return config;
  }
  static ThermalModel model() {
    ThermalModel model;
    model.outputs = {"z_um"};
    model.matrix_um_per_K = {std::vector<double>(count, 1.0)};
    for (const char* name : {"a", "b", "c", "d"}) {
      model.inputs.push_back(std::string(name) + "_degC");
      model.covariance_K2.emplace_back(count, 1.0)[model.covariance_K2.size() - 1] = 1.01;
    }
    return model;
  }

  Estimator estimator_;
  Report report_;
  std::array<Reading, count> readings_{};
  ControllerState controller_;
  OffsetCommand command_;
  std::atomic<bool> weighed_down_{false};
};

/// A source called by the cycle: begins and ends the watch, gives changing readings, and carries
/// out the planted violation.
class ProbeSource final : public SensorSource {
 public:
  explicit ProbeSource(Plant plant) : plant_(plant) {}
  void start() override {}
  void stop() noexcept override {}
  [[nodiscard]] BusHealth health() const override { return {}; }

  void newest(std::span<Reading> all) noexcept override {
    ++cycle_;
    if (cycle_ == cycles_before) test::begin_watch();
    if (cycle_ == cycles_before + cycles_watched) {
      counts = test::end_watch();
      done.store(true);
    }
    with_wrong_sensor.step(cycle_);
    if (cycle_ == cycles_before + cycles_watched / 2) commit_the_plant();
    for (std::size_t i = 0; i + 1 < all.size(); ++i)
      all[i] = {20.0 + 1e-3 * static_cast<double>((cycle_ + i) % 100), nanoseconds(now()),
                Fault::none};
    // Blocks are lost and return: both sensors of the third, and all but the last two blocks.
    if (cycle_ / 700 % 3 == 1) lose(all.subspan(4, 2));
    if (cycle_ / 700 % 3 == 2) lose(all.first(sensors - 4));
  }

  WithWrongSensor with_wrong_sensor;
  std::atomic<bool> done{false};
  test::ThreadCounts counts;

 private:
  static nanoseconds now() noexcept { return std::chrono::steady_clock::now().time_since_epoch(); }
  static void lose(std::span<Reading> readings) noexcept {
    for (Reading& reading : readings)
      reading = {not_a_number, reading.taken_at, Fault::open_circuit};
  }
  void commit_the_plant() noexcept {
    if (plant_ == Plant::allocation) std::free(std::malloc(64));
    if (plant_ == Plant::lock) std::lock_guard guard(mutex_);
    if (plant_ == Plant::system_call) static_cast<void>(::getppid());
    if (plant_ == Plant::fault) *fresh_page_ = 1;
  }

  Plant plant_;
  std::uint64_t cycle_{0};
  std::mutex mutex_;
  // Mapped before memory is locked, and not yet touched.
  volatile char* fresh_page_{static_cast<volatile char*>(
      mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0))};
};

std::string numbered(const char* name, std::size_t index) {
  std::string text(name);
  text += std::to_string(index);
  return text;
}

std::string input_name(std::size_t block) {
  std::string text = numbered("b", block);
  text += "_degC";
  return text;
}

EstimatorConfig make_config() {
  EstimatorConfig config;
  for (std::size_t i = 0; i < sensors; ++i) {
    SensorConfig sensor;
    sensor.name = numbered("s", i);
    sensor.smoothing.period_s = 0.01;
    sensor.screening.stale_after_s = 0.2;
    sensor.screening.settle_s = 0.05;
    sensor.smoothing.form = i % 2 == 0 ? SmoothingForm::sliding_line : SmoothingForm::line_of_lines;
    config.sensors.push_back(sensor);
    // The last sensor is on the unanswered Modbus line; it shares a block.
    if (i % 2 == 1) config.blocks.push_back({numbered("b", i / 2), input_name(i / 2), {i - 1, i}});
  }
  config.axes.push_back({"x", "x_um", 1.0, {}});
  config.axes.push_back({"y", "y_um", 1.0, {}});
  config.axes.push_back({"z", "z_um", 1.0, {}});
  config.compensation.enabled_at_first_start = true;
  return config;
}

ThermalModel make_model(double gain_um_per_K) {
  ThermalModel model;
  for (std::size_t i = 0; i < sensors / 2; ++i) model.inputs.push_back(input_name(i));
  model.outputs = {"x_um", "y_um", "z_um"};
  model.matrix_um_per_K.assign(3, std::vector<double>(sensors / 2, gain_um_per_K));
  for (std::size_t i = 0; i < sensors / 2; ++i) {
    model.covariance_K2.emplace_back(sensors / 2, 1.0);
    model.covariance_K2.back()[i] = 1.1;
  }
  model.terms.push_back(
      {"thermal_lag", "b0_degC", {{"tau_s", 5.0}}, {{"gain_um_per_K", {{"x_um", 1.0}}}}});
  return model;
}

ModbusBusConfig silent_line() {
  ModbusBusConfig bus;
  bus.name = "line";
  bus.line.link = ModbusTcp{"127.0.0.1", 9};
  ModbusDeviceConfig device;
  device.name = "module";
  ModbusChannel channel;
  channel.sensor = sensors - 1;
  device.channels.push_back(channel);
  bus.devices.push_back(device);
  return bus;
}

Plant plant_from(int argc, char** argv) {
  const std::string name = argc > 2 ? argv[2] : "";
  if (argc == 1) return Plant::nothing;
  if (name == "allocation") return Plant::allocation;
  if (name == "lock") return Plant::lock;
  if (name == "fault") return Plant::fault;
  if (name == "system_call") return Plant::system_call;
  std::fprintf(stderr, "usage: cycle_purity [--plant allocation|lock|fault|system_call]\n");
  std::exit(2);
}

}  // namespace

int main(int argc, char** argv) {
  ProbeSource probe(plant_from(argc, argv));
  const std::unique_ptr<SensorSource> line = make_bus_source(silent_line());
  DryRunController controller({"none", 3});
  const Grid grid{std::chrono::steady_clock::now().time_since_epoch(), 1ms};
  char folder[] = "/tmp/cycle_purity_XXXXXX";
  if (mkdtemp(folder) == nullptr) return 2;
  HistoryConfig history_config;
  history_config.file = std::filesystem::path(folder) / "history.db";
  history_config.commit_s = 0.5;
  HistoryWriter history(history_config, grid, "test");
  const auto make_cycle_parts = [&](double gain_um_per_K) {
    auto parts = std::make_unique<CycleParts>(Estimator(make_config(), make_model(gain_um_per_K)));
    parts->recorder = history.make_recorder({"", "", ""}, parts->estimator);
    return parts;
  };
  // In memory, like /run.
  const std::string record = "/dev/shm/cycle_purity_" + std::to_string(getpid());
  LastSent last_sent(record, "none", make_config().axes);
  Cycle cycle(grid, {&probe, line.get()}, controller, sensors, make_cycle_parts(2.0), &last_sent);
  history.start();
  line->start();
  controller.start();
  for (const std::string& warning : {lock_memory()})
    if (!warning.empty()) std::printf("note: %s\n", warning.c_str());
  RealTimeThread thread;
  const std::string no_fifo = thread.start({60, -1}, [&] { cycle.run(); });
  if (!no_fifo.empty()) std::printf("note: %s\n", no_fifo.c_str());

  // Meanwhile the main thread sends commands, reloads, and reads reports.
  std::this_thread::sleep_for(2s);
  bool sent = cycle.send({CommandKind::disable, 0, 0.0}).has_value();
  auto next = make_cycle_parts(3.0);
  next->estimator.plan_adoption(cycle.parts().estimator);
  cycle.hand_over(std::move(next));
  std::this_thread::sleep_for(1s);
  const bool reloaded = cycle.take_retired() != nullptr;
  sent = cycle.send({CommandKind::enable, 0, 0.0}) && sent;
  sent = cycle.send({CommandKind::prove, 0, 5.0}) && sent;
  while (!probe.done.load()) {
    static_cast<void>(cycle.report());
    std::this_thread::sleep_for(50ms);
  }
  cycle.stop();
  thread.join();
  line->stop();
  history.stop();
  std::filesystem::remove_all(folder);
  std::filesystem::remove(record);

  const test::ThreadCounts& counts = probe.counts;
  std::printf("%llu cycles: %llu allocations, %llu locks, %llu system calls, %lld page faults\n",
              static_cast<unsigned long long>(cycles_watched),
              static_cast<unsigned long long>(counts.allocations),
              static_cast<unsigned long long>(counts.locks),
              static_cast<unsigned long long>(counts.system_calls),
              static_cast<long long>(counts.page_faults));
  if (!sent || !reloaded) {
    std::printf("the reload or a command was not taken\n");
    return 3;
  }
  if (!probe.with_wrong_sensor.was_weighed_down()) {
    std::printf("the weight of a faulty sensor was not reduced\n");
    return 3;
  }
  return counts.allocations + counts.locks + counts.system_calls == 0 && counts.page_faults == 0
             ? 0
             : 1;
}
