/// The events of this run and the present outages.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "estimator/types.hpp"
#include "status/event.hpp"

namespace thermocomp {

/// Main's thread only. Every change is one event, without repetition of a fault. A fault that
/// returns within `returns_within` of its end is intermittent: one outage, which ends when the
/// fault has stayed away for that time.
class EventJournal {
 public:
  struct Moment {
    std::chrono::nanoseconds monotonic{};
    std::chrono::nanoseconds wall{};  ///< since 1970
  };
  using Now = std::function<Moment()>;
  static constexpr std::size_t kept_max = 1000;
  static constexpr std::chrono::seconds returns_within{10};
  static constexpr std::size_t faults_of_outage_max = 8;

  explicit EventJournal(Now now = system_now) : now_(std::move(now)) {}
  /// Calls `listener` (the history's writer) with every event from now on.
  void on_event(std::function<void(const Event&)> listener) { listener_ = std::move(listener); }

  /// Reports a fault of the subject. Each kind of fault is one event per outage, which begins with
  /// the first.
  /// @param fault  subject, code, detail and value; the journal sets the rest
  /// @return true if it became an event
  bool fault(Event fault);
  /// Ends the subject's fault, if it has one.
  /// @param hold  time without a fault after which the outage ends
  /// @param value  of the end's event; NaN: that of the fault
  /// @return duration of the outage [s] if its end became an event, else NaN
  double recovery(const Subject& subject, std::chrono::nanoseconds hold = {},
                  double value = not_a_number);
  /// Ends outages whose faults have stayed away long enough; call often.
  /// @return the events
  std::vector<Event> settle();
  /// True if the subject has an outage whose end is not yet an event.
  [[nodiscard]] bool lasts(const Subject& subject) const;
  /// True if, in addition, its faults are intermittent.
  [[nodiscard]] bool comes_and_goes(const Subject& subject) const;
  /// Records the begin of a mode, if it is new.
  void mode(const std::string& name);
  /// @param command  its code, subject, value and user
  void command(Event command);
  void daemon(const std::string& code, const std::string& detail);

  /// Oldest first; at most kept_max.
  [[nodiscard]] const std::deque<Event>& events() const noexcept { return events_; }
  /// Outages that ended within the last `age`, newest first, at most `count_max`.
  [[nodiscard]] std::vector<Event> ended_within(std::chrono::seconds age,
                                                std::size_t count_max) const;

  [[nodiscard]] static Moment system_now();

 private:
  struct Outage {
    std::chrono::nanoseconds since{};  ///< monotonic: a set clock must not change a duration
    Event newest;                      ///< fault
    std::vector<Event> reported;       ///< faults that became events
    std::optional<std::chrono::nanoseconds> away_since;  ///< none: it has a fault at present
    std::chrono::nanoseconds hold{};
    bool is_end_reported{false};
    bool comes_and_goes{false};
  };
  /// True if the end was reported and the fault stayed away: a new fault is another outage.
  [[nodiscard]] static bool is_over(const Outage& outage, std::chrono::nanoseconds now);
  [[nodiscard]] const Outage* find(const Subject& subject) const;
  Event end_of(Outage& outage);
  void add(const Moment& at, Event event);

  Now now_;
  std::function<void(const Event&)> listener_;
  std::uint64_t number_{0};
  std::deque<Event> events_;
  std::map<Subject, Outage> outages_;
  std::string mode_;
  std::chrono::nanoseconds mode_since_{};
};

}  // namespace thermocomp
