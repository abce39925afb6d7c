// SPDX-License-Identifier: GPL-3.0-or-later
#include "mcap_source.hpp"

#include <algorithm>

#include "host/recording/zstd_stream.hpp"
#include "protocol/datagram/crc32.hpp"
#include "protocol/datagram/numbers.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

using mcap::Fields;
using mcap::Op;

// The longest record, and chunk when it is unpacked: ours have a MiB.
constexpr std::uint64_t max_record = 16 << 20;
// Where the name of its compression is in a chunk's record; so a chunk is found behind damage.
constexpr std::size_t compression_at = mcap::record_head + 28;
constexpr std::string_view compression_mark{"\x04\0\0\0zstd", 8};

}  // namespace

void McapSource::feed(std::string_view bytes) {
  waiting_ += bytes;
  take();
}

void McapSource::finish() {
  if (part_ == Part::magic || part_ == Part::header) fail_as_none();
  if (part_ != Part::end) damage("the file ends here; it is not whole");
}

void McapSource::take() {
  std::string_view rest = waiting_;
  while (!rest.empty()) {
    const std::size_t taken = std::min(take_next(rest), rest.size());
    if (taken == 0) break;
    crc_ = crc32(Text(rest.substr(0, taken)), crc_);
    offset_ += taken;
    rest.remove_prefix(taken);
  }
  waiting_.erase(0, waiting_.size() - rest.size());
}

// Takes the next record; how many bytes that were, 0: more are needed.
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
    damage(known ? "a record that is longer than any" : "no record of MCAP");
    searching_ = true;
    return 1;
  }
  if (bytes.size() - mcap::record_head < size) return 0;
  const std::string_view content = bytes.substr(mcap::record_head, size);
  if (part_ == Part::header) {
    if (op != Op::header) fail_as_none();
    on_header(content);
    part_ = Part::data;
  } else if (op == Op::footer) {
    part_ = Part::end;
  } else if (op == Op::data_end) {
    const auto expected = Fields(content).number<std::uint32_t>();
    if (expected != 0 && expected != crc_ && !any_damage_) damage("the checksum of all before");
    part_ = Part::summary;
  } else if (part_ == Part::data) {
    on_data_record(op, content);
  }
  return mcap::record_head + size;
}

// To the next chunk.
std::size_t McapSource::search(std::string_view bytes) {
  const std::size_t mark = bytes.find(compression_mark);
  if (mark == std::string_view::npos) {
    const std::size_t kept = compression_at + compression_mark.size();
    return bytes.size() > kept ? bytes.size() - kept : 0;
  }
  if (mark >= compression_at && static_cast<Op>(bytes[mark - compression_at]) == Op::chunk &&
      read_number<std::uint64_t>(bytes.substr(mark - compression_at + 1)) <= max_record) {
    searching_ = false;
    return mark - compression_at != 0 ? mark - compression_at : take_next(bytes);
  }
  return mark >= compression_at ? mark - compression_at + 1 : mark + 1;
}

void McapSource::on_header(std::string_view content) {
  if (Fields(content).string() == mcap::profile) return;
  throw Error(ErrorKind::data, name_, "an MCAP file that is no recording of r4",
              "convert what r4 record or r4 convert has made");
}

void McapSource::on_data_record(Op op, std::string_view content) {
  if (op == Op::channel) return on_channel(content);
  if (op == Op::message) return on_message(content);
  if (op == Op::chunk) return on_chunk(content);
}

void McapSource::on_channel(std::string_view content) {
  Fields fields(content);
  const auto id = fields.number<std::uint16_t>();
  static_cast<void>(fields.number<std::uint16_t>());  // its schema
  static_cast<void>(fields.string());                 // the topic
  static_cast<void>(fields.string());                 // the encoding
  Fields metadata(fields.string());
  std::uint32_t wire = 0;
  bool told = false;
  while (!metadata.rest().empty()) {
    const std::string_view key = metadata.string();
    const std::string_view value = metadata.string();
    if (key == mcap::wire_key) told = parse_number(Text(value), wire) && wire <= 65535;
  }
  if (!told || !fields.good()) {
    return damage("a channel that is no board's");
  }
  channels_[id] = static_cast<std::uint16_t>(wire);
}

void McapSource::on_chunk(std::string_view content) {
  Fields fields(content);
  static_cast<void>(fields.take(16));  // its times
  const auto size = fields.number<std::uint64_t>();
  const auto crc = fields.number<std::uint32_t>();
  const std::string_view compression = fields.string();
  const std::string_view bytes = fields.take(fields.number<std::uint64_t>());
  if (!fields.good() || size > max_record) return damage("a chunk that is not whole");
  if (!unpack(compression, bytes, size)) return damage("a chunk that does not unpack");
  if (crc != 0 && crc != crc32(Text(chunk_))) return damage("a chunk whose checksum is wrong");
  std::string_view rest = chunk_;
  while (!rest.empty()) {
    Fields record(rest);
    const auto op = static_cast<Op>(record.number<std::uint8_t>());
    const std::string_view inside = record.take(record.number<std::uint64_t>());
    if (!record.good()) return damage("a chunk whose last record is not whole");
    if (op != Op::chunk) on_data_record(op, inside);
    rest = record.rest();
  }
}

// Into chunk_. False: it is not what it says.
bool McapSource::unpack(std::string_view compression, std::string_view bytes, std::uint64_t size) {
  chunk_.clear();
  if (compression.empty()) {
    chunk_ = bytes;
    return chunk_.size() == size;
  }
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
  static_cast<void>(fields.number<std::uint32_t>());  // its place in the channel
  const auto time_ns = fields.number<std::uint64_t>();
  static_cast<void>(fields.number<std::uint64_t>());
  if (!fields.good() || channel == channels_.end()) return damage("a message of no channel");
  const Json object = Json::parse(fields.rest(), nullptr, false);
  const auto text_of = [&object](const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_string() ? found->get_ptr<const std::string*>()
                                                       : nullptr;
  };
  if (!object.is_object()) return damage("a message that is no JSON object");
  bytes_.clear();
  const std::uint16_t wire = channel->second;
  const std::string* const event = text_of("event");
  const std::string* const from = text_of("from");
  const std::string* const text = wire == no_wire    ? text_of("line")
                                  : event != nullptr ? event
                                                     : text_of("text");
  const bool good =
      text != nullptr && append_unescaped(bytes_, *text) && bytes_.size() <= max_record_line;
  if (!good) return damage("a message that is no record");
  if (wire == no_wire) return on_line(bytes_);
  if (event == nullptr && from == nullptr) return damage("a message that is no record");
  const RecordKind kind = event != nullptr   ? RecordKind::event
                          : *from == "board" ? RecordKind::from_board
                                             : RecordKind::to_board;
  handler_.on_record({Time{static_cast<std::int64_t>(time_ns / 1000)}, wire, kind,
                      std::string_view(bytes_).substr(0, max_record_bytes)});
}

void McapSource::on_line(std::string_view line) {
  const char* const problem = tell_line(line, line_, handler_);
  if (problem != nullptr) damage(problem);
}

void McapSource::damage(std::string_view reason) {
  any_damage_ = true;
  handler_.on_damage({RecordingDamage::Kind::line, 0, offset_, reason});
}

void McapSource::fail_as_none() const {
  throw Error(ErrorKind::data, name_, "no MCAP file", "r4 convert FILE -o x.mcap makes one");
}

}  // namespace r4::tool
