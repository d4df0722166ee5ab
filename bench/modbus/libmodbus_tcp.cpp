// Reactions of libmodbus and of our connection to late answers on Modbus TCP, with the same
// scripted server. docs/dependencies.md gives the reasons for our own TCP frames.
//
//   numbers   distinct transaction numbers in three requests sent by modbus_send_raw_request()
//   late      the answer to the first request comes while the second one waits for its own
//   half      ... comes in two pieces, one before and one after the second request is sent
//
// libmodbus is used in two ways: as intended, and with separate request and answer, its timeout one
// microsecond, and waiting and comparison of numbers done by us.
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <modbus/modbus.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "drivers/modbus/connection.hpp"
#include "modbus_bench_server.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

using Clock = std::chrono::steady_clock;
constexpr auto time_out = 200ms;
constexpr std::uint16_t registers = 2;

/// One client's connection, played by a script.
class Peer {
 public:
  explicit Peer(int listening) : fd_(::accept(listening, nullptr, nullptr)) {}
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  ~Peer() { ::close(fd_); }

  /// @return the request's number; -1: the client is gone
  int take_request() {
    std::array<std::uint8_t, 12> request{};
    const ssize_t got = ::recv(fd_, request.data(), request.size(), MSG_WAITALL);
    return got == 12 ? request[0] << 8 | request[1] : -1;
  }
  void send(std::span<const std::uint8_t> bytes) {
    static_cast<void>(::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL));
  }
  static std::vector<std::uint8_t> answer(int number) {
    return {static_cast<std::uint8_t>(number >> 8),
            static_cast<std::uint8_t>(number),
            0,
            0,
            0,
            7,
            1,
            MODBUS_FC_READ_INPUT_REGISTERS,
            2 * registers,
            0,
            1,
            0,
            2};
  }

 private:
  int fd_;
};

using Script = std::function<void(Peer&)>;

void late(Peer& peer) {
  const int first = peer.take_request();
  const int second = peer.take_request();  // the first one was given up
  peer.send(Peer::answer(first));
  std::this_thread::sleep_for(20ms);
  peer.send(Peer::answer(second));
  for (int number = peer.take_request(); number >= 0; number = peer.take_request())
    peer.send(Peer::answer(number));
}

void half(Peer& peer) {
  const std::vector<std::uint8_t> owed = Peer::answer(peer.take_request());
  const std::span<const std::uint8_t> bytes(owed);
  std::this_thread::sleep_for(time_out + 50ms);
  peer.send(bytes.first(5));
  const int second = peer.take_request();
  peer.send(bytes.subspan(5));
  peer.send(Peer::answer(second));
  for (int number = peer.take_request(); number >= 0; number = peer.take_request())
    peer.send(Peer::answer(number));
}

struct ContextDeleter {
  void operator()(modbus_t* context) const noexcept {
    modbus_close(context);
    modbus_free(context);
  }
};
using Context = std::unique_ptr<modbus_t, ContextDeleter>;

Context connect_libmodbus(int port) {
  Context context(modbus_new_tcp("127.0.0.1", port));
  modbus_set_slave(context.get(), 1);
  modbus_set_error_recovery(context.get(), MODBUS_ERROR_RECOVERY_NONE);
  modbus_set_response_timeout(context.get(), 0, std::chrono::microseconds(time_out).count());
  if (modbus_connect(context.get()) != 0) std::perror("modbus_connect");
  return context;
}

/// Count of failures in five requests after an unanswered one.
int five_requests(const std::function<bool()>& read) {
  static_cast<void>(read());
  std::this_thread::sleep_for(100ms);
  int failed = 0;
  for (int i = 0; i < 5; ++i) failed += read() ? 0 : 1;
  return failed;
}

int with_libmodbus(const bench::TcpListener& listener) {
  const Context context = connect_libmodbus(listener.port());
  return five_requests([&] {
    std::array<std::uint16_t, registers> words{};
    modbus_flush(context.get());
    return modbus_read_input_registers(context.get(), 0, registers, words.data()) == registers;
  });
}

/// libmodbus counts its requests from 1 without reporting the number, so it is counted here.
int with_libmodbus_split(const bench::TcpListener& listener) {
  const Context context = connect_libmodbus(listener.port());
  int number = 0;
  return five_requests([&] {
    std::array<std::uint16_t, registers> words{};
    modbus_flush(context.get());
    modbus_set_response_timeout(context.get(), 0, 1);
    ++number;
    if (modbus_read_input_registers(context.get(), 0, registers, words.data()) == registers)
      return true;
    modbus_set_response_timeout(context.get(), 0, std::chrono::microseconds(time_out).count());
    for (const auto end = Clock::now() + time_out; Clock::now() < end;) {
      std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> frame{};
      if (modbus_receive_confirmation(context.get(), frame.data()) < 0) return false;
      if ((frame[0] << 8 | frame[1]) == number && frame[7] == MODBUS_FC_READ_INPUT_REGISTERS)
        return true;
    }
    return false;
  });
}

int with_ours(const bench::TcpListener& listener) {
  ModbusLine line;
  line.link = ModbusTcp{"127.0.0.1", listener.port()};
  line.timeout_ms = std::chrono::duration<double, std::milli>(time_out).count();
  ModbusConnection connection(line);
  static_cast<void>(connection.connect());
  return five_requests([&] {
    std::array<std::uint16_t, registers> words{};
    static_cast<void>(connection.connect());  // if it had to be closed
    return connection.read(1, ModbusTable::input, 0, words).ok();
  });
}

template <class Way>
int play(const Script& script, Way way) {
  const bench::TcpListener listener;
  std::thread server([&] {
    Peer peer(listener.socket());
    script(peer);
  });
  const int failed = way(listener);
  server.join();
  return failed;
}

std::size_t own_numbers() {
  const bench::TcpListener listener;
  std::set<int> numbers;
  std::thread server([&] {
    Peer peer(listener.socket());
    for (int i = 0; i < 3; ++i) numbers.insert(peer.take_request());
  });
  {
    const Context context = connect_libmodbus(listener.port());
    const std::array<std::uint8_t, 6> request{1,        MODBUS_FC_READ_INPUT_REGISTERS, 0, 0, 0,
                                              registers};
    for (int i = 0; i < 3; ++i)
      modbus_send_raw_request(context.get(), request.data(), request.size());
    server.join();
  }
  return numbers.size();
}

}  // namespace

int main() {
  std::printf("numbers_of_raw_requests %zu of_3\n", own_numbers());
  const auto compare = [](const char* name, const Script& script) {
    std::printf("%s_failed_libmodbus %d of_5\n", name, play(script, with_libmodbus));
    std::printf("%s_failed_split %d of_5\n", name, play(script, with_libmodbus_split));
    std::printf("%s_failed_ours %d of_5\n", name, play(script, with_ours));
  };
  compare("late", late);
  compare("half", half);
  return 0;
}
