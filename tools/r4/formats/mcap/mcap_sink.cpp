// SPDX-License-Identifier: GPL-3.0-or-later
#include "mcap_sink.hpp"

#include <fmt/format.h>
#include <libdeflate.h>

#include <algorithm>
#include <utility>

#include "r4link/config.hpp"
#include "r4link/error.hpp"
#include "schemas.hpp"

namespace r4::tool {
namespace {

using mcap::append_record;
using mcap::append_string;
using mcap::Op;

constexpr std::uint16_t record_schema_id = 1;
constexpr std::uint16_t line_schema_id = 2;
constexpr std::string_view chunk_compression = "zstd";
constexpr std::size_t most_channels = 1000;

std::uint64_t nanoseconds(Time time) {
  constexpr std::int64_t last_us = 18'446'744'073'709'551;
  if (time.count() > last_us) {
    throw Error(ErrorKind::data, record_time_text(time),
                "MCAP cannot store times after the year 2554",
                "convert it to .jsonl, or set the host's clock before you record");
  }
  return static_cast<std::uint64_t>(time.count()) * 1000;
}

void append_pair(std::string& out, std::string_view key, std::string_view value) {
  append_string(out, key);
  append_string(out, value);
}

// MCAP strings are UTF-8; the result is ASCII.
std::string plain(std::string_view bytes) {
  std::string text;
  append_escaped(text, bytes);
  return text;
}

std::string schema(std::uint16_t id, std::string_view name, const std::string& text) {
  std::string content, record;
  append_number(content, id);
  append_string(content, name);
  append_string(content, "jsonschema");
  append_string(content, text);
  append_record(record, Op::schema, content);
  return record;
}

}  // namespace

void McapSink::begin() {
  if (begun_) return;
  begun_ = true;
  write(mcap::magic);
  record_.clear();
  append_string(record_, mcap::profile);
  append_string(record_, "r4 " R4LINK_VERSION);
  text_.clear();
  append_record(text_, Op::header, record_);
  write(text_);
  schemas_ = schema(record_schema_id, mcap::record_schema, mcap::record_schema_text()) +
             schema(line_schema_id, mcap::line_schema, mcap::line_schema_text());
  chunk_ = schemas_;
  lines_ = &add_channel(no_path, "/r4log", line_schema_id);
}

void McapSink::write(std::string_view bytes) {
  output_.write(bytes);
  offset_ += bytes.size();
  crc_ = libdeflate_crc32(crc_, bytes.data(), bytes.size());
}

void McapSink::on_comment(std::string_view line, Time time) { write_line(line, time); }

void McapSink::on_path(const RecordedPath& path, Time time) {
  std::string line;
  r4::write_path(line, path);
  line.pop_back();
  write_line(line, time);
  names_.on_path(path);
  urls_[path.number] = path.url;
  current_.erase(path.number);
}

void McapSink::on_header() {
  devices_.on_header();
  measured_.on_header();
  urls_.clear();
  current_.clear();
}

void McapSink::on_record(const Record& record) {
  if (record.path == no_path) {
    std::string line;
    r4::write_record(line, record);
    line.pop_back();
    return write_line(line, record.time);
  }
  begin();
  Json object = Json::object();
  add_record_json(
      object, {record.time, record.path, record.kind, record.bytes.substr(0, max_record_bytes)});
  measured_.add_to(object, record, devices_);
  write_message(channel_of(record.path), record.time,
                object.dump(-1, ' ', true, Json::error_handler_t::replace));
}

void McapSink::write_line(std::string_view line, Time time) {
  begin();
  write_message(*lines_, time, Json{{"line", plain(line)}}.dump());
}

void McapSink::write_message(Channel& channel, Time time, std::string_view json) {
  const std::uint64_t ns = nanoseconds(time);
  if (channel.index.empty()) chunk_ += channel.record;
  append_number(channel.index, ns);
  append_number(channel.index, std::uint64_t{chunk_.size()});
  append_number(chunk_, static_cast<std::uint8_t>(Op::message));
  append_number(chunk_, std::uint64_t{mcap::message_head + json.size()});
  append_number(chunk_, channel.id);
  append_number(chunk_, static_cast<std::uint32_t>(channel.messages));
  append_number(chunk_, ns);
  append_number(chunk_, ns);
  chunk_ += json;
  ++channel.messages;
  chunk_first_ns_ = chunk_has_messages_ ? std::min(chunk_first_ns_, ns) : ns;
  chunk_last_ns_ = chunk_has_messages_ ? std::max(chunk_last_ns_, ns) : ns;
  chunk_has_messages_ = true;
  first_ns_ = messages_ == 0 ? ns : std::min(first_ns_, ns);
  last_ns_ = messages_ == 0 ? ns : std::max(last_ns_, ns);
  ++messages_;
  if (chunk_.size() >= chunk_size) write_chunk();
}

void McapSink::write_chunk() {
  compressed_.clear();
  zstd_.write(chunk_, true, compressed_);
  const std::uint64_t begins = offset_;
  record_.clear();
  append_number(record_, chunk_has_messages_ ? chunk_first_ns_ : 0);
  append_number(record_, chunk_has_messages_ ? chunk_last_ns_ : 0);
  append_number(record_, std::uint64_t{chunk_.size()});
  append_number(record_, libdeflate_crc32(0, chunk_.data(), chunk_.size()));
  append_string(record_, chunk_compression);
  append_number(record_, std::uint64_t{compressed_.size()});
  record_ += compressed_;
  text_.clear();
  append_record(text_, Op::chunk, record_);
  write(text_);
  const std::uint64_t ends = offset_;

  std::string indexes;
  for (auto& [key, channel] : channels_) {
    if (channel.index.empty()) continue;
    append_number(indexes, channel.id);
    append_number(indexes, offset_);
    record_.clear();
    append_number(record_, channel.id);
    append_string(record_, channel.index);
    text_.clear();
    append_record(text_, Op::message_index, record_);
    write(text_);
    channel.index.clear();
  }

  record_.clear();
  append_number(record_, chunk_has_messages_ ? chunk_first_ns_ : 0);
  append_number(record_, chunk_has_messages_ ? chunk_last_ns_ : 0);
  append_number(record_, begins);
  append_number(record_, ends - begins);
  append_string(record_, indexes);
  append_number(record_, offset_ - ends);
  append_string(record_, chunk_compression);
  append_number(record_, std::uint64_t{compressed_.size()});
  append_number(record_, std::uint64_t{chunk_.size()});
  append_record(chunk_indexes_, Op::chunk_index, record_);
  ++chunks_;
  chunk_.clear();
  chunk_has_messages_ = false;
}

void McapSink::finish() {
  begin();
  if (!chunk_.empty()) write_chunk();
  record_.clear();
  append_number(record_, crc_);
  text_.clear();
  append_record(text_, Op::data_end, record_);
  write(text_);
  write_summary();
}

void McapSink::write_summary() {
  const std::uint64_t begins = offset_;
  crc_ = 0;
  write_group(Op::schema, schemas_);
  write_group(Op::channel, channel_records_);
  std::string counts;
  for (const auto& [key, channel] : channels_) {
    append_number(counts, channel.id);
    append_number(counts, channel.messages);
  }
  record_.clear();
  append_number(record_, messages_);
  append_number(record_, std::uint16_t{2});
  append_number(record_, static_cast<std::uint32_t>(channels_.size()));
  append_number(record_, std::uint32_t{0});
  append_number(record_, std::uint32_t{0});
  append_number(record_, chunks_);
  append_number(record_, first_ns_);
  append_number(record_, last_ns_);
  append_string(record_, counts);
  text_.clear();
  append_record(text_, Op::statistics, record_);
  write_group(Op::statistics, text_);
  write_group(Op::chunk_index, chunk_indexes_);
  const std::uint64_t offsets_begin = offset_;
  write(offsets_);
  // The checksum includes the beginning of the footer.
  record_.clear();
  append_number(record_, static_cast<std::uint8_t>(Op::footer));
  append_number(record_, std::uint64_t{20});
  append_number(record_, begins);
  append_number(record_, offsets_begin);
  write(record_);
  record_.clear();
  append_number(record_, crc_);
  write(record_);
  write(mcap::magic);
}

void McapSink::write_group(Op op, std::string_view records) {
  if (records.empty()) return;
  std::string offset;
  append_number(offset, static_cast<std::uint8_t>(op));
  append_number(offset, offset_);
  append_number(offset, std::uint64_t{records.size()});
  append_record(offsets_, Op::summary_offset, offset);
  write(records);
}

// If two paths have the same name, because a board has two links, the path's number is appended.
std::string McapSink::topic_of(std::uint16_t path) {
  const std::string& name = names_.name_of(path);
  if (name.empty()) return fmt::format("/board{}", path);
  std::string topic = "/" + plain(name);
  const bool taken = std::any_of(channels_.begin(), channels_.end(), [&](const auto& each) {
    return each.first.topic == topic && each.first.path != path;
  });
  return taken ? fmt::format("{}_{}", topic, path) : topic;
}

McapSink::Channel& McapSink::channel_of(std::uint16_t path) {
  Channel*& current = current_[path];
  if (current != nullptr) return *current;
  const std::string topic = topic_of(path);
  const auto known = channels_.find({path, topic, urls_[path]});
  current = known != channels_.end() ? &known->second : &add_channel(path, topic, record_schema_id);
  return *current;
}

McapSink::Channel& McapSink::add_channel(std::uint16_t path, const std::string& topic,
                                         std::uint16_t schema_id) {
  if (channels_.size() == most_channels) {
    throw Error(ErrorKind::data, topic, "the recording has more than 1000 boards",
                "check it for damage with r4 info FILE, or convert it to .jsonl");
  }
  const std::string& url = urls_[path];
  Channel& channel = channels_[{path, topic, url}];
  channel.id = static_cast<std::uint16_t>(channels_.size());
  std::string metadata;
  append_pair(metadata, mcap::path_key, std::to_string(path));
  if (path != no_path) {
    append_pair(metadata, mcap::url_key, plain(url));
    const std::string& name = names_.name_of(path);
    if (!name.empty()) append_pair(metadata, mcap::name_key, plain(name));
  }
  std::string content;
  append_number(content, channel.id);
  append_number(content, schema_id);
  append_string(content, topic);
  append_string(content, "json");
  append_string(content, metadata);
  append_record(channel.record, Op::channel, content);
  channel_records_ += channel.record;
  return channel;
}

}  // namespace r4::tool
