/// A Modbus line in virtual time between the real connection and simulated units; applies the
/// scheduled faults to frames. Its clock advances only during waits.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "drivers/modbus/port.hpp"
#include "machine.hpp"

namespace thermocomp::faults {

inline constexpr std::size_t lines_count = buses_count + 1;  ///< the last one is the controller's
inline constexpr std::size_t controller_line = buses_count;

/// The device or devices on a line.
class LineEnd {
 public:
  LineEnd() = default;
  LineEnd(const LineEnd&) = delete;
  LineEnd& operator=(const LineEnd&) = delete;
  virtual ~LineEnd() = default;
  [[nodiscard]] virtual bool powered(nanoseconds time) const = 0;
  /// @param answer  function and data; empty: no answer
  virtual void ask(int unit, std::span<const std::uint8_t> request, nanoseconds time,
                   std::vector<std::uint8_t>& answer) = 0;
  /// Additional delay of its answer.
  [[nodiscard]] virtual nanoseconds takes(std::uint8_t /*function*/, nanoseconds /*time*/) const {
    return {};
  }
  virtual void link_broke() {}  ///< new connection or failed exchange
};

/// The units of one sensor bus.
class SensorUnits final : public LineEnd {
 public:
  SensorUnits(std::size_t bus, Thermocouples& thermocouples, const FaultSchedule& schedule)
      : bus_(bus), thermocouples_(thermocouples), schedule_(schedule) {}
  [[nodiscard]] bool powered(nanoseconds /*time*/) const override { return true; }
  void ask(int unit, std::span<const std::uint8_t> request, nanoseconds time,
           std::vector<std::uint8_t>& answer) override;

 private:
  [[nodiscard]] bool silent(std::size_t place, nanoseconds time) const;
  std::size_t bus_;
  Thermocouples& thermocouples_;
  const FaultSchedule& schedule_;
};

class ControllerUnit final : public LineEnd {
 public:
  /// @param patience  timeout for its answers
  ControllerUnit(SimulatedController& controller, const FaultSchedule& schedule,
                 nanoseconds patience)
      : controller_(controller), schedule_(schedule), patience_(patience) {}
  [[nodiscard]] bool powered(nanoseconds time) const override { return controller_.powered(time); }
  void ask(int unit, std::span<const std::uint8_t> request, nanoseconds time,
           std::vector<std::uint8_t>& answer) override;
  [[nodiscard]] nanoseconds takes(std::uint8_t function, nanoseconds time) const override;
  void link_broke() override { controller_.link_broke(); }

 private:
  SimulatedController& controller_;
  const FaultSchedule& schedule_;
  const nanoseconds patience_;
};

class SimulatedLine final : public ModbusPort {
 public:
  /// @param clock  time of the line; survives connections and restarts
  SimulatedLine(std::size_t line, bool serial, LineEnd& end, const FaultSchedule& schedule,
                Chance& chance, nanoseconds& clock)
      : line_(line),
        serial_(serial),
        end_(end),
        schedule_(schedule),
        chance_(chance),
        clock_(clock) {}

  [[nodiscard]] nanoseconds now() const noexcept override { return clock_; }
  bool open(std::string& why) override;
  void close() noexcept override;
  bool send(std::span<const std::uint8_t> bytes) noexcept override;
  PortWait wait_for_input(nanoseconds deadline) noexcept override;
  PortBytes receive(std::span<std::uint8_t> into) noexcept override;
  bool pause_until(nanoseconds time) noexcept override;
  void cancel() noexcept override {}
  [[nodiscard]] bool cancelled() const noexcept override { return false; }

 private:
  struct Frame {
    nanoseconds arrives_at{};
    std::vector<std::uint8_t> bytes;
    bool cut{false};
  };
  [[nodiscard]] bool up(nanoseconds time) const;
  [[nodiscard]] bool hit(FaultKind kind, std::uint64_t one_in);
  [[nodiscard]] bool gone();  ///< the answer is lost
  void deliver(Frame frame);
  void spoil(Frame& frame);

  std::size_t line_;
  bool serial_;
  LineEnd& end_;
  const FaultSchedule& schedule_;
  Chance& chance_;
  nanoseconds& clock_;
  bool open_{false};
  bool broken_{false};         ///< TCP: peer lost, reported at the next call
  bool mute_{false};           ///< TCP: no further bytes after a truncated frame
  std::vector<Frame> frames_;  ///< by time of arrival
  std::vector<std::uint8_t> answer_;
};

}  // namespace thermocomp::faults
