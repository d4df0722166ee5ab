#include "drivers/can/can_socket.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <iterator>
#include <unistd.h>

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "drivers/bus_thread.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// The kernel withdraws the carrier up to a second after a bus-off, and accepts frames until then.
constexpr nanoseconds carrier_delay = std::chrono::seconds{2};

nanoseconds to_nanoseconds(const timespec& time) noexcept {
  return std::chrono::seconds{time.tv_sec} + nanoseconds{time.tv_nsec};
}

nanoseconds wall_clock_now() noexcept {
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  return to_nanoseconds(time);
}

std::string error_text(int code) {
  return std::strerror(code);
}

can_filter masked_filter(const CanFilter& wanted) noexcept {
  can_filter filter{};
  // CAN_RTR_FLAG in the mask also excludes remote requests, which carry no data.
  const std::uint32_t bits = wanted.id.extended ? CAN_EFF_MASK : CAN_SFF_MASK;
  filter.can_id = wanted.id.id | (wanted.id.extended ? CAN_EFF_FLAG : 0u);
  filter.can_mask = (wanted.mask & bits) | CAN_EFF_FLAG | CAN_RTR_FLAG;
  return filter;
}

can_filter filter_for(const CanId& wanted) noexcept {
  return masked_filter({wanted, CAN_EFF_MASK});
}

/// @param raw  a classic frame has the same layout, up to byte 8 of the data
void to_frame(const canfd_frame& raw, bool fd, nanoseconds received_at, CanFrame& frame) noexcept {
  frame.id.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.id.id = raw.can_id & (frame.id.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.fd = fd;
  frame.size = std::min<std::size_t>(raw.len, fd ? can_bytes_max : can_classic_bytes_max);
  std::copy_n(std::begin(raw.data), frame.size, frame.data.begin());
  frame.received_at = received_at;
}

}  // namespace

/// Buffers of one recvmmsg batch.
struct CanSocket::Buffers {
  static constexpr std::size_t control_bytes =
      CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t));
  struct alignas(cmsghdr) Control {
    std::array<char, control_bytes> bytes;
  };
  std::array<canfd_frame, batch_max> frames{};
  std::array<iovec, batch_max> parts{};
  std::array<Control, batch_max> controls{};
  std::array<mmsghdr, batch_max> messages{};
  std::size_t used{batch_max};  ///< written by the kernel; all before the first batch

  void prepare() noexcept {
    for (std::size_t i = 0; i < used; ++i) {
      parts[i] = {&frames[i], sizeof(canfd_frame)};
      messages[i] = {};
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = controls[i].bytes.data();
      messages[i].msg_hdr.msg_controllen = control_bytes;
    }
    used = 0;
  }
};

std::string hexadecimal(std::uint64_t number, int digits) {
  std::array<char, 20> text{};
  std::snprintf(text.data(), text.size(), "0x%0*llX", digits,
                static_cast<unsigned long long>(number));
  return text.data();
}

std::string to_string(const CanId& id) {
  return hexadecimal(id.id, id.extended ? 8 : 3);
}

std::string_view to_string(CanState state) noexcept {
  switch (state) {
    case CanState::down:
      return "down";
    case CanState::active:
      return "active";
    case CanState::warning:
      return "warning";
    case CanState::passive:
      return "passive";
    case CanState::bus_off:
      return "bus_off";
  }
  return "unknown";
}

std::string can_unavailable() {
  const int probe = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  if (probe < 0) return error_text(errno);
  ::close(probe);
  return {};
}

nanoseconds monotonic_stamp(nanoseconds realtime_stamp, nanoseconds realtime_now,
                            nanoseconds monotonic_now) noexcept {
  constexpr nanoseconds oldest = std::chrono::seconds{1};
  return monotonic_now - std::clamp(realtime_now - realtime_stamp, nanoseconds{0}, oldest);
}

std::size_t whole_frame_bytes(std::size_t size) noexcept {
  constexpr std::array<std::size_t, 7> sizes{12, 16, 20, 24, 32, 48, 64};
  return size <= can_classic_bytes_max ? size : *std::lower_bound(sizes.begin(), sizes.end(), size);
}

CanSocket::CanSocket(std::string interface, std::vector<CanId> wanted)
    : interface_(std::move(interface)),
      wanted_(std::move(wanted)),
      state_since_(monotonic_now()),
      buffers_(std::make_unique<Buffers>()) {
  if (interface_.empty() || interface_.size() >= IFNAMSIZ) {
    throw InvalidValue("interface", interface_, "must be the name of a network interface");
  }
  std::sort(wanted_.begin(), wanted_.end());
  wanted_.erase(std::unique(wanted_.begin(), wanted_.end()), wanted_.end());
  require(wanted_.size() <= filters_max, "id", static_cast<double>(wanted_.size()),
          "at most 512 different identifiers can be received on one interface");
  received_.reserve(batch_max);
}

void CanSocket::add_filter(const CanFilter& filter) {
  filters_.push_back(filter);
  require(wanted_.size() + filters_.size() <= filters_max, "id",
          static_cast<double>(wanted_.size() + filters_.size()),
          "at most 512 different identifiers can be received on one interface");
}

void CanSocket::watch_own(const std::vector<CanId>& ids) {
  watches_own_ = true;
  for (const CanId& id : ids) add_filter({id});
}

CanSocket::~CanSocket() {
  close();
}

void CanSocket::fail(const char* what, int code) {
  close();
  error_ = interface_ + ": " + what + ": " + error_text(code);
}

void CanSocket::close() noexcept {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  without_carrier_ = false;
  send_failed_ = false;
  if (state_ != CanState::down) state_since_ = monotonic_now();
  state_ = CanState::down;
}

void CanSocket::enter(CanState state) {
  if (state == state_) return;
  state_since_ = monotonic_now();
  state_ = state;
  send_failed_ = false;
  report_state();
}

/// Sets error() from the state of the bus.
void CanSocket::report_state() {
  switch (state_) {
    case CanState::bus_off:
      error_ = interface_ + ": bus-off";
      break;
    case CanState::passive:
      error_ = interface_ + ": error passive";
      break;
    case CanState::warning:
      error_ = interface_ + ": error warning";
      break;
    case CanState::active:
      error_.clear();
      break;
    case CanState::down:
      break;  // error() has the reason
  }
}

void CanSocket::look_for_carrier() {
  ifreq request{};
  interface_.copy(std::begin(request.ifr_name), IFNAMSIZ - 1);
  if (::ioctl(socket_, SIOCGIFFLAGS, &request) < 0) return;
  if ((request.ifr_flags & IFF_UP) == 0) return;  // receiving reports the error
  const bool none = (request.ifr_flags & IFF_RUNNING) == 0;
  if (none == without_carrier_) return;
  without_carrier_ = none;
  enter(none ? CanState::bus_off : CanState::active);
}

void CanSocket::returned() {
  without_carrier_ = false;
  carrier_known_at_ = {};
  enter(CanState::active);
}

bool CanSocket::open() {
  close();
  dropped_by_socket_ = 0;
  sent_out_ = 0;
  socket_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (socket_ < 0) {
    fail("opening a CAN socket", errno);
    return false;
  }
  if (!configure()) return false;
  enter(CanState::active);
  carrier_known_at_ = monotonic_now() + carrier_delay;
  look_for_carrier();
  return true;
}

bool CanSocket::configure() {
  ifreq request{};
  interface_.copy(std::begin(request.ifr_name), IFNAMSIZ - 1);
  if (::ioctl(socket_, SIOCGIFINDEX, &request) < 0) return fail("no such interface", errno), false;
  const int index = request.ifr_ifindex;
  // Binding to an interface that is down succeeds; only later calls fail.
  if (::ioctl(socket_, SIOCGIFFLAGS, &request) < 0) return fail("no such interface", errno), false;
  if ((request.ifr_flags & IFF_UP) == 0) return fail("interface", ENETDOWN), false;

  std::vector<can_filter> filters(wanted_.size());
  std::transform(wanted_.begin(), wanted_.end(), filters.begin(), filter_for);
  std::transform(filters_.begin(), filters_.end(), std::back_inserter(filters), masked_filter);
  const auto bytes = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  const can_err_mask_t every_error = CAN_ERR_MASK;
  const int on = 1;
  const auto set = [this](int level, int option, const void* value, std::size_t size) {
    return ::setsockopt(socket_, level, option, value, static_cast<socklen_t>(size)) == 0;
  };
  // Filters are set before the bind, so that no other frame is received in between. An empty list
  // is valid and receives nothing.
  if (!set(SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), bytes) ||
      !set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) ||
      !set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &every_error, sizeof every_error) ||
      (watches_own_ && !set(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on)) ||
      !set(SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) ||
      !set(SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on)) {
    return fail("setting socket options", errno), false;
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0) {
    return fail("bind", errno), false;
  }
  ask_for_room();
  return true;
}

/// Enlarges the receive queue, since the default holds about 30 ms of 1 Mbit/s. Without the
/// privilege the kernel limits it to net.core.rmem_max, which also works.
void CanSocket::ask_for_room() noexcept {
  const int bytes = 2'000'000;
  if (::setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) == 0) return;
  ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
}

std::span<const CanFrame> CanSocket::receive() {
  received_.clear();
  if (!is_open()) return {};
  if (without_carrier_ || carrier_known_at_ != nanoseconds{0}) {
    const bool is_known = monotonic_now() >= carrier_known_at_;
    look_for_carrier();  // once more after that time, even if this is rarely called
    if (is_known) carrier_known_at_ = {};
  }
  buffers_->prepare();
  const int count =
      ::recvmmsg(socket_, buffers_->messages.data(), batch_max, MSG_DONTWAIT, nullptr);
  if (count < 0) {
    if (errno != EAGAIN && errno != EINTR) fail("receiving", errno);
    return {};
  }
  buffers_->used = static_cast<std::size_t>(count);
  const nanoseconds realtime = wall_clock_now();
  const nanoseconds monotonic = monotonic_now();
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const canfd_frame& raw = buffers_->frames[i];
    const bool fd = buffers_->messages[i].msg_len == CANFD_MTU;
    if (!fd && buffers_->messages[i].msg_len != CAN_MTU) continue;
    const std::optional<nanoseconds> stamp = read_control(buffers_->messages[i].msg_hdr);
    CanFrame& frame = received_.emplace_back();
    to_frame(raw, fd, stamp ? monotonic_stamp(*stamp, realtime, monotonic) : monotonic, frame);
    if ((raw.can_id & CAN_ERR_FLAG) != 0) {
      note_error_frame(raw.can_id & CAN_ERR_MASK, frame.payload());
      received_.pop_back();
      continue;
    }
    if (bus_off() && monotonic - state_since_ >= carrier_delay) returned();
    // The kernel returns a frame of this socket once the interface has sent it.
    if ((buffers_->messages[i].msg_hdr.msg_flags & MSG_CONFIRM) != 0) {
      ++sent_out_;
      received_.pop_back();
    }
  }
  return received_;
}

std::optional<nanoseconds> CanSocket::read_control(msghdr& header) {
  std::optional<nanoseconds> stamp;
  for (cmsghdr* part = CMSG_FIRSTHDR(&header); part != nullptr; part = CMSG_NXTHDR(&header, part)) {
    if (part->cmsg_level != SOL_SOCKET) continue;
    if (part->cmsg_type == SCM_TIMESTAMPNS) {
      timespec time{};
      std::memcpy(&time, CMSG_DATA(part), sizeof time);
      stamp = to_nanoseconds(time);
    } else if (part->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t dropped = 0;
      std::memcpy(&dropped, CMSG_DATA(part), sizeof dropped);
      errors_.dropped += dropped - dropped_by_socket_;
      dropped_by_socket_ = dropped;
    }
  }
  return stamp;
}

void CanSocket::note_error_frame(std::uint32_t error_class, std::span<const std::uint8_t> data) {
  ++errors_.error_frames;
  if ((error_class & CAN_ERR_BUSOFF) != 0) {
    ++errors_.bus_off;
    enter(CanState::bus_off);
  }
  if ((error_class & CAN_ERR_RESTARTED) != 0) {
    ++errors_.restarted;
    returned();
  }
  if ((error_class & CAN_ERR_CRTL) != 0 && data.size() >= 2) note_error_state(data[1]);
}

/// @param bits  states of the receive and transmit counters; the worse is used
void CanSocket::note_error_state(unsigned bits) {
  const bool passive = (bits & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0;
  const bool warning = (bits & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0;
  if (passive) ++errors_.error_passive;
  if (warning) ++errors_.error_warning;
  if (bus_off()) return;
  if (passive) {
    enter(CanState::passive);
  } else if (warning) {
    enter(CanState::warning);
  } else if ((bits & CAN_ERR_CRTL_ACTIVE) != 0) {
    enter(CanState::active);
  }
}

bool CanSocket::send(const CanFrame& frame) {
  if (!is_open()) return false;
  canfd_frame raw{};
  raw.can_id = frame.id.id | (frame.id.extended ? CAN_EFF_FLAG : 0u);
  raw.len = static_cast<std::uint8_t>(whole_frame_bytes(frame.size));
  std::copy_n(frame.data.begin(), frame.size, std::begin(raw.data));
  const bool fd = frame.fd || frame.size > can_classic_bytes_max;
  const std::size_t bytes = fd ? CANFD_MTU : CAN_MTU;
  const ssize_t sent = ::send(socket_, &raw, bytes, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent == static_cast<ssize_t>(bytes)) {
    if (send_failed_) {
      send_failed_ = false;
      report_state();
    }
    return true;
  }
  // A full queue (bus-off, no acknowledgement) is a failed write, not a lost link.
  if (errno == EAGAIN || errno == ENOBUFS) {
    send_failed_ = true;
    error_ = interface_ + ": sending: " + error_text(errno);
  } else {
    fail("sending", errno);
  }
  return false;
}

}  // namespace thermocomp
