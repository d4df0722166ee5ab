/// CAN frames of the simulator on one interface.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "drivers/can/can_socket.hpp"

namespace thermocomp {

/// Frames of one device, built from signals: one per identifier, or one per page of a multiplexor.
class CanFrames {
 public:
  void define(const CanSignal& signal);
  /// Adds a counter to the frames of the signal's identifier. @pre the signal has been defined
  void define_counter(const CanSignal& signal, const CanField& counter);
  /// Saturates; encodes NaN as a float's NaN or an integer's highest code.
  void set_value(const CanSignal& signal, double value);
  void set_code(const CanSignal& signal, std::int64_t code);
  /// Sets the signal's status, if it has one; bits outside its mask are kept.
  void set_status(const CanSignal& signal, std::int64_t number);
  void count();
  /// Ordered by identifier, then by definition.
  [[nodiscard]] std::vector<CanFrame> frames() const;

 private:
  struct Message {
    std::vector<CanFrame> pages;
    std::vector<CanField> counters;
    bool selected{false};  ///< the pages are selected by multiplexors
  };
  template <class Write>
  void write(const CanSignal& signal, Write write_to);

  std::map<CanId, Message> messages_;
  std::uint64_t counted_{0};
};

/// CAN socket that reopens itself.
class CanNode {
 public:
  CanNode(std::string interface, std::vector<CanId> wanted);

  /// Empty: working.
  [[nodiscard]] std::string error() const { return socket_.is_open() ? "" : socket_.error(); }
  void keep_open(nanoseconds now);
  void send(const CanFrames& frames);
  /// Frames received since the last call, oldest first.
  [[nodiscard]] std::vector<CanFrame> receive();

 private:
  CanSocket socket_;
  nanoseconds tried_at_{};
};

}  // namespace thermocomp
