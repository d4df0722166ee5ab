#include "daemon/cycle/cycle_handle.hpp"

#include <algorithm>
#include <utility>

#include "estimator/checks.hpp"

namespace thermocomp {

CycleHandle::Tracked CycleHandle::send(const Command& command, Clock::time_point now) {
  THERMOCOMP_ENSURE(!replacing() || !has_index(command.kind));
  // Overdue commands count too, so that no queue number is reused.
  if (commands_.size() >= CommandQueue::capacity) return nullptr;
  const auto number = cycle_.send(command);
  if (!number) return nullptr;
  commands_.push_back(
      {*number, command, now + patience, std::make_shared<Outcome>(Outcome::waiting)});
  return commands_.back().outcome;
}

CycleHandle::Tracked CycleHandle::replace(std::unique_ptr<CycleParts> next, Clock::time_point now) {
  THERMOCOMP_ENSURE(!replacing());
  replacement_ = {std::move(next), now + patience, std::make_shared<Outcome>(Outcome::waiting)};
  hand_over_staged();
  return replacement_.outcome;
}

void CycleHandle::hand_over_staged() {
  const bool must_wait =
      std::any_of(commands_.begin(), commands_.end(),
                  [](const SentCommand& sent) { return has_index(sent.command.kind); });
  if (replacement_.staged && !must_wait) cycle_.hand_over(std::move(replacement_.staged));
}

void CycleHandle::poll(Clock::time_point now) {
  finish_commands();
  hand_over_staged();
  for (SentCommand& sent : commands_) {
    if (now < sent.deadline || *sent.outcome != Outcome::waiting) continue;
    *sent.outcome = cycle_.withdraw(sent.number) ? Outcome::withdrawn : Outcome::overdue;
  }
  std::erase_if(commands_,
                [](const SentCommand& sent) { return *sent.outcome == Outcome::withdrawn; });
  if (!replacing() || now < replacement_.deadline) return;
  if (withdraw_replacement())
    end_replacement(Outcome::withdrawn);
  else
    *replacement_.outcome = Outcome::overdue;
}

void CycleHandle::settle() {
  finish_commands();
  for (SentCommand& sent : commands_) *sent.outcome = Outcome::withdrawn;
  commands_.clear();
  if (replacing() && withdraw_replacement()) end_replacement(Outcome::withdrawn);
}

void CycleHandle::finish_commands() {
  // In this order: the new parts report a command of the step in which they took over.
  const std::uint64_t done = cycle_.commands_done();
  finish_replacement();
  std::vector<SentCommand> finished;
  const auto first_left =
      std::find_if(commands_.begin(), commands_.end(),
                   [=](const SentCommand& sent) { return sent.number >= done; });
  finished.assign(std::make_move_iterator(commands_.begin()), std::make_move_iterator(first_left));
  commands_.erase(commands_.begin(), first_left);
  for (SentCommand& sent : finished) {
    command_done_(sent.command);
    *sent.outcome = Outcome::done;
  }
}

void CycleHandle::finish_replacement() {
  // The old parts are freed here, not in the cycle.
  if (replacing() && cycle_.take_retired() != nullptr) end_replacement(Outcome::done);
}

bool CycleHandle::withdraw_replacement() {
  return std::exchange(replacement_.staged, nullptr) != nullptr ||
         cycle_.withdraw_parts() != nullptr;
}

void CycleHandle::end_replacement(Outcome outcome) {
  *std::exchange(replacement_.outcome, nullptr) = outcome;
}

}  // namespace thermocomp
