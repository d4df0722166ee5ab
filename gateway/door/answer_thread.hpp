/// The thread that makes answers that take their time.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

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

/// {"error": text}
[[nodiscard]] std::string error_text(const std::string& text);

}  // namespace thermocomp::gateway
