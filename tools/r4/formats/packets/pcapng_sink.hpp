// SPDX-License-Identifier: GPL-3.0-or-later
// .pcapng: a recording that Wireshark opens (draft-ietf-opsawg-pcapng). It holds all of the recording, so that the
// native one can be had back byte by byte.
//
// A datagram is a UDP packet on an interface for its path, "r4log 1 path N", whatever it came by. Addresses are the
// board's, where its URL has them, else made up: 198.18.0.0 + N for the board, 198.19.0.1 for the host (RFC 2544).
// All else is a line of the native format on the interface "r4log 1 lines", which Wireshark shows as a line of syslog.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "../conversion.hpp"

namespace r4::tool {

// Descriptions of interfaces (if_description), by which r4 knows its own; a path's number follows the second.
inline constexpr std::string_view lines_interface = "r4log 1 lines";
inline constexpr std::string_view path_interface = "r4log 1 path ";
// The host's address there.
inline constexpr std::string_view made_up_host_text = "198.19.0.1";

class PcapngSink final : public Sink {
 public:
  explicit PcapngSink(Output& output) : output_(output) {}
  void on_comment(std::string_view line, Time time) override;
  void on_path(const RecordedPath& path, Time time) override;
  void on_record(const Record& record) override;
  void finish() override { begin(); }

 private:
  struct Path {
    std::string url;
    std::uint32_t interface = 0;  // 0: it has none yet
    std::uint32_t address = 0;    // of the board
    std::uint16_t port = 0;
  };

  void begin();
  void add_interface(std::uint16_t link_type, std::string_view name,
                     const std::string& description);
  void write_line(std::string_view line, Time time);
  void write_packet(std::uint32_t interface, Time time, std::string_view head,
                    std::string_view payload, std::uint32_t flags);
  Path& path_of(std::uint16_t number);

  Output& output_;
  std::map<std::uint16_t, Path> paths_;
  std::uint32_t interfaces_ = 0;  // so many there are
  std::string block_, head_, text_;
};

}  // namespace r4::tool
