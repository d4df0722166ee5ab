#include "daemon/cycle/cycle.hpp"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <poll.h>
#include <time.h>

#include "estimator/checks.hpp"

namespace thermocomp {

std::size_t DurationHistogram::bucket_of(std::uint64_t ns) noexcept {
  if (ns < subs) return static_cast<std::size_t>(ns);
  const auto octave = static_cast<unsigned>(std::bit_width(ns)) - sub_bits - 1;
  const std::size_t bucket = subs * octave + static_cast<std::size_t>(ns >> octave);
  return std::min(bucket, subs * octaves - 1);
}

std::uint64_t DurationHistogram::upper_edge_ns(std::size_t bucket) noexcept {
  if (bucket < 2 * subs) return bucket;
  const std::size_t octave = bucket / subs - 1;
  return ((static_cast<std::uint64_t>(bucket - subs * octave) + 1) << octave) - 1;
}

void DurationHistogram::record(std::chrono::nanoseconds duration) noexcept {
  const auto ns = std::max<std::int64_t>(duration.count(), 0);
  // Single writer: load and store suffice and are cheaper than an atomic addition.
  auto& bucket = buckets_[bucket_of(static_cast<std::uint64_t>(ns))];
  bucket.store(bucket.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  if (ns > max_ns_.load(std::memory_order_relaxed)) max_ns_.store(ns, std::memory_order_relaxed);
}

std::uint64_t DurationHistogram::count() const noexcept {
  std::uint64_t sum = 0;
  for (const auto& bucket : buckets_) sum += bucket.load(std::memory_order_relaxed);
  return sum;
}

std::chrono::nanoseconds DurationHistogram::percentile(double fraction) const noexcept {
  const auto total = static_cast<double>(count());
  if (!(total > 0)) return {};
  double seen = 0;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    seen += static_cast<double>(buckets_[i].load(std::memory_order_relaxed));
    if (seen >= fraction * total)
      return std::min(max(), std::chrono::nanoseconds(static_cast<std::int64_t>(upper_edge_ns(i))));
  }
  return max();
}

void DurationHistogram::clear() noexcept {
  for (auto& bucket : buckets_) bucket.store(0, std::memory_order_relaxed);
  max_ns_.store(0, std::memory_order_relaxed);
}

std::optional<std::uint64_t> CommandQueue::try_push(const Command& command) noexcept {
  const std::uint64_t head = head_.load(std::memory_order_relaxed);
  if (head - tail_.load(std::memory_order_acquire) == capacity) return std::nullopt;
  Place& place = places_[head % capacity];
  place.command = command;
  place.state.store(State::waiting, std::memory_order_relaxed);
  head_.store(head + 1, std::memory_order_release);
  return head;
}

bool CommandQueue::withdraw(std::uint64_t number) noexcept {
  if (number < tail_.load(std::memory_order_acquire)) return false;  // the slot may be reused
  State state = State::waiting;
  return places_[number % capacity].state.compare_exchange_strong(state, State::withdrawn);
}

bool CommandQueue::try_pop(Command& command) noexcept {
  for (std::uint64_t tail = tail_.load(std::memory_order_relaxed);
       tail != head_.load(std::memory_order_acquire); ++tail) {
    Place& place = places_[tail % capacity];
    State state = State::waiting;
    const bool is_ours = place.state.compare_exchange_strong(state, State::taken);
    if (is_ours) command = place.command;
    tail_.store(tail + 1, std::memory_order_release);
    if (is_ours) return true;
  }
  return false;
}

namespace {

nanoseconds now_on_clock() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

/// Fallback with 1 ms waits: a spinning FIFO thread would starve all others, and a cycle that does
/// not wait would run ahead of time.
void wait_otherwise(nanoseconds wake) noexcept {
  while (now_on_clock() < wake) poll(nullptr, 0, 1);
}

/// @return false when clock_nanosleep() failed; `wake` has passed in both cases
bool sleep_until(nanoseconds wake) noexcept {
  timespec time{};
  time.tv_sec = std::chrono::duration_cast<std::chrono::seconds>(wake).count();
  time.tv_nsec = (wake % std::chrono::seconds(1)).count();
  int error = EINTR;
  while (error == EINTR) {
    error = clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr);
  }
  if (error == 0) return true;
  wait_otherwise(wake);
  return false;
}

}  // namespace

Cycle::Cycle(const Grid& grid, std::vector<SensorSource*> sources, ControllerLink& link,
             std::size_t sensors, std::unique_ptr<CycleParts> parts, LastSent* last_sent)
    : grid_(grid),
      sources_(std::move(sources)),
      link_(link),
      last_sent_(last_sent),
      parts_(std::move(parts)),
      observed_(parts_.get()),
      readings_(sensors) {
  constexpr nanoseconds report_period = std::chrono::milliseconds(100);
  report_every_ =
      static_cast<std::uint64_t>(std::max<std::int64_t>(1, report_period / grid.period));
}

std::uint64_t Cycle::begin(nanoseconds now) noexcept {
  expected_ = newest_due(now);
  if (parts_->recorder) parts_->recorder->begin(expected_, parts_->estimator, SegmentReason::start);
  return expected_;
}

void Cycle::run() noexcept {
  std::uint64_t cycle = begin(now_on_clock());
  while (!stop_.load(std::memory_order_relaxed)) {
    const nanoseconds wake = grid_.time_of(cycle);
    if (!sleep_until(wake)) timing_.failed_sleeps.fetch_add(1, std::memory_order_relaxed);
    const nanoseconds start = now_on_clock();
    step(cycle);
    const nanoseconds end = now_on_clock();
    timing_.lateness.record(start - wake);
    timing_.work.record(end - start);
    timing_.cycles.store(timing_.cycles.load(std::memory_order_relaxed) + 1,
                         std::memory_order_release);
    cycle = next_after(cycle, end);
  }
}

void Cycle::step(std::uint64_t cycle) noexcept {
  // Recorded late: at the end, the last step's offsets must precede skipped cycles.
  if (cycle > expected_ && parts_->recorder) parts_->recorder->skipped(expected_, cycle - 1);
  cycle_ = cycle;
  expected_ = cycle + 1;
  has_stepped_ = true;
  take_over(cycle);
  CycleParts& parts = *parts_;
  bool commanded = false;
  for (Command command; commands_.try_pop(command); commanded = true) {
    if (parts.candidate) parts.candidate->command(command, parts.estimator);
    parts.estimator.apply(command);
    if (parts.recorder) parts.recorder->command(cycle, command);
  }
  for (SensorSource* source : sources_) source->newest(readings_);
  link_.newest(controller_);
  // Grid time, not the clock, so that a replay of the history repeats the same steps.
  parts.estimator.step(grid_.time_of(cycle), readings_, controller_, offsets_);
  // Precedes the offer: a kill in between must not leave an unrecorded offset at the controller.
  if (last_sent_ != nullptr) last_sent_->note(offsets_, parts.estimator.forgotten_axes());
  link_.offer(offsets_);
  if (parts.recorder)
    parts.recorder->record(cycle, readings_, controller_, offsets_, parts.estimator);
  if (parts.candidate) parts.candidate->step(grid_.time_of(cycle), readings_, controller_);
  publish(commanded);
  // Only after the new parts have published a report.
  if (retiring_ != nullptr)
    retired_.store(std::exchange(retiring_, nullptr), std::memory_order_release);
  // Last, so that a reader that sees the command done also sees a change-over of the same step.
  if (commanded) commands_done_.store(commands_.taken(), std::memory_order_release);
}

std::optional<std::uint64_t> Cycle::finish_recording() noexcept {
  if (!has_stepped_) return std::nullopt;
  if (parts_->recorder) parts_->recorder->finish(cycle_, offsets_);
  return cycle_;
}

std::uint64_t Cycle::newest_due(nanoseconds now) const noexcept {
  return now < grid_.start ? 0 : static_cast<std::uint64_t>((now - grid_.start) / grid_.period);
}

std::uint64_t Cycle::next_after(std::uint64_t cycle, nanoseconds now) noexcept {
  // A cycle late by less than a period still runs; whole periods are skipped. The phase is kept.
  const std::uint64_t due = newest_due(now);
  if (due <= cycle + 1) return cycle + 1;
  timing_.missed.store(timing_.missed.load(std::memory_order_relaxed) + due - cycle - 1,
                       std::memory_order_relaxed);
  return due;
}

void Cycle::take_over(std::uint64_t cycle) noexcept {
  CycleParts* next = incoming_.exchange(nullptr, std::memory_order_acquire);
  if (next == nullptr) return;
  retiring_ = parts_.release();
  next->estimator.adopt(retiring_->estimator);
  // The candidate's lags and input reference have the history needed by the promoted model.
  if (next->promotes && retiring_->candidate)
    next->estimator.adopt_model(retiring_->candidate->estimator());
  if (next->candidate) next->candidate->adopt(retiring_->estimator, retiring_->candidate.get());
  if (next->recorder)
    next->recorder->begin(cycle, next->estimator, SegmentReason::reload, retiring_->recorder.get());
  parts_.reset(next);
  next_report_ = cycle;
}

void Cycle::publish(bool at_once) noexcept {
  if (!at_once && cycle_ < next_report_) return;
  next_report_ = cycle_ + report_every_;
  parts_->estimator.report(parts_->reports.back());
  parts_->reports.publish();
  controller_slot_.back() = controller_;
  controller_slot_.publish();
}

void Cycle::hand_over(std::unique_ptr<CycleParts> next) noexcept {
  THERMOCOMP_ENSURE(incoming_.load() == nullptr && retired_.load() == nullptr);
  handed_over_ = next.release();
  incoming_.store(handed_over_, std::memory_order_release);
}

std::unique_ptr<CycleParts> Cycle::take_retired() noexcept {
  std::unique_ptr<CycleParts> retired(retired_.exchange(nullptr, std::memory_order_acquire));
  if (retired) observed_ = handed_over_;
  return retired;
}

std::unique_ptr<CycleParts> Cycle::withdraw_parts() noexcept {
  return std::unique_ptr<CycleParts>(incoming_.exchange(nullptr, std::memory_order_acquire));
}

const Report& Cycle::report() noexcept {
  observed_->reports.fresh();
  return observed_->reports.front();
}

const ControllerState& Cycle::controller() noexcept {
  controller_slot_.fresh();
  return controller_slot_.front();
}

void Cycle::clear_timing() noexcept {
  timing_.lateness.clear();
  timing_.work.clear();
}

}  // namespace thermocomp
