#include "daemon/socket/line_buffer.hpp"

namespace thermocomp {
namespace {

/// An idle client keeps no more than this.
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

/// Also gives back what is done with.
void LineBuffer::find_end() {
  end_ = bytes_.find('\n', searched_);
  if (has_line()) return;
  bytes_.erase(0, begin_);
  begin_ = 0;
  searched_ = bytes_.size();
  if (bytes_.empty() && bytes_.capacity() > kept_bytes) bytes_ = std::string();
}

}  // namespace thermocomp
