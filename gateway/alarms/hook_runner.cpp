#include "gateway/alarms/hook_runner.hpp"

#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstring>
#include <deque>
#include <fcntl.h>
#include <mutex>
#include <spawn.h>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>
#include <sys/wait.h>

#include "gateway/alarms/alarm_watch.hpp"

namespace thermocomp::gateway {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t waiting_max = 32;

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> list;
  list.reserve(texts.size() + 1);
  for (std::string& text : texts) list.push_back(text.data());
  list.push_back(nullptr);
  return list;
}

/// Starts the command in a new process group that inherits only standard error. @return -1: failed
pid_t spawn(const std::vector<std::string>& command, std::vector<std::string> environment) {
  std::vector<std::string> arguments = command;
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  sigset_t pipe_signal;
  sigemptyset(&pipe_signal);
  sigaddset(&pipe_signal, SIGPIPE);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &pipe_signal);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(
      &attributes,
      static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP));
  pid_t pid = -1;
  const int code = posix_spawn(&pid, arguments.front().c_str(), &files, &attributes,
                               pointers(arguments).data(), pointers(environment).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  if (code == 0) return pid;
  spdlog::error("alarm command {}: {}", command.front(), std::strerror(code));
  return -1;
}

}  // namespace

struct HookRunner::Parts {
  explicit Parts(const GatewaySettings& settings_in)
      : settings(settings_in),
        limit(settings_in.alarm.per_hour_max),
        limit_of_loss(settings_in.alarm.per_hour_max) {}

  void run();
  void begin(const AlarmChange& change);
  void wait_for(pid_t pid);
  [[nodiscard]] std::vector<std::string> environment(const AlarmChange& change) const;

  const GatewaySettings& settings;
  HookLimit limit;
  HookLimit limit_of_loss;  ///< separate limit, so that a flapping bus cannot suppress the report
                            ///< that the compensation has ended
  std::size_t dropped{0};   ///< since the limit was reached
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<AlarmChange> waiting;
  std::atomic<bool> stops{false};
  std::thread thread;
};

void HookRunner::Parts::run() {
  for (;;) {
    std::unique_lock lock(mutex);
    changed.wait(lock, [this] { return stops || !waiting.empty(); });
    if (stops) return;
    const AlarmChange change = std::move(waiting.front());
    waiting.pop_front();
    lock.unlock();
    begin(change);
  }
}

std::vector<std::string> HookRunner::Parts::environment(const AlarmChange& change) const {
  const AlarmCondition& condition = change.alarm.condition;
  return {"PATH=/usr/local/bin:/usr/bin:/bin",
          "LANG=C.UTF-8",
          "THERMOCOMP_MACHINE=" + settings.machine,
          "THERMOCOMP_ALARM=" + condition.name,
          std::string("THERMOCOMP_STATE=") + (change.is_raised ? "raised" : "cleared"),
          "THERMOCOMP_TEXT=" + condition.text,
          "THERMOCOMP_REMEDY=" + condition.remedy};
}

void HookRunner::Parts::begin(const AlarmChange& change) {
  const std::string& name = change.alarm.condition.name;
  HookLimit& budget = name == "compensation" || name == "daemon" ? limit_of_loss : limit;
  if (!budget.take(std::chrono::duration<double>(Clock::now().time_since_epoch()).count())) {
    if (dropped++ == 0)
      spdlog::warn("alarm commands: more than {} in an hour; dropped until the limit allows more",
                   settings.alarm.per_hour_max);
    return;
  }
  if (dropped > 0) spdlog::warn("alarm commands: {} were dropped", dropped);
  dropped = 0;
  const pid_t pid = spawn(settings.alarm.command, environment(change));
  if (pid > 0) wait_for(pid);
}

void HookRunner::Parts::wait_for(pid_t pid) {
  const auto end = Clock::now() + std::chrono::duration<double>(settings.alarm.command_s_max);
  constexpr std::chrono::milliseconds look_every(50);
  int status = 0;
  while (waitpid(pid, &status, WNOHANG) == 0) {
    if (stops || Clock::now() >= end) {
      if (!stops)
        spdlog::warn("the alarm command is killed after {} s", settings.alarm.command_s_max);
      kill(-pid, SIGKILL);
      waitpid(pid, &status, 0);
      return;
    }
    std::this_thread::sleep_for(look_every);
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    spdlog::warn("the alarm command ended with status {}", status);
}

HookRunner::HookRunner(const GatewaySettings& settings)
    : parts_(std::make_unique<Parts>(settings)) {
  parts_->thread = std::thread([this] { parts_->run(); });
}

HookRunner::~HookRunner() {
  {
    const std::lock_guard lock(parts_->mutex);
    parts_->stops = true;
  }
  parts_->changed.notify_all();
  parts_->thread.join();
}

void HookRunner::offer(const AlarmChange& change) {
  const std::lock_guard lock(parts_->mutex);
  if (parts_->waiting.size() >= waiting_max) {
    spdlog::warn("alarm commands: {} are queued; {} is dropped", waiting_max,
                 change.alarm.condition.name);
    return;
  }
  parts_->waiting.push_back(change);
  parts_->changed.notify_one();
}

}  // namespace thermocomp::gateway
