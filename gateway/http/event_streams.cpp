#include "gateway/http/event_streams.hpp"

#include <algorithm>
#include <microhttpd.h>
#include <mutex>
#include <new>
#include <set>
#include <utility>

namespace thermocomp::gateway {

struct EventStreams::Parts {
  struct Stream {
    Parts* parts{nullptr};
    MHD_Connection* connection{nullptr};
    StreamFramePointer frame;          ///< in transmission; nullptr: none yet
    const std::string* text{nullptr};  ///< text of `frame`: whole or change
    std::size_t sent{0};
  };

  static ssize_t read(void* stream, std::uint64_t position, char* out, std::size_t size);
  static void close(void* stream);
  /// Takes the newest frame if this stream has not sent it. @return true if taken
  bool take_newer(Stream& stream) const;

  mutable std::mutex mutex;
  StreamFramePointer newest;
  std::set<MHD_Connection*> sleeping;  ///< suspended until the next frame
  std::size_t open{0};
  bool stops{false};
};

bool EventStreams::Parts::take_newer(Stream& stream) const {
  if (!newest || (stream.frame && stream.frame->number == newest->number)) return false;
  const bool follows = stream.frame && stream.frame->number + 1 == newest->number;
  stream.text = follows && !newest->change.empty() ? &newest->change : &newest->text;
  stream.frame = newest;
  stream.sent = 0;
  return true;
}

/// libmicrohttpd's request for content. The lock covers check and suspension, so that a frame
/// published in between is not missed.
ssize_t EventStreams::Parts::read(void* cls, std::uint64_t /*position*/, char* out,
                                  std::size_t size) {
  Stream& stream = *static_cast<Stream*>(cls);
  const std::lock_guard lock(stream.parts->mutex);
  if (stream.parts->stops) return MHD_CONTENT_READER_END_OF_STREAM;
  const bool is_done = !stream.frame || stream.sent == stream.text->size();
  if (is_done && !stream.parts->take_newer(stream)) {
    stream.parts->sleeping.insert(stream.connection);
    MHD_suspend_connection(stream.connection);
    return 0;
  }
  const std::size_t count = std::min(size, stream.text->size() - stream.sent);
  stream.text->copy(out, count, stream.sent);
  stream.sent += count;
  return static_cast<ssize_t>(count);
}

void EventStreams::Parts::close(void* cls) {
  const std::unique_ptr<Stream> stream(static_cast<Stream*>(cls));
  const std::lock_guard lock(stream->parts->mutex);
  stream->parts->sleeping.erase(stream->connection);
  --stream->parts->open;
}

EventStreams::EventStreams() : parts_(std::make_unique<Parts>()) {}
EventStreams::~EventStreams() = default;

void EventStreams::show(StreamFramePointer frame) {
  const std::lock_guard lock(parts_->mutex);
  parts_->newest = std::move(frame);
  for (MHD_Connection* connection : parts_->sleeping) MHD_resume_connection(connection);
  parts_->sleeping.clear();
}

MHD_Response* EventStreams::open(MHD_Connection* connection) {
  constexpr std::size_t block_bytes = 4096;
  auto stream = std::make_unique<Parts::Stream>();
  stream->parts = parts_.get();
  stream->connection = connection;
  {
    const std::lock_guard lock(parts_->mutex);
    if (parts_->stops) return nullptr;
    ++parts_->open;
  }
  MHD_Response* response = MHD_create_response_from_callback(
      MHD_SIZE_UNKNOWN, block_bytes, &Parts::read, stream.get(), &Parts::close);
  if (response != nullptr) {
    static_cast<void>(stream.release());  // close() owns it
    return response;
  }
  const std::lock_guard lock(parts_->mutex);
  --parts_->open;
  return nullptr;
}

void EventStreams::stop() noexcept {
  const std::lock_guard lock(parts_->mutex);
  parts_->stops = true;
  for (MHD_Connection* connection : parts_->sleeping) MHD_resume_connection(connection);
  parts_->sleeping.clear();
}

std::size_t EventStreams::count() const {
  const std::lock_guard lock(parts_->mutex);
  return parts_->open;
}

}  // namespace thermocomp::gateway
