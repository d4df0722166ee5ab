#include "drivers/sensors/can_protocol_source.hpp"

#include "drivers/monotonic_clock.hpp"

namespace thermocomp {
namespace {

/// How late a protocol may notice that something is due: time-outs, SYNC, heartbeats.
constexpr nanoseconds tick = std::chrono::milliseconds{10};

}  // namespace

CanProtocolSource::CanProtocolSource(std::string name, std::string kind, std::string interface,
                                     double reconnect_s, std::unique_ptr<CanProtocol> protocol)
    : CanInterfaceSource(
          {std::move(name), std::move(kind), std::move(interface), reconnect_s, tick, {}}, {},
          protocol->sensors(), protocol->health(nanoseconds{0})),
      protocol_(std::move(protocol)) {
  for (const CanFilter& filter : protocol_->wanted()) socket().also_want(filter);
}

CanProtocolSource::~CanProtocolSource() {
  stop();
}

void CanProtocolSource::bus_opened(nanoseconds now) {
  protocol_->opened(now);
}

void CanProtocolSource::bus_closed(nanoseconds now) {
  protocol_->closed(now);
}

void CanProtocolSource::work() {
  for (const CanFrame& frame : socket().receive()) {
    follow_link();  // the first frame after bus-off ends it
    protocol_->take(frame);
    send();
  }
  follow_link();
  protocol_->advance(monotonic_now());
  send();
}

/// A frame that the kernel does not take is lost, as it may be on any bus: who needs its answer
/// asks again.
void CanProtocolSource::send() {
  while (const auto frame = protocol_->next_frame()) socket().send(*frame);
}

void CanProtocolSource::write_readings(std::vector<Reading>& readings) {
  const auto newest = protocol_->readings();
  readings.assign(newest.begin(), newest.end());  // same size: never allocates
}

std::vector<UnitHealth> CanProtocolSource::units(nanoseconds now) {
  return protocol_->health(now);
}

}  // namespace thermocomp
