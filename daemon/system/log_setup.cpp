#include "daemon/system/log_setup.hpp"

#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <memory>
#include <mutex>
#include <utility>

#include <spdlog/details/log_msg_buffer.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>

#include "daemon/threads/side_thread.hpp"

namespace thermocomp {
namespace {

/// Enough for some thousand lines, as at a start or in a storm of events; bounded, as memory is
/// locked.
constexpr std::size_t waiting_bytes_max = std::size_t{2} * 1024 * 1024;

std::size_t size_of(const spdlog::details::log_msg& line) {
  return sizeof(spdlog::details::log_msg_buffer) + line.payload.size() + line.logger_name.size();
}

/// Queue of lines for a sink that may block.
class LogQueue {
 public:
  explicit LogQueue(spdlog::sink_ptr sink) : sink_(std::move(sink)) {}

  void add(const spdlog::details::log_msg& line) {
    {
      const std::lock_guard lock(mutex_);
      lines_.emplace_back(line);
      bytes_ += size_of(line);
      while (bytes_ > waiting_bytes_max) {
        bytes_ -= size_of(lines_.front());
        lines_.pop_front();
        ++dropped_;
      }
    }
    wake_.notify_one();
  }

  void run() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return !lines_.empty() || stopping_; });
      if (lines_.empty()) return;
      const spdlog::details::log_msg_buffer line = std::move(lines_.front());
      lines_.pop_front();
      bytes_ -= size_of(line);
      writing_ = true;
      const std::uint64_t lost = dropped_ - dropped_reported_;
      dropped_reported_ = dropped_;
      lock.unlock();
      if (lost > 0) log_lost(line, lost);
      sink_->log(line);
      lock.lock();
      writing_ = false;
      if (lines_.empty()) empty_.notify_all();
    }
  }

  void stop() {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    wake_.notify_one();
  }

  bool wait_until_empty(std::chrono::milliseconds at_most) {
    std::unique_lock lock(mutex_);
    return empty_.wait_for(lock, at_most, [this] { return lines_.empty() && !writing_; });
  }

  [[nodiscard]] LogStatistics statistics() {
    const std::lock_guard lock(mutex_);
    return {dropped_, dropped_ > dropped_reported_};
  }

 private:
  /// Logged before the first line after the lost ones.
  void log_lost(const spdlog::details::log_msg& next, std::uint64_t lost) {
    const std::string text = fmt::format("{} lines of the log were lost: it was not read", lost);
    spdlog::details::log_msg line(next.time, next.source, next.logger_name, spdlog::level::warn,
                                  text);
    sink_->log(line);
  }

  const spdlog::sink_ptr sink_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable empty_;
  std::deque<spdlog::details::log_msg_buffer> lines_;
  std::size_t bytes_{0};
  std::uint64_t dropped_{0};
  std::uint64_t dropped_reported_{0};
  bool writing_{false};
  bool stopping_{false};
};

class QueuedSink final : public spdlog::sinks::sink {
 public:
  explicit QueuedSink(const spdlog::sink_ptr& taker)
      : sink_(taker), queue_(std::make_shared<LogQueue>(taker)) {
    thread_.start([queue = queue_] { queue->run(); });
  }
  QueuedSink(const QueuedSink&) = delete;
  QueuedSink& operator=(const QueuedSink&) = delete;
  ~QueuedSink() override { queue_->stop(); }

  void log(const spdlog::details::log_msg& line) override { queue_->add(line); }
  void flush() override {}  // spdlog must not block here; see flush_log()
  void set_pattern(const std::string& pattern) override { sink_->set_pattern(pattern); }
  void set_formatter(std::unique_ptr<spdlog::formatter> formatter) override {
    sink_->set_formatter(std::move(formatter));
  }
  [[nodiscard]] LogQueue& queue() noexcept { return *queue_; }

 private:
  spdlog::sink_ptr sink_;
  std::shared_ptr<LogQueue> queue_;
  SideThread thread_{"log"};
};

std::shared_ptr<QueuedSink> the_sink;

}  // namespace

void set_up_log() {
  spdlog::sink_ptr sink;
  if (std::getenv("JOURNAL_STREAM") != nullptr)
    sink = std::make_shared<spdlog::sinks::systemd_sink_mt>("thermocompd");
  else
    sink = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
  the_sink = std::make_shared<QueuedSink>(sink);
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("thermocompd", the_sink));
}

void set_log_level(const std::string& level) {
  spdlog::set_level(spdlog::level::from_str(level));
}

LogStatistics log_statistics() {
  return the_sink ? the_sink->queue().statistics() : LogStatistics{};
}

bool flush_log(std::chrono::milliseconds at_most) {
  return !the_sink || the_sink->queue().wait_until_empty(at_most);
}

}  // namespace thermocomp
