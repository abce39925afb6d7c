// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../formats/output_file.hpp"
#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "formats.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"
#include "r4link/recordings/record_line.hpp"
#include "read_file.hpp"

namespace r4::tool {
namespace {

struct ConvertOptions {
  std::string input;
  std::string output;
  bool force = false;
  std::uint64_t port = board_port;
  std::string start;
  std::vector<std::string> devices;
};

class Progress {
 public:
  explicit Progress(const std::string& path) : shown_(::isatty(STDERR_FILENO) != 0) {
    struct stat status {};
    if (::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode)) {
      all_ = static_cast<std::uint64_t>(status.st_size);
    }
  }
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void begin(const char* what) {
    what_ = what;
    done_ = 0;
  }
  void advance(std::size_t bytes) {
    done_ += bytes;
    const auto now = std::chrono::steady_clock::now();
    if (!shown_ || now - drawn_at_ < std::chrono::milliseconds{100}) return;
    drawn_at_ = now;
    drawn_ = true;
    if (all_ != 0) {
      constexpr std::size_t width = 30;
      const std::size_t full = static_cast<std::size_t>(done_ * width / all_);
      fmt::print(stderr, "\r{} [{:<{}}] {:3} %", what_,
                 std::string(full < width ? full : width, '='), width, done_ * 100 / all_);
    } else {
      fmt::print(stderr, "\r{} {:.1f} MB", what_, static_cast<double>(done_) / 1e6);
    }
  }
  void clear() {
    if (drawn_) fmt::print(stderr, "\r\x1b[K");
    drawn_ = false;
  }

 private:
  const bool shown_;
  bool drawn_ = false;
  const char* what_ = "";
  std::uint64_t all_ = 0;
  std::uint64_t done_ = 0;
  std::chrono::steady_clock::time_point drawn_at_ = std::chrono::steady_clock::now();
};

SourceOptions source_options(const ConvertOptions& options) {
  SourceOptions result;
  result.port = static_cast<std::uint16_t>(options.port);
  if (options.start.empty()) return result;
  result.start = read_record_time(options.start);
  if (!result.start) {
    throw Error(ErrorKind::usage, "--start " + options.start, "is not a time in UTC",
                "write a time such as --start 2026-11-23T21:20:00");
  }
  return result;
}

bool can_be_read_twice(const std::string& path) {
  struct stat status {};
  return path != "-" && ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

int convert(const ConvertOptions& options) {
  std::vector<Device> devices = Device::from(options.devices);
  const SourceOptions source = source_options(options);
  OutputFile output(options.output, options.force);
  const std::unique_ptr<Sink> sink = make_sink(options.output, output, std::move(devices));
  Progress progress(options.input);
  const auto advance = [&progress](std::size_t bytes) { progress.advance(bytes); };
  if (sink->wants_survey() && can_be_read_twice(options.input)) {
    progress.begin("looking");
    Survey survey(*sink);
    read_file(options.input, survey, source, advance);
  }
  progress.begin("converting");
  std::uint64_t told = 0;
  Conversion conversion(*sink, [&](const RecordingDamage& damage) {
    if (++told > most_damage) return;
    progress.clear();
    print_trouble("r4: {}: {}; this part is left out", called(options.input), to_text(damage));
  });
  read_file(options.input, conversion, source, advance);
  conversion.finish();
  output.finish();
  progress.clear();
  if (told > most_damage)
    print_trouble("r4: {} more damaged parts are left out", told - most_damage);
  const std::string left_out = sink->left_out();
  print_text("{}: {} records{}\n", printable(options.output), conversion.records(),
             left_out.empty() ? "" : "; left out are " + printable(left_out));
  return conversion.damage() == 0 ? 0 : static_cast<int>(ErrorKind::data);
}

constexpr const char* convert_footer =
    R"(FILE may have any format that r4 convert reads, compressed by zstd or not: its content decides. The
ending of the output's name selects the new format (docs/how-to/recordings.md):
  .r4log .r4log.zst   the native format
  .log                the frames of a CAN bus as candump -L writes them; for candump -tz, --start
                      gives the time of the first frame
  .pcapng             packets for Wireshark, with the whole recording in them; r4 convert also reads
                      captures, and pcap: UDP to and from --port, and SocketCAN
  .mcap               a topic for each board, for Foxglove and PlotJuggler, with the whole recording
                      in it; r4 convert reads its own files, also after other tools copied them
  .csv                the states, one row each; a column for each value, with its unit in the header
  .jsonl              every record, one JSON object a line, as r4 decode shows it

A long recording does not need more memory than a short recording. If parts of a damaged file cannot
be read, r4 convert reports their places and converts the other parts. It replaces an existing file
only with --force.

Examples:
  r4 convert drive.r4log -o drive.csv
  r4 convert drive.r4log -o drive.csv --device bno055@0x28:1    with the values of a sensor
  r4 convert drive.r4log.zst -o drive.r4log
  r4 convert drive.r4log -o drive.pcapng && wireshark drive.pcapng
  tcpdump -w arm.pcap udp port 2018; r4 convert arm.pcap -o arm.csv
  zstdcat robot-*.r4log.zst | r4 convert - -o robot.jsonl
  r4 convert bus.log -o bus.r4log --start 2026-11-23T21:20:00    from candump -tz

Exit codes: 0 all parts were converted; 1 some parts could not be read, or the file is not a
recording; 2 usage; 4, 5 a file cannot be read or written.)";

}  // namespace

void add_convert(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<ConvertOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "convert", "Write a recording in another format", convert_footer,
                     options, convert);
  add_text(*command, "FILE", options->input, "a recording, or - for standard input", file_type,
           Need::required);
  add_text(*command, "-o,--output", options->output, "the new file", file_type, Need::required);
  add_number(*command, "--port", options->port, 1, 65535,
             "the boards' UDP port in a capture (default: 2018)");
  add_text(*command, "--start", options->start,
           "time of the first frame, in UTC, for a log with relative times (candump -tz)", "TIME");
  add_repeated(*command, "--device", options->devices,
               "add its values to .csv, .jsonl and .mcap (default: the recorded devices)",
               "NAME@ADDRESS");
  add_flag(*command, "--force", options->force, "replace an existing file");
}

}  // namespace r4::tool
