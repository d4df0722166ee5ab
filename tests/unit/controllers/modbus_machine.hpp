// Modbus TCP server of a CNC in a thread (server side of libmodbus), for the tests of the link.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <poll.h>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include <modbus/modbus.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "drivers/bus_thread.hpp"

namespace thermocomp::test {

/// Serves one client at a time on 127.0.0.1. Registers live as long as the object; start() begins
/// with zeros, as after power-on.
class ModbusMachine {
 public:
  static constexpr int registers = 200;

  /// @param port  0: any free one
  explicit ModbusMachine(int port = 0) {
    context_.reset(modbus_new_tcp("127.0.0.1", port));
    mapping_.reset(modbus_mapping_new(registers, registers, registers, registers));
    listener_ = modbus_tcp_listen(context_.get(), 4);
    if (listener_ < 0) throw std::runtime_error(modbus_strerror(errno));
    sockaddr_in address{};
    socklen_t length = sizeof address;
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ModbusMachine(const ModbusMachine&) = delete;
  ModbusMachine& operator=(const ModbusMachine&) = delete;
  ~ModbusMachine() {
    stopping_ = true;
    wake_.signal();
    thread_.join();
    ::close(listener_);
  }

  [[nodiscard]] int port() const { return port_; }

  [[nodiscard]] std::uint16_t holding(int address) const {
    const std::scoped_lock lock(mutex_);
    return mapping_->tab_registers[address];
  }
  void set_holding(int address, std::uint16_t value) {
    const std::scoped_lock lock(mutex_);
    mapping_->tab_registers[address] = value;
  }
  void set_input(int address, std::uint16_t value) {
    const std::scoped_lock lock(mutex_);
    mapping_->tab_input_registers[address] = value;
  }
  void set_discrete(int address, bool value) {
    const std::scoped_lock lock(mutex_);
    mapping_->tab_input_bits[address] = value ? 1 : 0;
  }
  void set_coil(int address, bool value) {
    const std::scoped_lock lock(mutex_);
    mapping_->tab_bits[address] = value ? 1 : 0;
  }

  /// Input registers 0..n mirror holding registers 0..n, as of a controller that applies offsets.
  std::atomic<int> mirrored{0};
  /// Writes are refused with "slave device failure".
  std::atomic<bool> refuse_writes{false};
  /// Writes are received and neither done nor answered.
  std::atomic<bool> ignore_writes{false};
  /// Writes below register 10 are answered and not done.
  std::atomic<bool> keep_offsets{false};
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
  struct Free {
    void operator()(modbus_t* context) const {
      modbus_close(context);
      modbus_free(context);
    }
    void operator()(modbus_mapping_t* mapping) const { modbus_mapping_free(mapping); }
  };

  void serve() {
    int client = -1;
    while (!stopping_) {
      wake_.wait_until(monotonic_now() + std::chrono::seconds{1}, client < 0 ? listener_ : client);
      if (stopping_) break;
      if (client < 0) {
        pollfd waiting{listener_, POLLIN, 0};
        if (::poll(&waiting, 1, 0) <= 0) continue;
        int socket = listener_;
        client = modbus_tcp_accept(context_.get(), &socket);
        continue;
      }
      pollfd waiting{client, POLLIN, 0};
      if (::poll(&waiting, 1, 0) > 0 && !answer()) {
        ::close(client);
        client = -1;
      }
    }
    if (client >= 0) ::close(client);
    modbus_set_socket(context_.get(), -1);
  }

  bool answer() {
    std::uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
    const int size = modbus_receive(context_.get(), query);
    if (size < 0) return false;
    if (size == 0) return true;
    const int function = query[modbus_get_header_length(context_.get())];
    const bool is_write = function == MODBUS_FC_WRITE_MULTIPLE_REGISTERS ||
                          function == MODBUS_FC_WRITE_SINGLE_REGISTER;
    ++(is_write ? writes : reads);
    if (mute || (is_write && ignore_writes)) return true;
    if (!is_write) std::this_thread::sleep_for(read_takes.load());
    if (is_write && restart_on_write.exchange(false)) {
      const std::scoped_lock lock(mutex_);
      mirrored = 0;
      std::fill_n(mapping_->tab_input_registers, registers, std::uint16_t{0});
      return true;
    }
    if (is_write ? refuse_writes : refuse_reads) {
      return modbus_reply_exception(context_.get(), query,
                                    MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE) >= 0;
    }
    const int head = modbus_get_header_length(context_.get());
    const bool of_written = function == MODBUS_FC_READ_HOLDING_REGISTERS && query[head + 1] == 0 &&
                            query[head + 2] < 100;
    if (of_written && shows == Shows::exception)
      return modbus_reply_exception(context_.get(), query, MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS) >=
             0;
    const std::scoped_lock lock(mutex_);
    if (of_written && shows == Shows::zeros) {
      std::vector<std::uint16_t> kept(mapping_->tab_registers, mapping_->tab_registers + 100);
      std::fill_n(mapping_->tab_registers, 100, std::uint16_t{0});
      const bool shown = modbus_reply(context_.get(), query, size, mapping_.get()) >= 0;
      std::copy(kept.begin(), kept.end(), mapping_->tab_registers);
      return shown;
    }
    const std::vector<std::uint16_t> kept(mapping_->tab_registers, mapping_->tab_registers + 10);
    const bool answered = modbus_reply(context_.get(), query, size, mapping_.get()) >= 0;
    if (keep_offsets) std::copy(kept.begin(), kept.end(), mapping_->tab_registers);
    for (int i = 0; i < mirrored; ++i) {
      mapping_->tab_input_registers[i] = mapping_->tab_registers[i];
    }
    return answered;
  }

  std::unique_ptr<modbus_t, Free> context_;
  std::unique_ptr<modbus_mapping_t, Free> mapping_;
  int listener_{-1};
  int port_{0};
  mutable std::mutex mutex_;
  std::atomic<bool> stopping_{false};
  WakeEvent wake_;
  std::thread thread_;
};

/// Two holding registers, the high one first.
[[nodiscard]] inline std::int32_t int32_of(const ModbusMachine& machine, int address) {
  const std::uint32_t high = machine.holding(address);
  return static_cast<std::int32_t>((high << 16) | machine.holding(address + 1));
}

}  // namespace thermocomp::test
