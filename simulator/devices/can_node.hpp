/// Frames that the simulator sends and receives on one CAN interface.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "drivers/can/can_socket.hpp"

namespace thermocomp {

/// The frames of one device, built from signals: one an identifier, or one a page of those whose
/// content a multiplexor selects.
class CanFrames {
 public:
  void define(const CanSignal& signal);
  /// A counter in the frames of the signal's identifier. @pre the signal has been defined
  void define_counter(const CanSignal& signal, const CanField& counter);
  /// Saturated where it does not fit; NaN as a float's NaN or an integer's highest code.
  void set_value(const CanSignal& signal, double value);
  void set_code(const CanSignal& signal, std::int64_t code);
  /// Beside the value, if the signal has a status; bits outside its mask stay.
  void set_status(const CanSignal& signal, std::int64_t number);
  /// Every counter goes up by one.
  void count();
  /// In the order of identifiers and, of one identifier, of definition.
  [[nodiscard]] std::vector<CanFrame> frames() const;

 private:
  struct Message {
    std::vector<CanFrame> pages;
    std::vector<CanField> counters;
    bool selected{false};  ///< the pages are those of multiplexors
  };
  template <class Write>
  void write(const CanSignal& signal, Write write_to);

  std::map<CanId, Message> messages_;
  std::uint64_t counted_{0};
};

/// A socket that is opened again by itself.
class CanNode {
 public:
  CanNode(std::string interface, std::vector<CanId> wanted);

  /// Empty: it works; else why not.
  [[nodiscard]] std::string error() const { return socket_.is_open() ? "" : socket_.error(); }
  void keep_open(nanoseconds now);
  void send(const CanFrames& frames);
  /// What has arrived since the last call, oldest first.
  [[nodiscard]] std::vector<CanFrame> receive();

 private:
  CanSocket socket_;
  nanoseconds tried_at_{};
};

}  // namespace thermocomp
