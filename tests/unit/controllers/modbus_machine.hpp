// Modbus TCP server of a CNC in a thread, for the tests of the link.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "../drivers/modbus_peer.hpp"

namespace thermocomp::test {

/// Serves one client at a time on 127.0.0.1. Registers live as long as the object and begin with
/// zeros, as after power-on.
class ModbusMachine {
 public:
  static constexpr int registers = 200;

  /// @param port  0: any free one
  explicit ModbusMachine(int port = 0)
      : device_([this](const peer::Request& request) { return answer(request); }, port) {}

  [[nodiscard]] int port() const { return device_.port(); }

  [[nodiscard]] std::uint16_t holding(int address) const {
    const std::scoped_lock lock(mutex_);
    return tables_[2].at(static_cast<std::size_t>(address));
  }
  void set_holding(int address, std::uint16_t value) { set(3, address, value); }
  void set_input(int address, std::uint16_t value) { set(4, address, value); }
  void set_discrete(int address, bool value) { set(2, address, value ? 1 : 0); }
  void set_coil(int address, bool value) { set(1, address, value ? 1 : 0); }

  /// Input registers 0..n mirror holding registers 0..n, as of a controller that applies offsets.
  std::atomic<int> mirrored{0};
  /// Writes are refused with "slave device failure".
  std::atomic<bool> refuse_writes{false};
  /// Writes are received and neither done nor answered.
  std::atomic<bool> ignore_writes{false};
  /// Writes below register 10 are answered and not done.
  std::atomic<bool> keep_offsets{false};
  /// A program sets registers 0 to 9 back 10 ms after each write.
  std::atomic<bool> sets_back{false};
  /// Duration of a read.
  std::atomic<std::chrono::milliseconds> read_takes{std::chrono::milliseconds{0}};
  /// The next write is lost in a restart: not answered, and reads give 0 from then on.
  std::atomic<bool> restart_on_write{false};
  /// Reads are answered with "slave device failure".
  std::atomic<bool> refuse_reads{false};
  /// Answer to a read of holding registers below 100: their content, an exception, or zeros.
  enum class Shows { all, exception, zeros };
  std::atomic<Shows> shows{Shows::all};
  /// Requests are received and never answered.
  std::atomic<bool> mute{false};
  std::atomic<int> writes{0};
  std::atomic<int> reads{0};

 private:
  static constexpr int device_failure = 4;
  static constexpr int illegal_address = 2;

  /// @param function  that reads the table
  [[nodiscard]] std::uint16_t& word(int function, int address) {
    return tables_.at(static_cast<std::size_t>(function - 1)).at(static_cast<std::size_t>(address));
  }
  void set(int function, int address, std::uint16_t value) {
    const std::scoped_lock lock(mutex_);
    word(function, address) = value;
  }

  peer::Reply answer(const peer::Request& request) {
    const bool is_write = request.function == 16 || request.function == 6;
    ++(is_write ? writes : reads);
    if (mute || (is_write && ignore_writes)) return {};
    if (!is_write) std::this_thread::sleep_for(read_takes.load());
    const std::scoped_lock lock(mutex_);
    if (is_write && restart_on_write.exchange(false)) {
      mirrored = 0;
      tables_[3].fill(0);
      return {};
    }
    if (sets_back && std::chrono::steady_clock::now() - written_at_ > std::chrono::milliseconds{10})
      std::copy(kept_.begin(), kept_.end(), tables_[2].begin());
    if (is_write ? refuse_writes : refuse_reads) return peer::exception(request, device_failure);
    const peer::Reply reply = is_write ? write(request) : read(request);
    for (int i = 0; i < mirrored; ++i) word(4, i) = word(3, i);
    if (is_write) written_at_ = std::chrono::steady_clock::now();
    if (is_write && !sets_back) std::copy_n(tables_[2].begin(), kept_.size(), kept_.begin());
    return reply;
  }

  peer::Reply read(const peer::Request& request) {
    const bool of_written = request.function == 3 && request.address < 100;
    if ((of_written && shows == Shows::exception) || request.address + request.count > registers)
      return peer::exception(request, illegal_address);
    std::vector<std::uint16_t> words(static_cast<std::size_t>(request.count));
    for (int i = 0; i < request.count && !(of_written && shows == Shows::zeros); ++i)
      words[static_cast<std::size_t>(i)] = word(request.function, request.address + i);
    return {request.function > 2 ? peer::registers_pdu(request.function, words)
                                 : peer::bits_pdu(request.function, words)};
  }

  peer::Reply write(const peer::Request& request) {
    const bool one = request.function == 6;
    const int count = one ? 1 : request.count;
    if (request.address + count > registers) return peer::exception(request, illegal_address);
    for (int i = 0; i < count; ++i) {
      const int address = request.address + i;
      const std::uint8_t* bytes = &request.pdu[static_cast<std::size_t>(one ? 3 : 6 + 2 * i)];
      if (!keep_offsets || address >= 10)
        word(3, address) = static_cast<std::uint16_t>((bytes[0] << 8) | bytes[1]);
    }
    return {peer::Bytes(request.pdu.begin(), request.pdu.begin() + 5)};
  }

  std::array<std::uint16_t, 10> kept_{};  ///< by the program
  std::chrono::steady_clock::time_point written_at_{};
  mutable std::mutex mutex_;
  std::array<std::array<std::uint16_t, registers>, 4> tables_{};  ///< by function, less 1
  peer::TcpDevice device_;  ///< last: its thread uses the rest
};

/// Two holding registers, the high one first.
[[nodiscard]] inline std::int32_t int32_of(const ModbusMachine& machine, int address) {
  const std::uint32_t high = machine.holding(address);
  return static_cast<std::int32_t>((high << 16) | machine.holding(address + 1));
}

}  // namespace thermocomp::test
