#include "daemon/socket/served_client.hpp"

#include <array>
#include <cerrno>
#include <unistd.h>

#include <sys/socket.h>

namespace thermocomp {
namespace {

/// Buffer capacity that an idle client keeps.
constexpr std::size_t kept_bytes = 2048;

}  // namespace

void LineBuffer::add(std::string_view bytes) {
  bytes_.append(bytes);
  if (!has_line()) find_end();
}

bool LineBuffer::take(std::string& line) {
  if (!has_line() || is_too_long()) return false;
  std::size_t length = end_ - begin_;
  if (length > 0 && bytes_[begin_ + length - 1] == '\r') --length;
  line.assign(bytes_, begin_, length);
  begin_ = searched_ = end_ + 1;
  find_end();
  return true;
}

bool LineBuffer::is_too_long() const noexcept {
  return (has_line() ? end_ : bytes_.size()) - begin_ > line_bytes_max;
}

/// Finds the next line end; releases unused capacity.
void LineBuffer::find_end() {
  end_ = bytes_.find('\n', searched_);
  if (has_line()) return;
  bytes_.erase(0, begin_);
  begin_ = 0;
  searched_ = bytes_.size();
  if (bytes_.empty() && bytes_.capacity() > kept_bytes) bytes_ = std::string();
}

ServedClient::ServedClient(int fd_in, const PeerAccess& access_in, const TokenBucket& tokens_in,
                           Clock::time_point now)
    : fd(fd_in),
      access(access_in),
      tokens(tokens_in),
      last_request(now),
      line_begun(now),
      last_taken(now) {}

ServedClient::~ServedClient() {
  close(fd);
}

void ServedClient::receive(Clock::time_point now) {
  std::array<char, std::size_t{16} * 1024> bytes{};
  const ssize_t count = recv(fd, bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (count > 0) {
    if (!input.is_partial()) line_begun = now;
    input.add({bytes.data(), static_cast<std::size_t>(count)});
  } else if (count == 0 || (hung_up && errno != EINTR)) {
    input_ended = true;
  } else if (errno != EAGAIN && errno != EINTR) {
    broken = true;
  }
}

void ServedClient::send(std::string_view text, Clock::time_point now) {
  if (broken) return;
  if (!has_unsent()) last_taken = now;
  output.append(text);
  flush(now);
}

void ServedClient::flush(Clock::time_point now) {
  while (has_unsent()) {
    const ssize_t count =
        ::send(fd, output.data() + sent, output.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) broken = true;
    if (count < 0) return;
    sent += static_cast<std::size_t>(count);
    last_taken = now;
  }
  line_begun = now;  // nothing was read from it until now
  sent = 0;
  output.clear();
  if (output.capacity() > kept_bytes) output = std::string();
}

}  // namespace thermocomp
