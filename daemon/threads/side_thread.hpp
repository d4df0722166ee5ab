/// A thread for what may stand still: a disk, a name service, a pipe that nobody reads.
#pragma once

#include <chrono>
#include <functional>
#include <memory>

namespace thermocomp {

/// Does one job at a time; whoever gives it one never waits. Neither the thread nor its job can be
/// interrupted: a job that stands when the owner goes is left to the end of the process, so a job
/// owns all that it uses. A job does not throw.
class SideThread {
 public:
  /// @param name  as the system lists it, at most 15 characters
  /// @throws std::system_error when the system gives no thread
  explicit SideThread(const char* name);
  /// Waits for the job under way, for at most `patience`.
  ~SideThread();
  SideThread(const SideThread&) = delete;
  SideThread& operator=(const SideThread&) = delete;

  static constexpr std::chrono::seconds patience{2};

  /// @pre !is_busy()
  void start(std::function<void()> job);
  /// False also makes visible what the job wrote.
  [[nodiscard]] bool is_busy() const;
  /// Waits for the end of the job. @return whether it has ended
  bool wait(std::chrono::steady_clock::duration at_most) const;

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
};

}  // namespace thermocomp
