#include "gateway/http/answer_thread.hpp"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

namespace thermocomp::gateway {

struct AnswerThread::Parts {
  struct Job {
    Work work;
    Done done;
  };
  void run();

  std::mutex mutex;
  std::condition_variable changed;
  std::deque<Job> jobs;
  bool stops{false};
  std::thread thread;
};

void AnswerThread::Parts::run() {
  for (;;) {
    std::unique_lock lock(mutex);
    changed.wait(lock, [this] { return stops || !jobs.empty(); });
    if (jobs.empty()) return;
    const Job job = std::move(jobs.front());
    jobs.pop_front();
    const bool refuses = stops;
    lock.unlock();
    constexpr unsigned unavailable = 503;
    job.done(refuses ? JsonAnswer{unavailable, R"({"error":"the gateway is stopping"})"}
                     : job.work());
  }
}

AnswerThread::AnswerThread() : parts_(std::make_unique<Parts>()) {
  parts_->thread = std::thread([this] { parts_->run(); });
}

AnswerThread::~AnswerThread() {
  stop();
}

bool AnswerThread::ask(Work work, Done done) {
  const std::lock_guard lock(parts_->mutex);
  if (parts_->stops || parts_->jobs.size() >= waiting_max) return false;
  parts_->jobs.push_back({std::move(work), std::move(done)});
  parts_->changed.notify_one();
  return true;
}

void AnswerThread::stop() noexcept {
  {
    const std::lock_guard lock(parts_->mutex);
    parts_->stops = true;
  }
  parts_->changed.notify_all();
  if (parts_->thread.joinable()) parts_->thread.join();
}

std::string dumped(const nlohmann::json& value) {
  return value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string error_text(const std::string& text) {
  return dumped({{"error", text}});
}

}  // namespace thermocomp::gateway
