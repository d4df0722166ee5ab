#include "cli/scan/scan_protocol.hpp"

#include <algorithm>
#include <cstdio>
#include <map>
#include <poll.h>
#include <utility>

#include "drivers/bus_thread.hpp"

namespace thermocomp::cli {
namespace {

struct Worked {
  std::vector<Reading> readings;
  std::vector<RawReading> raw;
  std::vector<std::vector<double>> values;  ///< by reading
  std::vector<UnitHealth> units;
  FrameCounts frames;
  nanoseconds ended_at{};
};

/// Runs the protocol on the bus for `listen_s`, sending its frames.
Worked work(CanProtocol& protocol, CanSocket& socket, double listen_s, const ScanSensors& sensors) {
  Worked worked;
  const nanoseconds end = monotonic_now() + from_seconds(listen_s);
  const std::vector<std::size_t> order = protocol.sensors();
  const auto may_continue = [&](nanoseconds now) {
    const std::span<const Reading> readings = protocol.readings();
    for (std::size_t i = 0; i < order.size(); ++i) {
      const double stale_after_s = sensors.stale_after_s.at(order[i]);
      if (readings[i].fault == Fault::none &&
          may_come_again(readings[i].taken_at, stale_after_s, end, now))
        return true;
    }
    return now < end;
  };
  worked.values.resize(order.size());
  std::vector<nanoseconds> taken_at(order.size());
  const auto note_values = [&] {
    for (std::size_t i = 0; i < order.size(); ++i) {
      const Reading& reading = protocol.readings()[i];
      if (reading.taken_at == std::exchange(taken_at[i], reading.taken_at)) continue;
      if (reading.fault == Fault::none) worked.values[i].push_back(reading.temp_degC);
    }
  };
  protocol.opened(monotonic_now());
  while (socket.is_open() && may_continue(monotonic_now())) {
    pollfd wait{socket.descriptor(), POLLIN, 0};
    constexpr int slice_ms = 10;
    static_cast<void>(::poll(&wait, 1, slice_ms));
    for (const CanFrame& frame : socket.receive()) {
      ++worked.frames[frame.id];
      protocol.take(frame);
      note_values();
    }
    protocol.advance(monotonic_now());
    while (const auto frame = protocol.next_frame()) {
      if (!socket.send(*frame)) break;
    }
  }
  worked.ended_at = monotonic_now();
  worked.readings.assign(protocol.readings().begin(), protocol.readings().end());
  worked.raw = protocol.raw();
  worked.units = protocol.health(worked.ended_at);
  return worked;
}

std::string raw_text(const RawReading& raw) {
  std::string text = hex_bytes(raw.value);
  if (!raw.status.empty()) text += ", status " + hex_bytes(raw.status);
  return text;
}

ScanChannel show(const Reading& reading, const RawReading& raw, const Why& why, nanoseconds now,
                 const PlausibleRange& range) {
  ScanChannel result;
  result.fault = reading.fault;
  result.temp_degC = reading.temp_degC;
  result.raw = raw_text(raw);
  if (reading.taken_at != nanoseconds{0}) {
    result.age_s = static_cast<double>((now - reading.taken_at).count()) * 1e-9;
  }
  if (reading.fault != Fault::none) {
    result.why =
        raw.value.empty() ? "nothing with this value was received" : why(reading.fault, raw);
    return result;
  }
  if (reading.temp_degC >= range.min_degC && reading.temp_degC <= range.max_degC) return result;
  result.fault = Fault::out_of_range;
  result.why = short_number(reading.temp_degC) + " degC is outside [" +
               short_number(range.min_degC) + ", " + short_number(range.max_degC) +
               "] ([screening])";
  result.hints.emplace_back("compare type, scale and place with the manual");
  return result;
}

}  // namespace

std::string too_few(const RawReading& raw) {
  return "only " + std::to_string(raw.value.size()) + " bytes received";
}

ScanBus scan_protocol(ProtocolBus what, CanProtocol& protocol, const ScanSensors& sensors,
                      const ScanTask& task, const Afterwards& afterwards) {
  ScanBus bus;
  bus.name = what.name;
  bus.kind = what.outline.kind;
  bus.where = what.outline.interface;
  CanSocket socket(bus.where, {});
  socket.add_filter({{0, false}, 0});  // all frames, to list those not configured
  socket.add_filter({{0, true}, 0});
  Worked worked;
  if (socket.open()) {
    task.progress("bus " + what.name + ": working it as the daemon would, for " +
                  short_number(task.listen_s) + " s");
    worked = work(protocol, socket, task.listen_s, sensors);
    bus.error = socket.error();
    bus.note = received_text(worked.frames);
    if (afterwards) afterwards(socket, worked.frames, bus);
  } else {
    bus.error = "cannot be opened: " + socket.error();
  }
  const std::vector<std::size_t> order = protocol.sensors();
  for (const Place& place : what.places) {
    const auto at = static_cast<std::size_t>(std::find(order.begin(), order.end(), place.sensor) -
                                             order.begin());
    Reading reading;
    reading.fault = Fault::no_answer;
    RawReading raw;
    if (at < worked.readings.size()) {
      reading = worked.readings[at];
      raw = worked.raw[at];
    }
    ScanChannel shown =
        show(reading, raw, place.why, worked.ended_at, sensors.ranges.at(place.sensor));
    judge_age(sensors.stale_after_s.at(place.sensor), shown);
    if (at < worked.values.size()) judge_turns(worked.values[at], shown);
    shown.sensor = sensors.names.at(place.sensor);
    shown.place = place.text;
    what.devices[place.device].channels.push_back(std::move(shown));
  }
  for (std::size_t i = 0; i < what.devices.size() && i < worked.units.size(); ++i) {
    what.devices[i].answers = worked.units[i].answering;
    what.devices[i].note = worked.units[i].last_error;
  }
  bus.devices = std::move(what.devices);
  return bus;
}

}  // namespace thermocomp::cli
