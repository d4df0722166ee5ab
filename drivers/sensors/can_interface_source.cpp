#include "drivers/sensors/can_interface_source.hpp"

#include "drivers/bus.hpp"
#include "drivers/bus_thread.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {

CanInterfaceSource::CanInterfaceSource(Setting setting, std::vector<CanId> wanted,
                                       std::vector<std::size_t> sensors,
                                       std::vector<UnitHealth> units)
    : setting_(std::move(setting)),
      sensors_(std::move(sensors)),
      socket_(setting_.interface, std::move(wanted)),
      slot_(std::vector<Reading>(sensors_.size())) {
  health_.name = setting_.name;
  health_.kind = setting_.kind;
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
  health_.units = std::move(units);
}

void CanInterfaceSource::start() {
  if (const std::string reason = can_unavailable(); !reason.empty()) {
    throw DriverError(setting_.name + ": this system has no CAN sockets: " + reason);
  }
  thread_.start(setting_.name, [this] { run(); });
}

void CanInterfaceSource::stop() noexcept {
  stopping_.store(true);
  wake_.signal();
  thread_.join();
}

void CanInterfaceSource::newest(std::span<Reading> all) noexcept {
  slot_.fresh();
  const std::vector<Reading>& newest = slot_.front();
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    THERMOCOMP_ENSURE(sensors_[i] < all.size());
    all[sensors_[i]] = newest[i];
  }
}

BusHealth CanInterfaceSource::health() const {
  const std::scoped_lock lock(health_mutex_);
  return health_;
}

void CanInterfaceSource::run() {
  while (!stopping_.load()) {
    if (!socket_.is_open()) open();
    if (!socket_.is_open()) {
      wake_.wait_until(monotonic_now() + from_seconds(setting_.reconnect_s));
      continue;
    }
    wake_.wait_until(monotonic_now() + setting_.patience, socket_.descriptor());
    work();
    follow_link();
    publish();
    wake_.wait_until(monotonic_now() + setting_.gather);
  }
  socket_.close();
}

void CanInterfaceSource::open() {
  if (socket_.open()) {
    const std::scoped_lock lock(health_mutex_);
    ++health_.connects;
  }
  follow_link();
  publish();
}

void CanInterfaceSource::follow_link() {
  const bool usable = socket_.is_open() && !socket_.bus_off();
  if (usable == usable_) return;
  usable_ = usable;
  if (usable) {
    bus_opened(monotonic_now());
  } else {
    bus_closed(monotonic_now());
  }
}

void CanInterfaceSource::publish() {
  write_readings(slot_.back());
  slot_.publish();
  std::vector<UnitHealth> units_now = units(monotonic_now());
  const std::scoped_lock lock(health_mutex_);
  health_.connected = usable();
  health_.last_error = socket_.error();
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
  health_.error_frames = socket_.errors().error_frames;
  health_.bus_offs = socket_.errors().bus_off;
  health_.restarts = socket_.errors().restarted;
  health_.dropped = socket_.errors().dropped;
  health_.units = std::move(units_now);
}

namespace {

/// Longest delay of a protocol's time-outs, SYNC and heartbeats.
constexpr nanoseconds tick = std::chrono::milliseconds{10};

}  // namespace

CanProtocolSource::CanProtocolSource(std::string name, std::string kind, std::string interface,
                                     double reconnect_s, std::unique_ptr<CanProtocol> protocol)
    : CanInterfaceSource(
          {std::move(name), std::move(kind), std::move(interface), reconnect_s, tick, {}}, {},
          protocol->sensors(), protocol->health(nanoseconds{0})),
      protocol_(std::move(protocol)) {
  for (const CanFilter& filter : protocol_->wanted()) socket().add_filter(filter);
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
    follow_link();  // only a frame ends a bus-off: notice it here
    protocol_->take(frame);
    send();
  }
  follow_link();
  protocol_->advance(monotonic_now());
  send();
}

/// A frame that the kernel refuses is lost: the protocol repeats unanswered requests.
void CanProtocolSource::send() {
  while (const auto frame = protocol_->next_frame()) socket().send(*frame);
}

void CanProtocolSource::write_readings(std::vector<Reading>& readings) {
  const auto newest = protocol_->readings();
  readings.assign(newest.begin(), newest.end());  // same size: no allocation
}

std::vector<UnitHealth> CanProtocolSource::units(nanoseconds now) {
  return protocol_->health(now);
}

}  // namespace thermocomp
