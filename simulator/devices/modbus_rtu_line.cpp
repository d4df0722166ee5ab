#include "simulator/devices/modbus_rtu_line.hpp"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <stdexcept>
#include <termios.h>
#include <unistd.h>

namespace thermocomp {
namespace {

// Far more than 3.5 characters, for a client may be interrupted between two bytes.
constexpr nanoseconds silence = std::chrono::milliseconds(20);
constexpr double bits_a_character = 11.0;

}  // namespace

ModbusRtuLine::ModbusRtuLine(EventLoop& loop, std::filesystem::path link, RtuLineTiming timing,
                             ModbusAnswerer answerer)
    : loop_(loop), link_(std::move(link)), timing_(timing), answerer_(std::move(answerer)) {
  open_terminal();
  place_link();
  loop_.watch(master_, POLLIN, [this](short) { readable(); });
}

ModbusRtuLine::~ModbusRtuLine() {
  *alive_ = false;
  loop_.unwatch(master_);
  std::error_code error;
  if (std::filesystem::read_symlink(link_, error) == terminal_) {
    std::filesystem::remove(link_, error);
  }
  ::close(slave_);
  ::close(master_);
}

void ModbusRtuLine::open_terminal() {
  master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  std::array<char, 128> name{};
  if (master_ < 0 || ::grantpt(master_) != 0 || ::unlockpt(master_) != 0 ||
      ::ptsname_r(master_, name.data(), name.size()) != 0) {
    throw std::runtime_error(std::string("cannot open a pseudo terminal: ") + std::strerror(errno));
  }
  terminal_ = name.data();
  slave_ = ::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (slave_ < 0) {
    throw std::runtime_error("cannot open " + terminal_ + ": " + std::strerror(errno));
  }
  termios settings{};
  ::tcgetattr(slave_, &settings);
  ::cfmakeraw(&settings);  // bytes as they are, and no echo before a client sets it up
  ::tcsetattr(slave_, TCSANOW, &settings);
}

void ModbusRtuLine::place_link() {
  std::error_code error;
  const auto status = std::filesystem::symlink_status(link_, error);
  if (std::filesystem::is_symlink(status)) {
    std::filesystem::remove(link_, error);
  } else if (std::filesystem::exists(status)) {
    throw std::runtime_error("cannot put a link to the serial line at " + link_.string() +
                             ": something other than a symbolic link is there");
  }
  if (link_.has_parent_path()) std::filesystem::create_directories(link_.parent_path(), error);
  std::filesystem::create_symlink(terminal_, link_, error);
  if (error) {
    throw std::runtime_error("cannot put a link to the serial line at " + link_.string() + ": " +
                             error.message());
  }
}

void ModbusRtuLine::discard() {
  received_.clear();
  ++discards_;
}

void ModbusRtuLine::readable() {
  std::array<std::uint8_t, 1024> buffer{};
  const ssize_t count = ::read(master_, buffer.data(), buffer.size());
  if (count <= 0) return;
  received_.insert(received_.end(), buffer.begin(), buffer.begin() + count);
  ++receptions_;
  handle(false);
  if (received_.empty()) return;
  loop_.at(EventLoop::now() + silence, [this, alive = alive_, reception = receptions_] {
    if (*alive && reception == receptions_) handle(true);
  });
}

void ModbusRtuLine::handle(bool after_silence) {
  while (!received_.empty()) {
    const ModbusFrame frame = find_rtu_frame(received_, after_silence);
    if (frame.state == FrameState::incomplete) return;
    if (frame.state == FrameState::broken) {
      received_.clear();  // as a unit does: it waits for the next silence
      return;
    }
    answer(frame);
    received_.erase(received_.begin(),
                    received_.begin() + static_cast<std::ptrdiff_t>(frame.length));
  }
}

void ModbusRtuLine::answer(const ModbusFrame& frame) {
  const std::optional<WireAnswer> answer = answerer_(frame.unit, frame.pdu);
  if (!answer) return;
  const auto bytes = answer->raw ? answer->bytes : make_rtu_frame(frame.unit, answer->bytes);
  double delay_ms = answer->delay_ms;
  if (timing_.line_delay) {
    const double characters = static_cast<double>(frame.length + bytes.size()) + 3.5;
    delay_ms += 1000.0 * characters * bits_a_character / timing_.baud;
  }
  if (!(delay_ms > 0.0)) return write(bytes);
  const auto delay =
      std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double, std::milli>(delay_ms));
  loop_.at(EventLoop::now() + delay, [this, alive = alive_, bytes, discards = discards_] {
    if (*alive && discards == discards_) write(bytes);
  });
}

void ModbusRtuLine::write(std::span<const std::uint8_t> bytes) {
  // A client that never reads fills the terminal's queue; then bytes are lost, as on a wire.
  [[maybe_unused]] const ssize_t count = ::write(master_, bytes.data(), bytes.size());
}

}  // namespace thermocomp
