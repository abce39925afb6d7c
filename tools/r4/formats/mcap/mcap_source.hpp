// SPDX-License-Identifier: GPL-3.0-or-later
// .mcap that McapSink has made, from its beginning to its end: the index is not needed. A chunk that is damaged is
// told, and it goes on with the next one.
//
// Other tools may have copied the file since: with chunks of another size or compression or none, with another profile,
// without some of the topics, or with topics of other programs, which are passed over.
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
    std::optional<std::uint16_t> path;  // none: it is of another program
    std::string url, name;              // of the path; empty: not told
    bool told = false;                  // a record of it was
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
  std::string waiting_;       // what is not taken yet
  std::uint64_t offset_ = 0;  // where that begins in the file
  std::uint32_t crc_ = 0;     // of all before that
  bool any_damage_ = false;
  bool ours_ = false;       // by its profile
  bool searching_ = false;  // for the next chunk behind a damaged record
  std::map<std::uint16_t, Channel> channels_;
  std::string chunk_, bytes_;
  RecordingLines lines_;
};

}  // namespace r4::tool
