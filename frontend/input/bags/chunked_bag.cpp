#include "frontend/input/bags/chunked_bag.h"

#include <algorithm>

#include "frontend/input/bags/chunk_codec.h"

namespace hybrid_slam {

void ChunkedBag::walk(std::uint32_t chunk, std::uint64_t offset, std::uint64_t end) {
  while (offset < end) {
    const auto record = read_head(chunk, offset, end);
    if (record && record->is_in_file()) {
      if (auto begun = chunk_of(*record)) add_chunk(std::move(*begun));
    }
    if (!record || record->end > end) {
      cut_off_ = true;
      if (chunk == ChunkedFile::kNoChunk) {
        warn("is cut off or damaged at byte " + std::to_string(offset) + " of " +
             std::to_string(end) + "; what lies before is read");
      }
      return;
    }
    meet(*record);
    offset = record->end;
  }
}

// Of a chunk that is cut off, what is whole of it, if it is not compressed.
void ChunkedBag::add_chunk(Chunk chunk) {
  const std::uint64_t left = file_.size() - chunk.offset;
  if (chunk.stored_size > left) {
    if (!is_stored(chunk.compression)) return;
    chunk.stored_size = left;
  }
  file_.add_chunk(std::move(chunk));
  indices_.emplace_back();
}

void ChunkedBag::add_index(const IndexPart& part) {
  if (!indices_.empty()) indices_.back().push_back(part);
}

void ChunkedBag::add_message_of(std::uint32_t channel, const Record& record) {
  const auto found = channels_.find(channel);
  if (found == channels_.end()) return;
  count_messages(found->second, 1);
  if (is_wanted(found->second)) add_message({found->second, record.chunk, record.begin});
}

bool ChunkedBag::is_indexed(std::uint32_t chunk) const {
  const std::vector<IndexPart>& parts = indices_[chunk];
  return !parts.empty() && std::all_of(parts.begin(), parts.end(), [&](const IndexPart& part) {
    return knows_channel(part.channel);
  });
}

void ChunkedBag::index_chunks(const IndexEntry& entry, bool is_complete) {
  const std::size_t count = file_.chunks().size();
  for (std::uint32_t chunk = 0; chunk < count; ++chunk) {
    const std::string& compression = file_.chunks()[chunk].compression;
    if (!is_known_compression(compression)) decompress(compression, {}, 0, name());  // refuses it
    if (is_indexed(chunk) && (is_complete || chunk + 1 < count)) {
      read_index(chunk, entry);
    } else {
      scan(chunk);
    }
  }
}

void ChunkedBag::scan(std::uint32_t chunk) {
  const Chunk& place = file_.chunks()[chunk];
  const bool stored = is_stored(place.compression);
  try {
    walk(chunk, 0, stored ? place.stored_size : place.size);
  } catch (const InputError& error) {
    warn_of(error);
  }
}

void ChunkedBag::read_index(std::uint32_t chunk, const IndexEntry& entry) {
  std::vector<BagMessage> found;
  for (const IndexPart& part : indices_[chunk]) {
    const std::uint32_t topic = channels_.at(part.channel);
    count_messages(topic, part.count);
    if (!is_wanted(topic)) continue;
    const ByteVector bytes = file_.read(part.offset, part.count * entry.size);
    ByteCursor cursor(bytes, name());
    for (std::uint64_t i = 0; i < part.count; ++i) {
      found.push_back({topic, chunk, entry.offset_of(cursor)});
    }
  }
  std::sort(found.begin(), found.end(),
            [](const BagMessage& a, const BagMessage& b) { return a.offset < b.offset; });
  for (const BagMessage& message : found) add_message(message);
}

}  // namespace hybrid_slam
