#include <algorithm>
#include <array>
#include <cstdio>
#include <vector>

#include "drivers/modbus/modbus_codec.hpp"
#include "drivers/modbus/port.hpp"

namespace thermocomp {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Byte positions in a Modbus TCP frame.
constexpr std::size_t unit_at = 6;
constexpr std::size_t function_at = 7;
constexpr std::size_t address_at = 8;
constexpr std::size_t count_at = 10;
constexpr std::size_t written_at = 13;
constexpr std::uint8_t read_registers = 3;
constexpr std::uint8_t write_registers = 16;

// Byte positions in an S7 frame: TPKT, COTP, header of a job or its answer, parameters, data.
constexpr std::size_t tpkt_bytes = 4;
constexpr std::size_t cotp_kind_at = 5;
constexpr std::size_t s7_at = 7;
constexpr std::size_t number_at = s7_at + 4;
constexpr std::size_t parameter_size_at = s7_at + 6;
constexpr std::size_t error_class_at = s7_at + 10;
constexpr std::size_t answer_at = s7_at + 12;  ///< parameters of the answer
constexpr std::uint8_t setup = 0xF0;
constexpr std::uint8_t read_variable = 4;
constexpr std::uint8_t write_variable = 5;
constexpr int good = 0xFF;

constexpr std::size_t size_at(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
  return word_at(bytes, at);
}

void push_word(Bytes& bytes, std::size_t word) {
  bytes.push_back(static_cast<std::uint8_t>((word >> 8) & 0xFF));
  bytes.push_back(static_cast<std::uint8_t>(word & 0xFF));
}

void append(Bytes& bytes, std::span<const std::uint8_t> more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

Bytes framed(std::span<const std::uint8_t> cotp) {
  Bytes frame{3, 0};
  push_word(frame, tpkt_bytes + cotp.size());
  append(frame, cotp);
  return frame;
}

/// @param number  returned in its answer
Bytes job(std::size_t number, const Bytes& parameters, const Bytes& data = {}) {
  Bytes bytes{2, 0xF0, 0x80, 0x32, 1, 0, 0};
  push_word(bytes, number);
  push_word(bytes, parameters.size());
  push_word(bytes, data.size());
  append(bytes, parameters);
  append(bytes, data);
  return framed(bytes);
}

Bytes connection_request(const S7Block& block) {
  constexpr std::uint8_t basic = 3;  // connection type: neither programming device nor panel
  const auto place = static_cast<std::uint8_t>(block.rack * S7Block::slots + block.slot);
  return framed(
      Bytes{17, 0xE0, 0, 0, 0, 1, 0, 0xC0, 1, 10, 0xC1, 2, basic, 0, 0xC2, 2, basic, place});
}

/// S7 job that reads or writes the bytes of a request's words.
Bytes job_of(std::span<const std::uint8_t> request, const S7Block& block) {
  const bool writes = request[function_at] == write_registers;
  const std::size_t bytes = 2 * size_at(request, count_at);
  const std::size_t first_bit = 16 * size_at(request, address_at);
  Bytes item{writes ? write_variable : read_variable, 1, 0x12, 10, 0x10, 2};  // counted in bytes
  push_word(item, bytes);
  push_word(item, static_cast<std::size_t>(block.db));
  item.push_back(0x84);  // area: data block
  item.push_back(static_cast<std::uint8_t>(first_bit >> 16));
  push_word(item, first_bit);
  if (!writes) return job(size_at(request, 0), item);
  Bytes data{0, 4};  // length in bits
  push_word(data, 8 * bytes);
  append(data, request.subspan(written_at, bytes));
  return job(size_at(request, 0), item, data);
}

bool is_answer(std::span<const std::uint8_t> frame) noexcept {
  return frame.size() >= answer_at && frame[cotp_kind_at] == 0xF0 && frame[s7_at] == 0x32 &&
         (frame[s7_at + 1] == 2 || frame[s7_at + 1] == 3);
}

/// @return empty if the connection is confirmed
std::string connection_problem(std::span<const std::uint8_t> frame) {
  constexpr std::uint8_t confirm = 0xD0;
  constexpr std::uint8_t disconnect = 0x80;
  constexpr std::size_t reason_at = 10;
  const std::uint8_t kind = frame[cotp_kind_at];
  if ((kind & 0xF0) == confirm) return "";
  if (kind != disconnect) return "the answer confirms no connection: " + hex_text(frame);
  return "disconnect request" +
         (frame.size() > reason_at ? ", reason " + std::to_string(frame[reason_at]) : "");
}

/// @return empty if PDUs are long enough for every job
std::string setup_problem(std::span<const std::uint8_t> frame) {
  constexpr std::size_t pdu_bytes_at = answer_at + 6;
  if (!is_answer(frame) || frame.size() < pdu_bytes_at + 2 || frame[error_class_at] != 0 ||
      frame[answer_at] != setup)
    return "the setup is refused: " + hex_text(frame.subspan(tpkt_bytes));
  const std::size_t bytes = size_at(frame, pdu_bytes_at);
  if (bytes >= S7Block::pdu_bytes) return "";
  return "PDUs of " + std::to_string(bytes) + " bytes, " + std::to_string(S7Block::pdu_bytes) +
         " are needed";
}

std::string hex_code(int code) {
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "0x%02X", static_cast<unsigned>(code) & 0xFF);
  return text.data();
}

constexpr const char* permit =
    "permit PUT/GET access by remote partners and full access in the CPU's protection settings";

/// @param code  return code of the item
std::string refusal_of(int code, const std::string& block) {
  const std::string optimised = "clear \"Optimized block access\" of it and load it again";
  std::string text = "return code " + hex_code(code);
  switch (code) {
    case 0x03:
      return text + " (access is not allowed): " + permit;
    case 0x05:
      return text + " (address out of range): " + block + " is shorter, or " + optimised;
    case 0x0A:
      return text + " (the object does not exist): load " + block + " into the CPU, or " +
             optimised;
    default:
      return text;
  }
}

/// Carries Modbus TCP requests and answers over an S7 link. A refused job becomes exception 0x80 |
/// error class or return code.
class S7Port final : public ModbusPort {
 public:
  S7Port(const S7Block& block, std::unique_ptr<ModbusPort> tcp, nanoseconds timeout)
      : block_(block), tcp_(std::move(tcp)), timeout_(timeout) {}

  [[nodiscard]] nanoseconds now() const noexcept override { return tcp_->now(); }
  bool open(std::string& why) override;
  void close() noexcept override;
  bool send(std::span<const std::uint8_t> bytes) noexcept override;
  PortWait wait_for_input(nanoseconds deadline) noexcept override;
  PortBytes receive(std::span<std::uint8_t> into) noexcept override;
  bool pause_until(nanoseconds time) noexcept override { return tcp_->pause_until(time); }
  void cancel() noexcept override { tcp_->cancel(); }
  [[nodiscard]] bool cancelled() const noexcept override { return tcp_->cancelled(); }
  [[nodiscard]] std::string refusal() const override { return refusal_; }

 private:
  bool ask(const Bytes& request, std::string& why);
  [[nodiscard]] std::size_t next_frame() const noexcept;
  PortBytes::Kind pull() noexcept;
  [[nodiscard]] Bytes pdu_of_answer();

  S7Block block_;
  std::unique_ptr<ModbusPort> tcp_;
  nanoseconds timeout_;
  Bytes stream_;
  Bytes frame_;  ///< last frame of stream_
  std::array<std::uint8_t, ModbusFrames::frame_bytes_max> request_{};
  std::string refusal_;
};

bool S7Port::open(std::string& why) {
  if (!tcp_->open(why)) return false;
  const std::string place =
      "rack " + std::to_string(block_.rack) + ", slot " + std::to_string(block_.slot);
  Bytes parameters{setup, 0, 0, 1, 0, 1};  // one job at a time
  push_word(parameters, 2 * S7Block::pdu_bytes);
  if (!ask(connection_request(block_), why) || !(why = connection_problem(frame_)).empty()) {
    why = "the connection to " + place + " is refused (" + why +
          "): set rack and slot of the CPU: S7-300 slot 2, S7-1200 and S7-1500 slot 1, S7-400 as "
          "in the hardware configuration";
  } else if (!ask(job(0, parameters), why) || !(why = setup_problem(frame_)).empty()) {
    why = "S7 communication with " + place + " does not begin (" + why +
          "): all connections of the CPU are in use, or " + permit;
  }
  if (!why.empty()) close();
  return why.empty();
}

void S7Port::close() noexcept {
  tcp_->close();
  stream_.clear();
}

/// @return true if frame_ is an answer; else `why` has the reason
bool S7Port::ask(const Bytes& request, std::string& why) {
  const nanoseconds deadline = now() + timeout_;
  why = "the request could not be sent";
  if (!tcp_->send(request)) return false;
  why = "no answer";
  while (wait_for_input(deadline) == PortWait::ready) {
    const PortBytes::Kind kind = pull();
    if (kind == PortBytes::Kind::bytes) return true;
    if (kind == PortBytes::Kind::nothing) continue;
    why = stream_.empty() ? "it closes the connection"
                          : "received bytes are not ISO-on-TCP (" + hex_text(stream_) + ")";
    return false;
  }
  return false;
}

/// Size of the frame at the front of the stream; 0: incomplete; SIZE_MAX: not a frame.
std::size_t S7Port::next_frame() const noexcept {
  constexpr std::size_t frame_bytes_max = 2048;
  if (!stream_.empty() && stream_[0] != 3) return SIZE_MAX;
  if (stream_.size() < tpkt_bytes) return 0;
  const std::size_t size = size_at(stream_, 2);
  if (size < s7_at || size > frame_bytes_max) return SIZE_MAX;
  return size <= stream_.size() ? size : 0;
}

/// @return bytes: frame_ is complete; lost: the line, or the start of the next frame
PortBytes::Kind S7Port::pull() noexcept {
  if (next_frame() == 0) {
    std::array<std::uint8_t, ModbusFrames::frame_bytes_max> part{};
    const PortBytes came = tcp_->receive(part);
    if (came.kind != PortBytes::Kind::bytes) return came.kind;
    append(stream_, std::span(part).first(came.size));
  }
  const std::size_t size = next_frame();
  if (size == 0) return PortBytes::Kind::nothing;
  if (size == SIZE_MAX) return PortBytes::Kind::lost;
  const auto end = stream_.begin() + static_cast<std::ptrdiff_t>(size);
  frame_.assign(stream_.begin(), end);
  stream_.erase(stream_.begin(), end);
  return PortBytes::Kind::bytes;
}

bool S7Port::send(std::span<const std::uint8_t> bytes) noexcept {
  std::copy(bytes.begin(), bytes.end(), request_.begin());
  const std::uint8_t function = bytes[function_at];
  return (function == read_registers || function == write_registers) &&
         tcp_->send(job_of(bytes, block_));
}

PortWait S7Port::wait_for_input(nanoseconds deadline) noexcept {
  if (next_frame() == 0) return tcp_->wait_for_input(deadline);
  return now() < deadline ? PortWait::ready : PortWait::late;
}

PortBytes S7Port::receive(std::span<std::uint8_t> into) noexcept {
  const PortBytes::Kind kind = pull();
  if (kind != PortBytes::Kind::bytes) return {kind};
  const Bytes pdu = pdu_of_answer();
  if (pdu.empty() || into.size() < function_at + pdu.size()) return {PortBytes::Kind::nothing};
  Bytes answer{frame_[number_at], frame_[number_at + 1], 0, 0};
  push_word(answer, 1 + pdu.size());
  answer.push_back(request_[unit_at]);
  append(answer, pdu);
  std::copy(answer.begin(), answer.end(), into.begin());
  return {PortBytes::Kind::bytes, answer.size()};
}

/// PDU of frame_ as in Modbus; empty: not the answer to a job.
Bytes S7Port::pdu_of_answer() {
  constexpr std::size_t item_head_bytes = 4;
  if (!is_answer(frame_)) return {};
  const std::uint8_t function = request_[function_at];
  const auto refused = [&](int code, const std::string& text) {
    refusal_ = text;
    return Bytes{static_cast<std::uint8_t>(function | exception_bit),
                 static_cast<std::uint8_t>(code | exception_bit)};
  };
  if (const int error = frame_[error_class_at]; error != 0)
    return refused(error, "error class " + hex_code(error) + ", code " +
                              hex_code(frame_[error_class_at + 1]) + ": " + permit);
  const std::size_t item = answer_at + size_at(frame_, parameter_size_at);
  if (item == answer_at || item >= frame_.size()) return {};
  if (frame_[item] != good)
    return refused(frame_[item], refusal_of(frame_[item], "DB" + std::to_string(block_.db)));
  if (function == write_registers)
    return {function, request_[address_at], request_[address_at + 1], request_[count_at],
            request_[count_at + 1]};
  if (item + item_head_bytes > frame_.size()) return {};
  // Data of another length are passed on: the connection reports the expected length.
  constexpr int last_type_in_bits = 5;
  const std::size_t length = size_at(frame_, item + 2);
  const auto data = std::span<const std::uint8_t>(frame_).subspan(item + item_head_bytes);
  const std::size_t size = std::min({frame_[item + 1] <= last_type_in_bits ? length / 8 : length,
                                     data.size(), S7Block::pdu_bytes});
  Bytes pdu{function, static_cast<std::uint8_t>(size)};
  append(pdu, data.first(size));
  return pdu;
}

}  // namespace

std::unique_ptr<ModbusPort> make_s7_port(const S7Block& block, std::unique_ptr<ModbusPort> tcp,
                                         nanoseconds timeout) {
  return std::make_unique<S7Port>(block, std::move(tcp), timeout);
}

}  // namespace thermocomp
