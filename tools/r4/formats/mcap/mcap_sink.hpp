// SPDX-License-Identifier: GPL-3.0-or-later
// .mcap for Foxglove, Lichtblick, PlotJuggler and `mcap`, in zstd chunks with all indexes and
// checksums. Only the chunk index at the end grows in memory: hundreds of bytes for a MiB of JSON.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../conversion.hpp"
#include "../json_lines.hpp"
#include "../path_names.hpp"
#include "../recorded_devices.hpp"
#include "mcap.hpp"
#include "r4link/recordings/zstd_stream.hpp"

namespace r4::tool {

class McapSink final : public Sink {
 public:
  explicit McapSink(Output& output, std::vector<Device> devices = {})
      : output_(output), devices_(std::move(devices)) {}
  bool wants_survey() const override { return true; }
  void survey(const RecordedPath& path) override { names_.on_path(path); }
  void survey(const Record&) override {}
  void on_comment(std::string_view line, Time time) override;
  void on_path(const RecordedPath& path, Time time) override;
  void on_device(const RecordedDevice& device) override { devices_.on_device(device); }
  void on_header() override;
  // Throws Error{data} for a time beyond the year 2554, the limit of MCAP.
  void on_record(const Record& record) override;
  void finish() override;
  std::string left_out() const override { return devices_.problems(); }

 private:
  static constexpr std::size_t chunk_size = 1 << 20;
  struct Channel {
    std::uint16_t id = 0;
    std::uint64_t messages = 0;
    std::string record;  // repeated in each chunk, to make the chunk readable alone
    std::string index;
  };
  struct ChannelKey {
    std::uint16_t path;
    std::string topic, url;
    bool operator==(const ChannelKey&) const = default;
    auto operator<=>(const ChannelKey&) const = default;  // NOLINT(modernize-use-nullptr)
  };

  void begin();
  void write(std::string_view bytes);
  void write_message(Channel& channel, Time time, std::string_view json);
  void write_line(std::string_view line, Time time);
  void write_chunk();
  void write_group(mcap::Op op, std::string_view records);
  void write_summary();
  std::string topic_of(std::uint16_t path);
  Channel& channel_of(std::uint16_t path);
  Channel& add_channel(std::uint16_t path, const std::string& topic, std::uint16_t schema);

  Output& output_;
  RecordedDevices devices_;
  MeasuredJson measured_;
  PathNames names_;
  ZstdWriter zstd_;
  bool begun_ = false;
  std::map<ChannelKey, Channel> channels_;
  std::map<std::uint16_t, Channel*> current_;
  std::map<std::uint16_t, std::string> urls_;  // URLs of this recording, by path
  Channel* lines_ = nullptr;

  std::uint64_t offset_ = 0;
  std::uint32_t crc_ = 0;  // checksum of the file so far
  std::string chunk_;
  std::string record_, text_, compressed_;
  std::uint64_t chunk_first_ns_ = 0, chunk_last_ns_ = 0;
  bool chunk_has_messages_ = false;

  std::string schemas_, channel_records_, chunk_indexes_, offsets_;
  std::uint64_t messages_ = 0;
  std::uint32_t chunks_ = 0;
  std::uint64_t first_ns_ = 0, last_ns_ = 0;
};

}  // namespace r4::tool
