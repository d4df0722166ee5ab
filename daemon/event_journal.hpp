/// Keeps what happened: the events of this run, the faults that still last.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "daemon/recording/event.hpp"

namespace thermocomp {

/// Main's thread only. Every change is one event; the same fault told again is none.
class EventJournal {
 public:
  struct Moment {
    std::chrono::nanoseconds monotonic{};
    std::chrono::nanoseconds wall{};  ///< since 1970
  };
  using Now = std::function<Moment()>;
  using Sink = std::function<void(const Event&)>;
  static constexpr std::size_t kept_max = 1000;

  explicit EventJournal(Now now = system_now, Sink sink = {})
      : now_(std::move(now)), sink_(std::move(sink)) {}

  /// The subject has this fault from now on. Another one than before is told, but the outage counts
  /// from the first.
  void fault(const std::string& subject, const std::string& what);
  /// The subject has none any more; nothing where it had none.
  void recovery(const std::string& subject);
  /// A mode that begins; the same again is nothing.
  void mode(const std::string& name);
  void command(const std::string& what, std::int64_t user);
  void daemon(const std::string& what);

  /// Oldest first; at most kept_max.
  [[nodiscard]] const std::deque<Event>& events() const noexcept { return events_; }
  /// Outages that ended within the last `age`, newest first, at most `count_max`.
  [[nodiscard]] std::vector<Event> ended_within(std::chrono::seconds age,
                                                std::size_t count_max) const;

  [[nodiscard]] static Moment system_now();

 private:
  struct Outage {
    std::chrono::nanoseconds since{};  ///< monotonic: a set clock must not change a duration
    std::string what;
  };
  void add(const Moment& at, Event event);

  Now now_;
  Sink sink_;
  std::uint64_t number_{0};
  std::deque<Event> events_;
  std::map<std::string, Outage> outages_;
  std::string mode_;
  std::chrono::nanoseconds mode_since_{};
};

}  // namespace thermocomp
