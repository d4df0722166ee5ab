/// Connections that do not get on. libmicrohttpd ends one that is silent; who sends or takes a byte
/// now and then would keep a place for ever.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <unordered_map>

namespace thermocomp::gateway {

class SlowConnections {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds request_max{15};  ///< until a request is whole
  static constexpr std::chrono::seconds answer_max{60};   ///< until its answer is taken

  enum class Stage { request, answer, stream };

  void opened(int fd, Clock::time_point now);
  void is_at(int fd, Stage stage, Clock::time_point now);
  void closed(int fd);
  /// Shuts down those that are over their time; the library then finds them closed.
  void end_slow(Clock::time_point now);
  [[nodiscard]] std::size_t count() const;

 private:
  struct Place {
    Stage stage{Stage::request};
    Clock::time_point since;
  };
  mutable std::mutex mutex_;
  std::unordered_map<int, Place> places_;  ///< by socket
};

}  // namespace thermocomp::gateway
