/// Server-sent events to any number of pages. Each page gets the newest state after it has taken
/// the previous one: a slow page skips states and needs no memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

struct MHD_Connection;  // NOLINT(readability-identifier-naming): the names are libmicrohttpd's
struct MHD_Response;    // NOLINT(readability-identifier-naming)

namespace thermocomp::gateway {

/// One state, sent to all pages.
struct StreamFrame {
  std::uint64_t number{0};  ///< increases by one per frame
  std::string text;         ///< the whole state as one event of the protocol
  std::string change;       ///< for a receiver of the previous frame; empty: `text` for all
};
using StreamFramePointer = std::shared_ptr<const StreamFrame>;

class EventStreams {
 public:
  EventStreams();
  ~EventStreams();
  EventStreams(const EventStreams&) = delete;
  EventStreams& operator=(const EventStreams&) = delete;

  void show(StreamFramePointer frame);
  /// Response whose content is a stream; nullptr: out of memory, or stopped.
  [[nodiscard]] MHD_Response* open(MHD_Connection* connection);
  /// Ends all streams; from then on open() returns nullptr.
  void stop() noexcept;
  [[nodiscard]] std::size_t count() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
