#include "drivers/sensors/can_interface_source.hpp"

#include "drivers/driver_error.hpp"
#include "drivers/monotonic_clock.hpp"
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
  std::vector<UnitHealth> now_told = units(monotonic_now());
  const std::scoped_lock lock(health_mutex_);
  health_.connected = usable();
  health_.last_error = socket_.error();
  health_.state = to_string(socket_.state());
  health_.state_since = socket_.state_since();
  health_.error_frames = socket_.errors().error_frames;
  health_.bus_offs = socket_.errors().bus_off;
  health_.restarts = socket_.errors().restarted;
  health_.dropped = socket_.errors().dropped;
  health_.units = std::move(now_told);
}

}  // namespace thermocomp
