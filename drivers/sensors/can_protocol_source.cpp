#include "drivers/sensors/can_protocol_source.hpp"

#include "drivers/can/canopen/canopen_line.hpp"
#include "drivers/can/j1939/j1939_line.hpp"
#include "drivers/driver_error.hpp"
#include "drivers/monotonic_clock.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// How late a protocol may notice that something is due: time-outs, SYNC, heartbeats.
constexpr nanoseconds tick = std::chrono::milliseconds{10};

}  // namespace

CanProtocolSource::CanProtocolSource(std::string name, std::string kind, std::string interface,
                                     double reconnect_s, std::unique_ptr<CanProtocol> protocol)
    : name_(std::move(name)),
      reconnect_s_(reconnect_s),
      protocol_(std::move(protocol)),
      sensors_(protocol_->sensors()),
      socket_(std::move(interface), {}),
      slot_(std::vector<Reading>(sensors_.size())) {
  for (const CanFilter& filter : protocol_->wanted()) socket_.also_want(filter);
  health_.name = name_;
  health_.kind = std::move(kind);
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
  health_.units = protocol_->health(nanoseconds{0});
}

CanProtocolSource::~CanProtocolSource() {
  stop();
}

void CanProtocolSource::start() {
  if (const std::string reason = can_unavailable(); !reason.empty()) {
    throw DriverError(name_ + ": this system has no CAN sockets: " + reason);
  }
  thread_.start(name_, [this] { run(); });
}

void CanProtocolSource::stop() noexcept {
  stopping_.store(true);
  wake_.signal();
  thread_.join();
}

void CanProtocolSource::newest(std::span<Reading> all) noexcept {
  slot_.fresh();
  const std::vector<Reading>& newest = slot_.front();
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    THERMOCOMP_ENSURE(sensors_[i] < all.size());
    all[sensors_[i]] = newest[i];
  }
}

BusHealth CanProtocolSource::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

void CanProtocolSource::run() {
  while (!stopping_.load()) {
    if (!socket_.is_open()) {
      const bool opened = socket_.open();
      const std::scoped_lock lock(health_mutex_);
      health_.connects += opened ? 1 : 0;
    }
    follow_link();
    if (!socket_.is_open()) {
      publish();
      wake_.wait_until(monotonic_now() + from_seconds(reconnect_s_));
      continue;
    }
    wake_.wait_until(monotonic_now() + tick, socket_.descriptor());
    for (const CanFrame& frame : socket_.receive()) {
      follow_link();  // the first frame after bus-off ends it
      protocol_->take(frame);
      send();
    }
    follow_link();
    protocol_->advance(monotonic_now());
    send();
    publish();
  }
  socket_.close();
}

/// Tells the protocol when the bus can no longer be used, and when it can again.
void CanProtocolSource::follow_link() {
  const bool usable = socket_.is_open() && !socket_.bus_off();
  if (usable == usable_) return;
  usable_ = usable;
  if (usable) {
    protocol_->opened(monotonic_now());
  } else {
    protocol_->closed(monotonic_now());
  }
}

/// A frame that the kernel does not take is lost, as it may be on any bus: who needs its answer
/// asks again.
void CanProtocolSource::send() {
  while (const auto frame = protocol_->next_frame()) socket_.send(*frame);
}

void CanProtocolSource::publish() {
  const auto readings = protocol_->readings();
  slot_.back().assign(readings.begin(), readings.end());  // same size: never allocates
  slot_.publish();
  note_health();
}

void CanProtocolSource::note_health() {
  std::vector<UnitHealth> units = protocol_->health(monotonic_now());
  const std::scoped_lock lock(health_mutex_);
  health_.connected = usable_;
  health_.last_error = socket_.error();
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
  health_.error_frames = socket_.errors().error_frames;
  health_.bus_offs = socket_.errors().bus_off;
  health_.restarts = socket_.errors().restarted;
  health_.dropped = socket_.errors().dropped;
  health_.units = std::move(units);
}

std::unique_ptr<SensorSource> make_source(const CanopenBusConfig& config) {
  return std::make_unique<CanProtocolSource>(config.name, "canopen", config.interface,
                                             config.reconnect_s,
                                             std::make_unique<CanopenLine>(config));
}

std::unique_ptr<SensorSource> make_source(const J1939BusConfig& config) {
  return std::make_unique<CanProtocolSource>(config.name, "j1939", config.interface,
                                             config.reconnect_s,
                                             std::make_unique<J1939Line>(config));
}

}  // namespace thermocomp
