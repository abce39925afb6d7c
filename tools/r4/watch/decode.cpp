// SPDX-License-Identifier: GPL-3.0-or-later
// Memory is bounded for any input.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "../bus/bus_datagram.hpp"
#include "../bus/bus_log.hpp"
#include "../shell/json.hpp"
#include "../shell/numbered_lines.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "protocol/datagram/numbers.hpp"
#include "r4link/datagram.hpp"

namespace r4::tool {
namespace {

struct DecodeOptions {
  std::string file = "-";
  bool candump = false;
};

class Input {
 public:
  explicit Input(const std::string& path)
      : name_(path == "-" ? "standard input" : path),
        fd_(path == "-" ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (fd_ < 0) fail();
  }
  ~Input() {
    if (fd_ != STDIN_FILENO) ::close(fd_);
  }
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  // The bytes that have arrived; empty at the end of the input. Valid until the next call.
  std::string_view read() {
    for (;;) {
      const ssize_t count = ::read(fd_, buffer_.data(), buffer_.size());
      if (count >= 0) return {buffer_.data(), static_cast<std::size_t>(count)};
      if (errno != EINTR) fail();
    }
  }

 private:
  [[noreturn]] void fail() const {
    const bool denied = errno == EACCES || errno == EPERM;
    throw Error(denied ? ErrorKind::permission : ErrorKind::open, name_, std::strerror(errno),
                denied ? "allow reading of the file: chmod +r"
                       : "give a readable file, or - for standard input");
  }

  std::string name_;
  int fd_;
  std::array<char, 65536> buffer_;
};

// A line packed:HEX from r4 encode --packed. Unlike a plain datagram, it contains no semicolon.
constexpr std::string_view packed_prefix = "packed:";

bool is_packed_line(std::string_view line) {
  return line.starts_with(packed_prefix) && line.find(';') == std::string_view::npos;
}

class DatagramLines {
 public:
  explicit DatagramLines(const BusLog::Print& print) : print_(print) {}

  void on_line(std::uint64_t number, std::string_view line) {
    Json object{{"line", number}};
    if (!(is_packed_line(line) ? add_packed(object, line) : add_plain(object, line))) {
      any_bad_ = true;
    }
    print_(object);
  }
  void on_long_line(std::uint64_t number, std::uint64_t size) {
    any_bad_ = true;
    ReadResult result;
    result.error = ReadError::length;
    result.position = max_datagram;
    Json object{{"line", number}, {"ok", false}};
    object.update(bad_datagram_json(result));
    object["size"] = size;
    print_(object);
  }
  void finish() {}
  bool any_bad() const { return any_bad_; }

 private:
  static bool add_plain(Json& object, std::string_view line) {
    return add_datagram_json(object, line);
  }
  static bool add_packed(Json& object, std::string_view line) {
    const std::string_view hex = line.substr(packed_prefix.size());
    std::array<std::uint8_t, max_datagram> bytes;  // NumberedLines limits the line to max_datagram
    const std::size_t size = hex.size() / 2;
    bool good = hex.size() % 2 == 0;
    for (std::size_t i = 0; good && i < size; ++i) {
      std::uint32_t byte = 0;
      good = parse_hex(Text(hex.substr(2 * i, 2)), byte);
      bytes[i] = static_cast<std::uint8_t>(byte);
    }
    if (good) {
      good = add_packed_json(object, bytes.data(), size);
    } else {
      object.update({{"ok", false}, {"error", "packed"}, {"reason", "hex"}});
    }
    if (object.value("error", "") == "packed") object["text"] = escaped(line);
    return good;
  }

  const BusLog::Print& print_;
  bool any_bad_ = false;
};

template <class Reader>
int decode_lines(Input& input, Reader& reader, std::string& printed) {
  NumberedLines lines;
  const auto line = [&](std::uint64_t number, std::string_view text) {
    reader.on_line(number, text);
  };
  const auto too_long = [&](std::uint64_t number, std::uint64_t size) {
    reader.on_long_line(number, size);
  };
  for (std::string_view bytes = input.read(); !bytes.empty(); bytes = input.read()) {
    lines.push(bytes, line, too_long);
    print_raw(std::exchange(printed, {}));
  }
  lines.finish(line, too_long);
  reader.finish();
  print_raw(printed);
  return reader.any_bad() ? static_cast<int>(ErrorKind::data) : 0;
}

int decode(const DecodeOptions& options) {
  Input input(options.file);
  std::string printed;
  const BusLog::Print print = [&printed](const Json& object) { printed += line_of(object); };
  if (options.candump) {
    BusLog log(print);
    return decode_lines(input, log, printed);
  }
  DatagramLines datagrams(print);
  return decode_lines(input, datagrams, printed);
}

constexpr const char* decode_footer = R"(One JSON object for each line of input that is not empty:
  line, ok      the number of the line, from 1; whether it is a valid datagram
  type          state, heartbeat, command, nack or identity
  pnum, t       packet number and time, or null if missing
  fields        the other fields: numbers as numbers, several values as an array
  error         length, syntax or crc, with the position of the wrong byte
  expected, found   for crc: the checksum of the bytes, and the checksum in the datagram
  packed        for a line packed:HEX (r4 encode --packed, docs/reference/packed.md): its size in
                bytes; the other keys describe the datagram in it
  error packed  it does not hold a datagram; reason: hex (not pairs of hexadecimal digits), length,
                version (a later version: update r4) or syntax
  text          the datagram; bytes that are not printable ASCII, and \, as \xNN

--candump reads the output of candump, preferably candump -L, and joins the frames of each interface
and node to datagrams. The keys above follow these keys, and line and time are those of the last
frame:
  time          as in the dump: seconds, or a date as text; null if missing
  interface, node, from, lane   from host: command; from board: reply, telemetry
  frames, took_ms   the number of frames, and the time from the first to the last
  type          also emergency_stop, and went_safe with its reason
  error isotp   a transfer that failed, and why: a receiver on the bus also lost it
  error candump a line that candump did not write: reason and fix
The last object is the summary. It counts what is not printed: flow control, orphans (frames without
the first frame of their transfer), unfinished transfers, frames of another protocol (other), error
frames of the controller.

Examples:
  r4 encode O:358,1,1 | r4 decode
  r4 encode O:358,1,1 --packed | r4 decode
  cut -f2 tests/data/paper_capture.tsv | r4 decode
  candump -L can0 | r4 decode --candump
  r4 decode --candump bus.log | jq -c 'select(.node == 3 and .lane == "command")'

Exit codes: 0 every datagram is valid; 1 a datagram is not valid, or with --candump a transfer
failed or a line is damaged; 4, 5 the file cannot be read.)";

}  // namespace

void add_decode(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<DecodeOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "decode", "Check datagrams and show them as JSON", decode_footer,
                     options, decode);
  add_text(*command, "FILE", options->file, "datagrams, one a line (default: standard input)",
           file_type);
  add_flag(*command, "--candump", options->candump, "the input is the output of candump");
}

}  // namespace r4::tool
