/// Thread for slow answers.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include <nlohmann/json.hpp>

namespace thermocomp::gateway {

/// The text of `value`; bytes that are not UTF-8 are replaced.
[[nodiscard]] std::string dumped(const nlohmann::json& value);

struct JsonAnswer {
  unsigned status{200};
  std::string text;
};

/// Makes answers one after the other, so that a slow one does not delay the live values of pages.
class AnswerThread {
 public:
  using Work = std::function<JsonAnswer()>;  ///< must not throw
  using Done = std::function<void(JsonAnswer)>;
  static constexpr std::size_t waiting_max = 16;

  AnswerThread();
  ~AnswerThread();  ///< jobs still queued are answered with 503
  AnswerThread(const AnswerThread&) = delete;
  AnswerThread& operator=(const AnswerThread&) = delete;

  /// Calls `done` on this thread. @return false: the queue is full or stopped; `done` is not called
  [[nodiscard]] bool ask(Work work, Done done);
  void stop() noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// {"error": text}
[[nodiscard]] std::string error_text(const std::string& text);

}  // namespace thermocomp::gateway
