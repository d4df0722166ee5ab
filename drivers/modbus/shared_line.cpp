#include "drivers/modbus/shared_line.hpp"

#include <algorithm>
#include <map>

namespace thermocomp {
namespace {

/// Lines with the same address text are one.
std::string address_of(const ModbusLine& line) {
  std::string text = kind_of(line);
  if (const S7Block* s7 = s7_of(line))
    for (const int part : {s7->db, s7->rack, s7->slot}) text += ' ' + std::to_string(part);
  if (const auto* tcp = std::get_if<ModbusTcp>(&line.link))
    return text + ' ' + tcp->host + ' ' + std::to_string(tcp->port) +
           (line.ignore_transaction ? " any" : "");
  return text + ' ' + std::get<ModbusRtu>(line.link).device;
}

}  // namespace

std::shared_ptr<SharedLine> SharedLine::of(const ModbusLine& line) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<SharedLine>> lines;
  check_line(line);
  const std::scoped_lock lock(mutex);
  std::weak_ptr<SharedLine>& known = lines[address_of(line)];
  std::shared_ptr<SharedLine> shared = known.lock();
  if (!shared || shared->connection().cancelled())
    known = shared = std::make_shared<SharedLine>(line);
  return shared;
}

bool SharedLine::has(const LineUser& user) const noexcept {
  return std::any_of(members_.begin(), members_.end(),
                     [&](const Member& member) { return member.user == &user; });
}

void SharedLine::remove(const LineUser& user) noexcept {
  std::erase_if(members_, [&](const Member& member) { return member.user == &user; });
  changed_.notify_all();
}

void SharedLine::join(LineUser& user, const std::string& name) {
  {
    const std::scoped_lock lock(mutex_);
    members_.push_back({&user});
    if (members_.size() > 1) connection_.share();
    changed_.notify_all();
  }
  if (!thread_.running()) thread_.start(name, [this] { run(); });
}

void SharedLine::leave(LineUser& user, nanoseconds patience) noexcept {
  std::unique_lock lock(mutex_);
  for (Member& member : members_)
    if (member.user == &user) member.is_leaving = true;
  changed_.notify_all();
  const auto is_gone = [&] { return !has(user); };
  // Waits on the monotonic clock, so that a step of the wall clock cannot prolong the stop.
  changed_.wait_until(lock, std::chrono::steady_clock::now() + patience, is_gone);
  if (!is_gone() && (members_.size() == 1 || acting_ == &user)) {
    connection_.cancel();
    changed_.wait(lock, is_gone);
  }
  remove(user);
  const bool is_last = members_.empty();
  lock.unlock();
  if (is_last) thread_.join();
}

const SharedLine::Member& SharedLine::next_member() const noexcept {
  const auto due = [](const Member& member) {
    return member.is_leaving ? nanoseconds{0} : member.user->next_action_at();
  };
  return *std::min_element(members_.begin(), members_.end(),
                           [&](const auto& a, const auto& b) { return due(a) < due(b); });
}

void SharedLine::run() {
  std::unique_lock lock(mutex_);
  while (!members_.empty() && !connection_.cancelled()) {
    const Member member = next_member();
    const auto due = std::chrono::steady_clock::time_point(member.user->next_action_at());
    if (!member.is_leaving && due > std::chrono::steady_clock::now()) {
      changed_.wait_until(lock, due);
      continue;
    }
    acting_ = member.user;
    lock.unlock();
    connection_.time_as(member.user->line());
    if (member.is_leaving)
      member.user->end();
    else
      member.user->act();
    lock.lock();
    acting_ = nullptr;
    if (member.is_leaving) remove(*member.user);
  }
  members_.clear();
  changed_.notify_all();
}

}  // namespace thermocomp
