// SPDX-License-Identifier: GPL-3.0-or-later
// .pcapng for Wireshark (draft-ietf-opsawg-pcapng), from which the native file can be restored.
// A datagram becomes a UDP packet on its path's interface, "r4log 1 path N", whatever its
// transport. The board's address comes from its URL, else it is invented: 198.18.0.0 + N for the
// board, 198.19.0.1 for the host (RFC 2544). Everything else is a native line on the interface
// "r4log 1 lines", shown by Wireshark as syslog.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "../conversion.hpp"

namespace r4::tool {

// Descriptions (if_description) of r4's own interfaces. The path's number follows path_interface.
inline constexpr std::string_view lines_interface = "r4log 1 lines";
inline constexpr std::string_view path_interface = "r4log 1 path ";
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
    std::uint32_t interface = 0;  // 0: none yet
    std::uint32_t address = 0;
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
  std::uint32_t interfaces_ = 0;
  std::string block_, head_, text_;
};

}  // namespace r4::tool
