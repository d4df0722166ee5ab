/// Configuration of CAN buses and of the devices with temperatures on them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/bus.hpp"

namespace thermocomp {

enum class ByteOrder { little_endian, big_endian };  ///< Intel, Motorola

/// Bits of a CAN frame, read as an unsigned number. `start_bit` is numbered as in DBC files: the
/// least significant bit for little_endian, the most significant bit for big_endian; bit 0 is the
/// lowest of byte 0.
struct CanField {
  int start_bit{0};
  int length_bits{8};  ///< 1..64
  ByteOrder byte_order{ByteOrder::little_endian};
  bool operator==(const CanField&) const = default;
};

/// A multiplexor: a number in the frame that selects the content of the rest of the frame.
struct CanSelector {
  /// Numbers from `first` to `last`, both included.
  struct Pages {
    std::uint64_t first{0};
    std::uint64_t last{0};
    bool operator==(const Pages&) const = default;
  };
  CanField field;
  std::vector<Pages> pages;  ///< the frame carries the signal if its number is in one of these
  bool operator==(const CanSelector&) const = default;
};

/// A number beside a value that shows whether the value is good.
struct CanStatus {
  CanField field;
  std::uint64_t mask{~std::uint64_t{0}};  ///< bits used
  /// masked number -> fault (none: good); a number that is not listed and not 0 is device_error
  std::vector<Sentinel> codes;
  bool operator==(const CanStatus&) const = default;
};

/// Place of a value in a CAN frame, numbered as in CanField.
struct CanSignal {
  std::uint32_t id{0};
  bool extended_id{false};
  bool fd{false};  ///< the frame may have up to 64 bytes (CAN FD), else 8
  int start_bit{0};
  int length_bits{16};  ///< 1..64; a float has 32 or 64
  ByteOrder byte_order{ByteOrder::little_endian};
  bool is_signed{true};
  bool is_float{false};
  double scale{1.0};  ///< value = raw * scale + offset
  double offset{0.0};
  std::vector<Sentinel> sentinels;
  std::vector<CanSelector> selectors{};  ///< all must match; empty: the signal is in every frame
  std::optional<CanStatus> status{};     ///< in the same frame
  /// Bits of an extended id that are compared; fewer bits match a J1939 group from any sender.
  std::uint32_t id_mask{0x1FFFFFFF};
  bool operator==(const CanSignal&) const = default;
};

struct CanChannel {
  std::size_t sensor{0};  ///< index of the sensor in the configuration
  CanSignal signal;
  /// A counter or toggle in the same frame; while it does not change, neither does the reading's
  /// time.
  std::optional<CanField> counter{};
  bool operator==(const CanChannel&) const = default;
};

struct CanDeviceConfig {
  std::string name;
  std::vector<CanChannel> channels;
  bool operator==(const CanDeviceConfig&) const = default;
};

struct CanBusConfig {
  static constexpr std::array kinds{"can"};
  std::string name;
  std::string interface;
  double reconnect_s{0.5};  ///< pause between attempts to open the interface
  std::vector<CanDeviceConfig> devices;
  [[nodiscard]] BusOutline outline() const {
    return {kinds[0], interface, devices.size(), "device"};
  }
  bool operator==(const CanBusConfig&) const = default;
};

}  // namespace thermocomp
