/// Server-sent events to any number of pages: each gets the newest state there is when it has taken
/// the one before, so a slow page misses states and costs no memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

struct MHD_Connection;  // NOLINT(readability-identifier-naming): the names are libmicrohttpd's
struct MHD_Response;    // NOLINT(readability-identifier-naming)

namespace thermocomp::gateway {

/// What is sent to all pages at one time.
struct StreamFrame {
  std::uint64_t number{0};  ///< rises with each
  std::string text;         ///< one event, in the form of the protocol: the whole state
  std::string change;       ///< to whom has had the frame before; empty: the whole state to all
};
using StreamFramePointer = std::shared_ptr<const StreamFrame>;

class EventStreams {
 public:
  EventStreams();
  ~EventStreams();
  EventStreams(const EventStreams&) = delete;
  EventStreams& operator=(const EventStreams&) = delete;

  void show(StreamFramePointer frame);
  /// A response whose content is a stream; nullptr: memory is short, or the gateway stops.
  [[nodiscard]] MHD_Response* open(MHD_Connection* connection);
  /// Ends all streams; open() gives none after it.
  void stop() noexcept;
  [[nodiscard]] std::size_t count() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
