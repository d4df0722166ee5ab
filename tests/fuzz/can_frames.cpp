/// Messages of a CAN socket with error frames and time stamps, their decoding, and their assembly
/// into sets of values.
///
/// Input: signals, then the messages as delivered by the kernel.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <ctime>
#include <span>
#include <vector>

#include <linux/can.h>
#include <sys/socket.h>

#include "common/fuzz.hpp"
#include "common/virtual_line.hpp"
#include "drivers/bus_thread.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/can/signal_codec.hpp"
#include "drivers/controllers/kinds/can/travel_frames.hpp"
#include "estimator/checks.hpp"

using namespace thermocomp;

namespace {

std::vector<CanSignal> signals_from(fuzz::ByteFeed& feed) {
  std::vector<CanSignal> signals(1 + feed.u8() % 4);
  for (CanSignal& signal : signals) {
    const std::uint8_t kind = feed.u8();
    signal.byte_order = (kind & 1) != 0 ? ByteOrder::big_endian : ByteOrder::little_endian;
    signal.is_signed = (kind & 2) != 0;
    signal.is_float = (kind & 4) != 0;
    signal.extended_id = (kind & 8) != 0;
    signal.id = feed.u16() & (signal.extended_id ? 0xFFFFu : 0x7FFu);
    signal.fd = (kind & 16) != 0;
    signal.start_bit = feed.u8() % 64 * (signal.fd ? 8 : 1);
    signal.length_bits = 1 + feed.u8() % 64;
    signal.scale = 0.1;
    if ((kind & 32) != 0) signal.selectors = {{{feed.u8() % 64, 4, {}}, {{feed.u8(), feed.u8()}}}};
  }
  const auto is_bad = [](const CanSignal& signal) {
    try {
      check(signal);
      return false;
    } catch (const InvalidValue&) {
      return true;
    }
  };
  signals.erase(std::remove_if(signals.begin(), signals.end(), is_bad), signals.end());
  return signals;
}

/// Appends a control message if it fits. @return bytes used
std::size_t put_control(const msghdr& header, std::size_t used, int type, const void* value,
                        std::size_t size) {
  if (used + CMSG_SPACE(size) > header.msg_controllen) return used;
  cmsghdr part{};
  part.cmsg_level = SOL_SOCKET;
  part.cmsg_type = type;
  part.cmsg_len = CMSG_LEN(size);
  auto* at = static_cast<std::uint8_t*>(header.msg_control) + used;
  std::memset(at, 0, CMSG_SPACE(size));
  std::memcpy(at, &part, sizeof part);
  std::memcpy(at + CMSG_LEN(0), value, size);
  return used + CMSG_SPACE(size);
}

/// One message: a frame of any kind, sometimes with a time stamp or a count of lost frames,
/// sometimes shorter or longer than a frame.
bool deliver(fuzz::ByteFeed& feed, std::size_t& frames, mmsghdr& message) {
  if (feed.empty()) return false;
  const std::uint8_t kind = feed.u8();
  if ((kind & 0x80) != 0) return false;  // the end of a batch
  const bool fd = (kind & 64) != 0;
  canfd_frame frame{};
  frame.can_id = feed.u16();
  if ((kind & 1) != 0) frame.can_id |= CAN_EFF_FLAG;
  if ((kind & 2) != 0) frame.can_id |= CAN_ERR_FLAG;
  if ((kind & 4) != 0) frame.can_id |= CAN_RTR_FLAG;
  frame.len = feed.u8();
  const std::span<std::uint8_t> data(frame.data, fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
  for (std::uint8_t& byte : data) byte = feed.u8();
  std::memcpy(message.msg_hdr.msg_iov[0].iov_base, &frame, sizeof frame);
  const auto whole = static_cast<unsigned>(fd ? CANFD_MTU : CAN_MTU);
  message.msg_len = (kind & 8) != 0 ? feed.u8() : whole;
  std::size_t used = 0;
  if ((kind & 16) != 0) {
    timespec stamp{};
    stamp.tv_sec = static_cast<time_t>(feed.u64() >> 31);  // far beyond any year
    stamp.tv_nsec = static_cast<long>(feed.u64() % 1'000'000'000);
    used = put_control(message.msg_hdr, used, SCM_TIMESTAMPNS, &stamp, sizeof stamp);
  }
  if ((kind & 32) != 0) {
    const auto lost = static_cast<std::uint32_t>(feed.u64());
    used = put_control(message.msg_hdr, used, SO_RXQ_OVFL, &lost, sizeof lost);
  }
  message.msg_hdr.msg_controllen = used;
  ++frames;
  return true;
}

void check_frame(const CanFrame& frame, const std::vector<CanSignal>& signals) {
  FUZZ_REQUIRE(frame.size <= (frame.fd ? can_bytes_max : can_classic_bytes_max));
  FUZZ_REQUIRE(frame.id.id <= (frame.id.extended ? 0x1FFFFFFFu : 0x7FFu));
  const nanoseconds age = monotonic_now() - frame.received_at;
  FUZZ_REQUIRE(age >= nanoseconds{0} && age <= std::chrono::seconds(10));
  for (const CanSignal& signal : signals) {
    if (signal.id != frame.id.id || signal.extended_id != frame.id.extended) continue;
    if (!carries(frame.payload(), signal)) continue;
    const CanValue value = decode(frame.payload(), signal);
    FUZZ_REQUIRE(std::isfinite(value.value) == (value.fault == Fault::none));
    FUZZ_REQUIRE(frame.size >= bytes_needed(signal) || value.fault == Fault::bad_frame);
  }
}

/// Two identifiers with a value in the first bytes and the set's number in the last byte.
class TwoFrames {
 public:
  static constexpr std::array<std::uint32_t, 2> ids{0x100, 0x101};

  void take(const CanFrame& frame) {
    const CanSetReader::Taken taken = reader_.take(frame);
    for (std::size_t i = 0; i < ids.size(); ++i)
      if (frame.id == CanId{ids[i], false} && frame.size >= 8) newest_[i] = frame;
    if (taken != CanSetReader::Taken::whole) return;
    FUZZ_REQUIRE(newest_[0].data[7] == newest_[1].data[7]);
    FUZZ_REQUIRE(reader_.number() == newest_[0].data[7]);
    for (std::size_t i = 0; i < ids.size(); ++i)
      FUZZ_REQUIRE(reader_.values()[i] == newest_[i].data[0] + 256.0 * newest_[i].data[1]);
  }

 private:
  static CanSet set() {
    CanSet set;
    for (const std::uint32_t id : ids) {
      CanSignal value;
      value.id = id;
      value.is_signed = false;
      CanSignal number = value;
      number.start_bit = 56;
      number.length_bits = 8;
      set.values.push_back(value);
      set.numbers.push_back(number);
    }
    return set;
  }
  CanSetReader reader_{set()};
  std::array<CanFrame, 2> newest_{};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteFeed feed(data, size);
  const std::vector<CanSignal> signals = signals_from(feed);
  std::vector<CanId> wanted;
  for (const CanSignal& signal : signals) wanted.push_back({signal.id, signal.extended_id});
  for (const std::uint32_t id : TwoFrames::ids) wanted.push_back({id, false});
  TwoFrames two_frames;
  std::size_t delivered = 0;
  const fuzz::VirtualCan bus([&](mmsghdr& message) { return deliver(feed, delivered, message); });
  CanSocket socket("can0", wanted);
  FUZZ_REQUIRE(socket.open() && !socket.bus_off() && socket.error().empty());
  std::size_t handed_out = 0;
  while (!feed.empty()) {
    const auto frames = socket.receive();
    FUZZ_REQUIRE(frames.size() <= CanSocket::batch_max);
    handed_out += frames.size();
    for (const CanFrame& frame : frames) {
      check_frame(frame, signals);
      two_frames.take(frame);
    }
    FUZZ_REQUIRE(socket.is_open());
    FUZZ_REQUIRE(!socket.bus_off() || !socket.error().empty());
  }
  FUZZ_REQUIRE(handed_out + socket.errors().error_frames <= delivered);
  return 0;
}
