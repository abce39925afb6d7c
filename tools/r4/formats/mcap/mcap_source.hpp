// SPDX-License-Identifier: GPL-3.0-or-later
// Reads .mcap files without the index. Continues after a damaged chunk. A copy by another tool may
// have another chunk size, compression or profile, lack topics, or have foreign topics.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "../../shell/json.hpp"
#include "../conversion.hpp"
#include "mcap.hpp"
#include "r4link/recordings/recording_reader.hpp"

namespace r4::tool {

class McapSource final : public Source {
 public:
  McapSource(RecordingVisitor& visitor, std::string name)
      : visitor_(visitor), name_(std::move(name)), lines_(visitor, name_) {}
  void feed(std::string_view bytes) override;
  void finish() override;

 private:
  struct Channel {
    std::optional<std::uint16_t> path;  // none: a channel of another program
    std::string url, name;              // URL and name of the path; empty: unknown
    bool told = false;                  // the path has been reported
  };
  enum class Part : std::uint8_t { magic, header, data, summary, end };
  void take();
  std::size_t take_next(std::string_view bytes);
  std::size_t search(std::string_view bytes);
  void on_data_record(mcap::Op op, std::string_view content);
  void on_channel(std::string_view content);
  void on_message(std::string_view content);
  void on_chunk(std::string_view content);
  bool unpack(std::string_view compression, std::string_view bytes, std::uint64_t size);
  void damage(std::string_view reason);
  [[noreturn]] void fail_as_none() const;

  RecordingVisitor& visitor_;
  const std::string name_;
  Part part_ = Part::magic;
  std::string waiting_;
  std::uint64_t offset_ = 0;  // position of waiting_ in the file
  std::uint32_t crc_ = 0;     // of all bytes before waiting_
  bool any_damage_ = false;
  bool ours_ = false;
  bool searching_ = false;  // looking for the next chunk after damage
  std::map<std::uint16_t, Channel> channels_;
  std::string chunk_, bytes_;
  RecordingLines lines_;
};

}  // namespace r4::tool
