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
  /// The same while every place is taken: others wait for one.
  static constexpr std::chrono::seconds request_max_when_full{3};
  static constexpr std::chrono::seconds answer_max_when_full{10};
  /// Of a stream: what lies in the kernel because nobody takes it. Less, but more than what may be
  /// under way, has the time of an answer.
  static constexpr std::size_t untaken_bytes_max = std::size_t{64} * 1024;

  enum class Stage { request, answer, stream };

  explicit SlowConnections(std::size_t places) : places_max_(places) {}

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
  const std::size_t places_max_;
  mutable std::mutex mutex_;
  std::unordered_map<int, Place> places_;  ///< by socket
};

}  // namespace thermocomp::gateway
