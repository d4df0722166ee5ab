#include "daemon/threads/side_thread.hpp"

#include <condition_variable>
#include <mutex>
#include <pthread.h>
#include <signal.h>
#include <utility>

#include <system_error>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// Large enough for the recursive parser of a configuration; only touched pages are locked.
constexpr std::size_t stack_bytes = std::size_t{4096} * 1024;

}  // namespace

struct SideThread::Shared {
  std::mutex mutex;
  std::condition_variable given;
  std::condition_variable ended;
  std::function<void()> job;  ///< reset when it has ended
  bool stopping{false};

  void run() {
    std::unique_lock lock(mutex);
    while (true) {
      given.wait(lock, [this] { return job || stopping; });
      if (!job) return;
      lock.unlock();
      job();
      lock.lock();
      job = nullptr;
      ended.notify_all();
    }
  }
};

SideThread::SideThread(const char* name) : shared_(std::make_shared<Shared>()) {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, stack_bytes);
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  // Blocked before the thread is created: main handles all signals.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  auto own = std::make_unique<std::pair<std::shared_ptr<Shared>, const char*>>(shared_, name);
  pthread_t thread;
  const int error = pthread_create(
      &thread, &attributes,
      [](void* argument) -> void* {
        const std::unique_ptr<std::pair<std::shared_ptr<Shared>, const char*>> mine(
            static_cast<std::pair<std::shared_ptr<Shared>, const char*>*>(argument));
        pthread_setname_np(pthread_self(), mine->second);
        mine->first->run();
        return nullptr;
      },
      own.get());
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&attributes);
  if (error != 0)
    throw std::system_error(error, std::generic_category(), std::string("no thread for ") + name);
  static_cast<void>(own.release());
}

SideThread::~SideThread() {
  static_cast<void>(wait(patience));
  {
    const std::lock_guard lock(shared_->mutex);
    shared_->stopping = true;
  }
  shared_->given.notify_one();
}

void SideThread::start(std::function<void()> job) {
  THERMOCOMP_ENSURE(!is_busy());
  {
    const std::lock_guard lock(shared_->mutex);
    shared_->job = std::move(job);
  }
  shared_->given.notify_one();
}

bool SideThread::is_busy() const {
  const std::lock_guard lock(shared_->mutex);
  return static_cast<bool>(shared_->job);
}

bool SideThread::wait(std::chrono::steady_clock::duration at_most) const {
  std::unique_lock lock(shared_->mutex);
  return shared_->ended.wait_for(lock, at_most, [this] { return !shared_->job; });
}

}  // namespace thermocomp
