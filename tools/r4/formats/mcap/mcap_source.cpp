// SPDX-License-Identifier: GPL-3.0-or-later
#include "mcap_source.hpp"

#include <libdeflate.h>
#include <lz4frame.h>

#include <algorithm>
#include <memory>
#include <new>

#include "../../shell/number.hpp"
#include "r4link/error.hpp"
#include "r4link/recordings/zstd_stream.hpp"

namespace r4::tool {
namespace {

using mcap::Fields;
using mcap::Op;

// Largest record and unpacked chunk. Chunks of r4 have 1 MiB. Other tools may use any size.
constexpr std::uint64_t max_record = 256 << 20;
// Offset of the compression's name in a chunk record. The search after damage finds chunks by it.
constexpr std::size_t compression_at = mcap::record_head + 28;
constexpr std::string_view zstd_mark{"\x04\0\0\0zstd", 8};
constexpr std::string_view lz4_mark{"\x03\0\0\0lz4", 7};

bool unpack_lz4(std::string_view bytes, std::uint64_t size, std::string& out) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) {
    throw std::bad_alloc();
  }
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owner(
      context, &LZ4F_freeDecompressionContext);
  std::string piece(1 << 16, '\0');
  std::size_t wanted = 0, written = 0, taken = 0;
  do {
    written = piece.size();
    taken = bytes.size();
    wanted = LZ4F_decompress(context, piece.data(), &written, bytes.data(), &taken, nullptr);
    if (LZ4F_isError(wanted) != 0 || out.size() + written > size) return false;
    out.append(piece, 0, written);
    bytes.remove_prefix(taken);
  } while (wanted == 0 ? !bytes.empty() : taken != 0 || written != 0);
  return wanted == 0 && bytes.empty() && out.size() == size;
}

}  // namespace

void McapSource::feed(std::string_view bytes) {
  waiting_ += bytes;
  take();
}

void McapSource::finish() {
  if (part_ == Part::magic || part_ == Part::header) fail_as_none();
  if (part_ != Part::end) damage("the file is incomplete: it ends here");
  const bool any_of_ours = std::any_of(channels_.begin(), channels_.end(), [](const auto& each) {
    return each.second.path.has_value();
  });
  if (!ours_ && !any_of_ours) {
    throw Error(ErrorKind::data, name_, "is an MCAP file, but not a recording of r4",
                "convert a file that r4 record or r4 convert has made");
  }
}

void McapSource::take() {
  std::string_view rest = waiting_;
  while (!rest.empty()) {
    const std::size_t taken = std::min(take_next(rest), rest.size());
    if (taken == 0) break;
    crc_ = libdeflate_crc32(crc_, rest.data(), taken);
    offset_ += taken;
    rest.remove_prefix(taken);
  }
  waiting_.erase(0, waiting_.size() - rest.size());
}

std::size_t McapSource::take_next(std::string_view bytes) {
  if (part_ == Part::magic) {
    if (!mcap::magic.starts_with(bytes.substr(0, mcap::magic.size()))) fail_as_none();
    if (bytes.size() < mcap::magic.size()) return 0;
    part_ = Part::header;
    return mcap::magic.size();
  }
  if (part_ == Part::end) return bytes.size();
  if (searching_) return search(bytes);
  if (bytes.size() < mcap::record_head) return 0;
  const auto op = static_cast<Op>(bytes[0]);
  const auto size = read_number<std::uint64_t>(bytes.substr(1));
  const auto code = static_cast<std::uint8_t>(op);
  const bool known = (code >= 0x01 && code <= 0x0F) || code >= 0x80;
  if (!known || size > max_record) {
    if (part_ == Part::header) fail_as_none();
    damage(known ? "a record of more than 256 MiB; make chunks smaller: mcap compress "
                   "--chunk-size 4194304 FILE.mcap -o NEW.mcap"
                 : "not a record of MCAP");
    searching_ = true;
    return 1;
  }
  if (bytes.size() - mcap::record_head < size) return 0;
  const std::string_view content = bytes.substr(mcap::record_head, static_cast<std::size_t>(size));
  if (part_ == Part::header) {
    if (op != Op::header) fail_as_none();
    // Accepts another profile, because a tool that copies a file writes its own profile.
    ours_ = Fields(content).string() == mcap::profile;
    part_ = Part::data;
  } else if (op == Op::footer) {
    part_ = Part::end;
  } else if (op == Op::data_end) {
    const auto expected = Fields(content).number<std::uint32_t>();
    if (expected != 0 && expected != crc_ && !any_damage_)
      damage("the checksum of the earlier data is wrong");
    part_ = Part::summary;
  } else if (part_ == Part::data) {
    on_data_record(op, content);
  }
  return mcap::record_head + content.size();
}

std::size_t McapSource::search(std::string_view bytes) {
  const std::size_t mark = std::min(bytes.find(zstd_mark), bytes.find(lz4_mark));
  if (mark == std::string_view::npos) {
    const std::size_t kept = compression_at + zstd_mark.size();
    return bytes.size() > kept ? bytes.size() - kept : 0;
  }
  if (mark >= compression_at && static_cast<Op>(bytes[mark - compression_at]) == Op::chunk &&
      read_number<std::uint64_t>(bytes.substr(mark - compression_at + 1)) <= max_record) {
    searching_ = false;
    return mark - compression_at != 0 ? mark - compression_at : take_next(bytes);
  }
  return mark >= compression_at ? mark - compression_at + 1 : mark + 1;
}

void McapSource::on_data_record(Op op, std::string_view content) {
  if (op == Op::channel) return on_channel(content);
  if (op == Op::message) return on_message(content);
  if (op == Op::chunk) return on_chunk(content);
}

void McapSource::on_channel(std::string_view content) {
  Fields fields(content);
  const auto id = fields.number<std::uint16_t>();
  static_cast<void>(fields.number<std::uint16_t>());  // schema id
  static_cast<void>(fields.string());                 // topic
  const std::string_view encoding = fields.string();
  Fields metadata(fields.string());
  Channel channel;
  while (!metadata.rest().empty()) {
    const std::string_view key = metadata.string();
    const std::string_view value = metadata.string();
    if (key == mcap::path_key) channel.path = number_in<std::uint16_t>(value);
    std::string* const text = key == mcap::url_key    ? &channel.url
                              : key == mcap::name_key ? &channel.name
                                                      : nullptr;
    if (text != nullptr && !append_unescaped(*text, value)) text->clear();
  }
  if (!fields.good() || !metadata.good()) return damage("an incomplete channel");
  if (encoding != "json") channel.path.reset();
  // Each chunk repeats the channels of its messages.
  Channel& known = channels_[id];
  channel.told = known.told && known.path == channel.path;
  known = std::move(channel);
}

void McapSource::on_chunk(std::string_view content) {
  Fields fields(content);
  static_cast<void>(fields.take(16));  // start and end time
  const auto size = fields.number<std::uint64_t>();
  const auto crc = fields.number<std::uint32_t>();
  const std::string_view compression = fields.string();
  const std::string_view bytes = fields.take(fields.number<std::uint64_t>());
  if (!fields.good() || size > max_record) return damage("an incomplete chunk");
  if (!unpack(compression, bytes, size)) return damage("a chunk that cannot be decompressed");
  if (crc != 0 && crc != libdeflate_crc32(0, chunk_.data(), chunk_.size()))
    return damage("a chunk with a wrong checksum");
  std::string_view rest = chunk_;
  while (!rest.empty()) {
    Fields record(rest);
    const auto op = static_cast<Op>(record.number<std::uint8_t>());
    const std::string_view inside = record.take(record.number<std::uint64_t>());
    if (!record.good()) return damage("a chunk with an incomplete last record");
    if (op != Op::chunk) on_data_record(op, inside);
    rest = record.rest();
  }
}

bool McapSource::unpack(std::string_view compression, std::string_view bytes, std::uint64_t size) {
  chunk_.clear();
  if (compression.empty()) {
    chunk_ = bytes;
    return chunk_.size() == size;
  }
  if (compression == "lz4") return unpack_lz4(bytes, size, chunk_);
  if (compression != "zstd") return false;
  ZstdReader reader;
  for (;;) {
    const ZstdReader::Step step = reader.step(bytes);
    if (step == ZstdReader::Step::damaged) return false;
    if (step == ZstdReader::Step::more) break;
    chunk_ += reader.text();
    if (chunk_.size() > size) return false;
  }
  return chunk_.size() == size && reader.between_frames();
}

void McapSource::on_message(std::string_view content) {
  Fields fields(content);
  const auto channel = channels_.find(fields.number<std::uint16_t>());
  static_cast<void>(fields.number<std::uint32_t>());  // sequence number
  const auto time_ns = fields.number<std::uint64_t>();
  static_cast<void>(fields.number<std::uint64_t>());
  if (!fields.good() || channel == channels_.end())
    return damage("a message without a known channel");
  if (!channel->second.path) return;  // from another program
  const Json object = Json::parse(fields.rest(), nullptr, false);
  const auto text_of = [&object](const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_string() ? found->get_ptr<const std::string*>()
                                                       : nullptr;
  };
  if (!object.is_object()) return damage("a message that is not a JSON object");
  bytes_.clear();
  const std::uint16_t path = *channel->second.path;
  const std::string* const event = text_of("event");
  const std::string* const from = text_of("from");
  const std::string* const text = path == no_path    ? text_of("line")
                                  : event != nullptr ? event
                                                     : text_of("text");
  const bool good =
      text != nullptr && append_unescaped(bytes_, *text) && bytes_.size() <= max_record_line;
  if (!good) return damage("a message that is not a record");
  if (path == no_path) {
    const char* const problem = lines_.on_line(bytes_, channel->first);
    if (problem != nullptr) damage(problem);
    return;
  }
  if (event == nullptr && from == nullptr) return damage("a message that is not a record");
  const RecordKind kind = event != nullptr   ? RecordKind::event
                          : *from == "board" ? RecordKind::from_board
                                             : RecordKind::to_board;
  // A filter may have removed the topic of the lines, which declare the paths.
  if (!channel->second.told && !lines_.recognised() && !channel->second.url.empty()) {
    visitor_.on_path({path, channel->second.url, channel->second.name});
  }
  channel->second.told = true;
  lines_.on_record({Time{static_cast<std::int64_t>(time_ns / 1000)}, path, kind,
                    std::string_view(bytes_).substr(0, max_record_bytes)},
                   channel->first, channel->second.url);
}

void McapSource::damage(std::string_view reason) {
  any_damage_ = true;
  lines_.on_damage();
  visitor_.on_damage({RecordingDamage::Kind::line, 0, offset_, reason});
}

void McapSource::fail_as_none() const {
  throw Error(ErrorKind::data, name_, "is not an MCAP file", "make one: r4 convert FILE -o x.mcap");
}

}  // namespace r4::tool
