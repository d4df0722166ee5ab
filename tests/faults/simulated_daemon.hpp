/// One run of the daemon: real connections, polling, controller dialogue and cycle, with simulated
/// lines and no threads.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "daemon/cycle/cycle.hpp"
#include "drivers/controllers/kinds/modbus/modbus_dialogue.hpp"
#include "drivers/modbus/connection.hpp"
#include "drivers/sensors/modbus_poller.hpp"
#include "simulated_line.hpp"

namespace thermocomp::faults {

/// State that survives a run of the daemon.
struct World {
  World(std::uint64_t seed, const MachineShape& shape, const FaultSchedule& fault_schedule)
      : schedule(fault_schedule),
        thermocouples(seed, fault_schedule),
        controller(seed, fault_schedule, shape.offsets_are_float),
        units{SensorUnits{0, thermocouples, fault_schedule},
              SensorUnits{1, thermocouples, fault_schedule}},
        controller_unit(controller, fault_schedule,
                        std::chrono::microseconds(
                            static_cast<std::int64_t>(1e3 * shape.controller.line.timeout_ms))),
        chance(seed, 3) {}

  const FaultSchedule& schedule;
  Thermocouples thermocouples;
  SimulatedController controller;
  std::array<SensorUnits, buses_count> units;
  ControllerUnit controller_unit;
  Chance chance;
  nanoseconds now{};                              ///< of the cycle
  std::array<nanoseconds, lines_count> clocks{};  ///< per line
};

/// A bus that is processed when the cycle asks for its values; each value becomes visible at its
/// publication time, not earlier.
class SteppedSource final : public SensorSource {
 public:
  SteppedSource(const ModbusBusConfig& config, std::size_t line, World& world);
  void start() override {}
  void stop() noexcept override {}
  void newest(std::span<Reading> all) noexcept override;
  [[nodiscard]] BusHealth health() const override { return poller_.health(); }

 private:
  World& world_;
  nanoseconds& clock_;
  ModbusConnection connection_;
  ModbusPoller poller_;
  std::vector<std::size_t> sensors_;
  std::vector<Reading> seen_;
};

class SteppedLink final : public ControllerLink {
 public:
  SteppedLink(const ModbusControllerConfig& config, World& world);
  void start() override {}
  void stop() noexcept override {}
  void newest(ControllerState& state) noexcept override;
  void offer(const OffsetCommand& command) noexcept override {
    offered_ = command;
    // Real cycles continue during a turn of the link. Here the turn takes no cycle; the command it
    // would have had at its end is not simulated.
    dialogue_.offer(command, world_.now + world_.controller_unit.takes(3, world_.now));
  }
  [[nodiscard]] ControllerHealth health() const override { return dialogue_.health(); }
  [[nodiscard]] const OffsetCommand& offered() const noexcept { return offered_; }
  [[nodiscard]] const ControllerState& seen() const noexcept { return seen_; }

 private:
  World& world_;
  nanoseconds& clock_;
  ModbusConnection connection_;
  ModbusDialogue dialogue_;
  ControllerState seen_;
  OffsetCommand offered_;
};

/// Keeps the cycle's readings of all buses for the invariants.
class ReadingsTap final : public SensorSource {
 public:
  explicit ReadingsTap(std::vector<Reading>& readings) : readings_(readings) {}
  void start() override {}
  void stop() noexcept override {}
  void newest(std::span<Reading> all) noexcept override {
    std::copy(all.begin(), all.end(), readings_.begin());
  }
  [[nodiscard]] BusHealth health() const override { return {}; }

 private:
  std::vector<Reading>& readings_;
};

class SimulatedDaemon {
 public:
  SimulatedDaemon(const MachineShape& shape, World& world, const Grid& grid,
                  std::unique_ptr<CycleParts> parts, LastSent* last_sent);

  [[nodiscard]] Cycle& cycle() noexcept { return cycle_; }
  [[nodiscard]] SteppedLink& link() noexcept { return link_; }
  [[nodiscard]] const std::vector<Reading>& readings() const noexcept { return readings_; }

 private:
  std::vector<Reading> readings_;
  std::array<std::unique_ptr<SteppedSource>, buses_count> sources_;
  ReadingsTap tap_;
  SteppedLink link_;
  Cycle cycle_;
};

}  // namespace thermocomp::faults
