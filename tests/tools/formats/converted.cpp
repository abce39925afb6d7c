// SPDX-License-Identifier: GPL-3.0-or-later
#include "converted.hpp"

#include <algorithm>
#include <random>

namespace r4::test {

std::string recorded_capture(const std::string& url) {
  std::string native;
  write_record_header(native);
  write_path(native, {1, url, "left-arm"});
  Time time{1795468293404765};
  write_beginning(native, time);
  write_record(native, {time, 1, RecordKind::event, "up " + url});
  for (const CapturedLine& line : paper_capture()) {
    time += Time{10'000};
    write_record(native, {time, 1, line.from_board ? RecordKind::from_board : RecordKind::to_board,
                          line.bytes});
  }
  write_record(native, {time, no_path, RecordKind::event, "end"});
  return native;
}

std::string generated_recording(unsigned seed, int records) {
  std::mt19937 random(seed);
  const auto url_of = [](std::uint16_t path) {
    return path == 2 ? "serial:///dev/tty ACM0" : "udp://10.0.0.1:2018";
  };
  const auto below = [&random](unsigned n) { return static_cast<unsigned>(random() % n); };
  std::string native = "# r4log 1 by r4 0.0.7\n# an older one\n";
  for (std::uint16_t path = 1; path <= 3; ++path) {
    write_path(native, {path, url_of(path), ""});
  }
  Time time{1795468293404765};
  for (int i = 0; i < records; ++i) {
    time += Time{static_cast<std::int64_t>(below(20'000)) - 1000};
    const auto path = static_cast<std::uint16_t>(1 + below(3));
    std::string bytes =
        with_crc("AIN24:" + std::to_string(below(30)) + ".25;PNum:" + std::to_string(i) +
                 ";T:" + std::to_string(10 * i) + ";");
    const unsigned what = below(100);
    if (what < 5) bytes[below(static_cast<unsigned>(bytes.size()))] = static_cast<char>(below(256));
    if (what == 5) {
      bytes.clear();
      for (unsigned size = below(3000); size > 0; --size) bytes += static_cast<char>(below(256));
      // Random bytes must not contain a setting, because its value might be a secret.
      std::replace(bytes.begin(), bytes.end(), 'C', 'c');
    }
    if (what == 6) native += "# a comment \xff \\x20\n";
    if (what == 7) write_path(native, {path, url_of(path), "arm-" + std::to_string(i % 100)});
    if (what == 8) native += "# r4log 1 by r4 9.9.9\n";
    const RecordKind kind = what == 9   ? RecordKind::event
                            : what < 20 ? RecordKind::to_board
                                        : RecordKind::from_board;
    write_record(native, {time, what == 10 ? no_path : path, kind, bytes});
  }
  return native;
}

}  // namespace r4::test
