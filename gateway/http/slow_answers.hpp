/// Answers that take their time: the thread that makes them, and the answer to /api/history.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "gateway/feed/daemon_feed.hpp"
#include "gateway/http/request_rules.hpp"

namespace thermocomp::gateway {

struct JsonAnswer {
  unsigned status{200};
  std::string text;
};

/// Made one after the other on a thread of its own: a long one makes no page wait for its live
/// values.
class AnswerThread {
 public:
  using Work = std::function<JsonAnswer()>;  ///< must not throw
  using Done = std::function<void(JsonAnswer)>;
  static constexpr std::size_t waiting_max = 16;

  AnswerThread();
  ~AnswerThread();  ///< those that wait are answered 503
  AnswerThread(const AnswerThread&) = delete;
  AnswerThread& operator=(const AnswerThread&) = delete;

  /// `done` is called on a thread of its own. @return false: too many wait; nothing is called
  [[nodiscard]] bool ask(Work work, Done done);
  void stop() noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// To /api/history: {"from_s", "to_s", "span_s", "columns": {"time_s": [...], "bed_degC": [...],
/// "z_offset_um":
/// [...]}, "probings": [{"axis", "time_s", "left_um", "needed_um"}], "modes": [{"mode", "from_s",
/// "to_s"}], "events": [{"time_s", "text"}], "chunks", "chunks_read", "damage": [...]}; null: not
/// known. The modes are those in which nothing is compensated.
[[nodiscard]] JsonAnswer history_answer(const DaemonFeed& feed, const HistoryRequest& request);

}  // namespace thermocomp::gateway
