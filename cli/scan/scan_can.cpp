#include "cli/scan/scan_can.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <poll.h>

#include "cli/common/modbus_names.hpp"
#include "cli/scan/scan_bus.hpp"
#include "config/text/units.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/can/signal_codec.hpp"
#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"

namespace thermocomp::cli {
namespace {

struct ReceivedFrames {
  FrameCounts frames;
  std::vector<std::optional<CanFrame>> of_signal;  ///< newest frame with the signal
  std::vector<std::vector<double>> values;         ///< by signal
};

std::vector<const CanSignal*> signals_of(const CanBusConfig& config) {
  std::vector<const CanSignal*> signals;
  for (const CanDeviceConfig& device : config.devices) {
    for (const CanChannel& channel : device.channels) signals.push_back(&channel.signal);
  }
  return signals;
}

/// @param stale_after_s  by signal; empty: one value is enough
ReceivedFrames listen(CanSocket& socket, const std::vector<const CanSignal*>& signals,
                      double listen_s, const std::vector<double>& stale_after_s) {
  ReceivedFrames received;
  received.of_signal.resize(signals.size());
  received.values.resize(signals.size());
  const nanoseconds end = monotonic_now() + from_seconds(listen_s);
  const auto may_continue = [&](nanoseconds now) {
    for (std::size_t i = 0; i < stale_after_s.size(); ++i) {
      const auto& frame = received.of_signal[i];
      if (frame && may_come_again(frame->received_at, stale_after_s[i], end, now)) return true;
    }
    return now < end;
  };
  while (socket.is_open() && may_continue(monotonic_now())) {
    pollfd wait{socket.descriptor(), POLLIN, 0};
    constexpr int slice_ms = 50;
    static_cast<void>(::poll(&wait, 1, slice_ms));
    for (const CanFrame& frame : socket.receive()) {
      ++received.frames[frame.id];
      for (std::size_t i = 0; i < signals.size(); ++i) {
        const CanSignal& signal = *signals[i];
        if (!matches(frame.id, signal)) continue;
        if (!carries(frame.payload(), signal)) continue;
        received.of_signal[i] = frame;
        const CanValue decoded = decode(frame.payload(), signal);
        if (decoded.fault == Fault::none) received.values[i].push_back(decoded.value);
      }
    }
  }
  return received;
}

void judge(const CanSignal& signal, const CanFrame& frame, const PlausibleRange& range,
           ScanChannel& result) {
  const auto payload = frame.payload();
  result.raw = hex_bytes({payload.begin(), payload.end()});
  result.age_s = static_cast<double>((monotonic_now() - frame.received_at).count()) * 1e-9;
  const CanValue decoded = decode(payload, signal);
  result.fault = decoded.fault;
  result.temp_degC = decoded.value;
  if (decoded.fault == Fault::bad_frame) {
    result.why = "the frame has " + std::to_string(payload.size()) + " bytes, which is too few";
    return;
  }
  if (decoded.fault != Fault::none) {
    CanSignal alone = signal;
    alone.status.reset();
    result.why = decode(payload, alone).fault == Fault::none ? "according to its status"
                                                             : "the device's code for it";
    return;
  }
  if (decoded.value >= range.min_degC && decoded.value <= range.max_degC) return;
  result.fault = Fault::out_of_range;
  result.why = short_number(decoded.value) + " degC is outside [" + short_number(range.min_degC) +
               ", " + short_number(range.max_degC) + "] ([screening])";
  CanSignal other = signal;
  other.byte_order = signal.byte_order == ByteOrder::little_endian ? ByteOrder::big_endian
                                                                   : ByteOrder::little_endian;
  // In the other byte order the field starts at its other end.
  other.start_bit = other.byte_order == ByteOrder::big_endian
                        ? signal.start_bit + 7
                        : signal.start_bit / 8 * 8 + (signal.start_bit % 8) - 7;
  try {
    check(other);
  } catch (const InvalidValue&) {
    return;
  }
  const CanValue swapped = decode(payload, other);
  if (swapped.fault == Fault::none && swapped.value >= range.min_degC &&
      swapped.value <= range.max_degC) {
    result.hints.push_back(
        std::string("byte_order = \"") +
        (other.byte_order == ByteOrder::big_endian ? "big_endian" : "little_endian") +
        "\" with start_bit = " + std::to_string(other.start_bit) + " would make it " +
        short_number(swapped.value) + " degC");
  }
}

/// Hints at the same number in the other format, or a J1939 group from another address.
void add_id_hint(const CanSignal& signal, const ReceivedFrames& received, ScanChannel& result) {
  constexpr std::uint32_t group = 0x03FFFF00;
  for (const auto& [id, count] : received.frames) {
    if (id.id == signal.id && id.extended != signal.extended_id)
      result.hints.push_back(to_string(id) +
                             " was received: extended_id = " + (id.extended ? "true" : "false"));
    if (!signal.extended_id || !id.extended || ((id.id ^ signal.id) & group) != 0) continue;
    if (id.id == signal.id) continue;
    result.hints.push_back(
        to_string(id) +
        " was received, the same J1939 group from another address: give "
        "the sensor that id, or the message of the DBC file VFrameFormat J1939PG");
  }
}

void fill(const CanBusConfig& config, const ScanSensors& sensors, const ReceivedFrames& received,
          ScanBus& bus) {
  std::size_t index = 0;
  for (const CanDeviceConfig& device : config.devices) {
    ScanDevice& shown = bus.devices.emplace_back();
    shown.name = device.name;
    for (const CanChannel& channel : device.channels) {
      ScanChannel& result = shown.channels.emplace_back();
      result.sensor = sensors.names.at(channel.sensor);
      result.place = place_name(channel.signal);
      result.fault = Fault::never_read;
      const auto& frame = received.of_signal[index];
      if (frame) {
        shown.answers = true;
        judge(channel.signal, *frame, sensors.ranges.at(channel.sensor), result);
        judge_age(sensors.stale_after_s.at(channel.sensor), result);
        judge_turns(received.values[index], result);
      } else if (bus.error.empty()) {
        result.why = "no frame with identifier " +
                     to_string({channel.signal.id, channel.signal.extended_id}) + " carried it";
        add_id_hint(channel.signal, received, result);
      }
      ++index;
    }
  }
}

void take(const CanSignal& signal, const ReceivedFrames& received, std::size_t index,
          ScanValue& shown) {
  const CanId id{signal.id, signal.extended_id};
  const auto& frame = received.of_signal[index];
  if (!frame) {
    shown.why = received.frames.contains(id)
                    ? "frames " + to_string(id) + " were received, but none has this value"
                    : "no frame with identifier " + to_string(id) + " was received";
    return;
  }
  const auto payload = frame->payload();
  shown.raw = hex_bytes({payload.begin(), payload.end()});
  const CanValue decoded = decode(payload, signal);
  shown.value = decoded.value;
  if (decoded.fault == Fault::bad_frame)
    shown.why = "the frame has " + std::to_string(payload.size()) + " bytes, which is too few";
  else if (decoded.fault != Fault::none)
    shown.why = "is not a finite number: compare length and byte order with the controller's side";
}

}  // namespace

std::string received_text(const FrameCounts& frames) {
  constexpr std::size_t text_max = 200;
  if (frames.empty())
    return "no frame was received: bit rate, termination (two of 120 Ohm), or no node sends by "
           "itself (remote requests are not sent)";
  std::string text = "identifiers on the bus:";
  for (const auto& [id, count] : frames) {
    text.append(" ").append(to_string(id)).append(" (").append(std::to_string(count)).append(")");
    if (text.size() > text_max) return text + " ...";
  }
  return text;
}

std::string place_name(const CanSignal& signal) {
  std::string text = to_string({signal.id, signal.extended_id}) + " bit " +
                     std::to_string(signal.start_bit) + " length " +
                     std::to_string(signal.length_bits);
  text += signal.byte_order == ByteOrder::little_endian ? " little_endian" : " big_endian";
  if (signal.scale != 1.0) text += " x " + short_number(signal.scale);
  return text;
}

/// Sends nothing. Channels without a frame get the identifiers received.
ScanBus scan_bus(const CanBusConfig& config, const ScanSensors& sensors, const ScanTask& task) {
  ScanBus bus;
  bus.name = config.name;
  bus.kind = config.outline().kind;
  bus.where = config.interface;
  const std::vector<const CanSignal*> signals = signals_of(config);
  CanSocket socket(config.interface, {});
  socket.add_filter({{0, false}, 0});  // all frames, to list those not configured
  socket.add_filter({{0, true}, 0});
  ReceivedFrames received;
  received.of_signal.resize(signals.size());
  if (!socket.open()) {
    bus.error = "cannot be opened: " + socket.error();
  } else {
    task.progress("bus " + config.name + ": listening for " + short_number(task.listen_s) + " s");
    std::vector<double> stale_after_s;
    for (const CanDeviceConfig& device : config.devices) {
      for (const CanChannel& channel : device.channels)
        stale_after_s.push_back(sensors.stale_after_s.at(channel.sensor));
    }
    received = listen(socket, signals, task.listen_s, stale_after_s);
    if (!socket.error().empty()) bus.error = socket.error();
    bus.note = received_text(received.frames);
  }
  fill(config, sensors, received, bus);
  return bus;
}

ScanController scan_can_controller(const DaemonConfig& config,
                                   const CanControllerConfig& controller, double listen_s,
                                   const std::function<void(const std::string&)>& progress) {
  ScanController result;
  result.name = controller.name;
  result.kind = "can";
  result.where = controller.interface;
  std::vector<const CanSignal*> signals;
  const auto add = [&](const CanSignal& signal, const std::string& what, const std::string& unit) {
    signals.push_back(&signal);
    ScanValue& shown = result.values.emplace_back();
    shown.what = what;
    shown.place = place_name(signal);
    shown.unit = unit;
  };
  const std::vector<AxisSpan> spans = axis_spans(config.estimator.axes);
  for (std::size_t i = 0; i < controller.axes.size(); ++i) {
    const AxisConfig& axis = config.estimator.axes[spans[i].first];
    const std::string unit(unit_of(axis.output).symbol);
    const std::string of_axis = " of axis " + axis_name(axis);
    if (const auto& applied = controller.axes[i].applied) add(*applied, "applied" + of_axis, unit);
    const auto& travel = controller.axes[i].travel;
    if (!travel) continue;
    const CanSet& set = travel->applied;
    for (std::size_t each = 0; each < set.values.size(); ++each) {
      const TravelValueText text = travel_value_text(*travel, unit, each);
      add(set.values[each], "applied " + text.what + of_axis, text.unit);
    }
    for (const CanSignal& number : set.numbers)
      add(number, "number of the applied set" + of_axis, "");
  }
  for (const CanControllerSignal& signal : controller.signals) {
    const std::string& name = config.estimator.signals[signal.signal];
    add(signal.value, name, std::string(unit_of(name).symbol));
  }
  CanSocket socket(controller.interface, {});
  socket.add_filter({{0, false}, 0});  // all frames, including those too short for a signal
  socket.add_filter({{0, true}, 0});
  ReceivedFrames received;
  received.of_signal.resize(signals.size());
  if (socket.open()) {
    progress("controller " + controller.name + ": listening for " + short_number(listen_s) + " s");
    received = listen(socket, signals, listen_s, {});
    result.error = socket.error();
  } else {
    result.error = "cannot be opened: " + socket.error();
  }
  for (std::size_t i = 0; i < signals.size(); ++i) take(*signals[i], received, i, result.values[i]);
  return result;
}

}  // namespace thermocomp::cli
