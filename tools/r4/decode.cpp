// SPDX-License-Identifier: GPL-3.0-or-later
// r4 decode: datagrams in, one a line, JSON out. Whatever the input, memory stays bounded: a line
// that is too long to be a datagram is measured, not kept.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>

#include "json.hpp"
#include "options.hpp"
#include "protocol/datagram.hpp"
#include "protocol/message.hpp"
#include "protocol/numbers.hpp"
#include "subcommands.hpp"
#include "transports/framing/line_framing.hpp"
#include "transports/framing/packed_form.hpp"

namespace r4::tool {
namespace {

struct Options {
  std::string file = "-";
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

  // What has arrived, at least one byte; empty at the end. Valid until the next call.
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
    throw Error(
        denied ? ErrorKind::permission : ErrorKind::open, name_, std::strerror(errno),
        denied ? "allow reading it: chmod +r" : "give a readable file, or - for standard input");
  }

  std::string name_;
  int fd_;
  std::array<char, 65536> buffer_;
};

// A line packed:HEX, as r4 encode --packed writes it. No datagram looks so: it has a semicolon.
constexpr std::string_view packed_prefix = "packed:";

bool is_packed_line(Text line) {
  const std::string_view text(line.data(), line.size());
  return text.starts_with(packed_prefix) && text.find(';') == std::string_view::npos;
}

// The datagram at `out`; else why there is none: "hex", or the UnpackError by name.
const char* unpack_line(Text line, std::array<char, max_datagram>& out, std::size_t& size,
                        std::size_t& packed_size) {
  const Text hex = line.substr(packed_prefix.size());
  std::array<std::uint8_t, max_datagram> bytes;
  if (hex.size() % 2 != 0) return "hex";
  packed_size = hex.size() / 2;  // a line holds no more than max_datagram characters
  for (std::size_t i = 0; i < packed_size; ++i) {
    std::uint32_t byte = 0;
    if (!parse_hex(hex.substr(2 * i, 2), byte)) return "hex";
    bytes[i] = static_cast<std::uint8_t>(byte);
  }
  const UnpackResult result = unpack(bytes.data(), packed_size, out.data(), out.size());
  size = result.size;
  return to_text(result.error);
}

class Decoder {
 public:
  void push(std::string_view bytes) {
    while (!bytes.empty()) {
      const std::size_t end = std::min(bytes.find_first_of("\r\n"), bytes.size());
      const bool ends = end != bytes.size();
      const std::size_t taken = end + (ends ? 1 : 0);
      line_size_ += end;
      framing_.push(bytes.data(), taken, [this](Text line) { report(line); });
      if (!ends) {
        after_cr_ = false;
        return;
      }
      if (line_size_ > max_datagram) report_long_line();
      const bool second_half = bytes[end] == '\n' && end == 0 && after_cr_;  // of CR LF
      if (!second_half) ++line_;
      line_size_ = 0;
      after_cr_ = bytes[end] == '\r';
      bytes.remove_prefix(taken);
    }
  }
  void finish() {
    if (line_size_ != 0) push("\n");
  }
  bool any_bad() const { return any_bad_; }

 private:
  void report(Text line) {
    if (!is_packed_line(line)) {
      report_datagram(line, 0);
      return;
    }
    std::array<char, max_datagram> datagram;
    std::size_t size = 0;
    std::size_t packed_size = 0;
    const std::string_view reason = unpack_line(line, datagram, size, packed_size);
    if (reason.empty()) {
      report_datagram(Text(datagram.data(), size), packed_size);
      return;
    }
    any_bad_ = true;
    print(Json{{"line", line_},
               {"ok", false},
               {"error", "packed"},
               {"reason", reason},
               {"text", escaped({line.data(), line.size()})}});
  }

  // `packed_size`: how many bytes it had in the packed form; 0 if it is plain.
  void report_datagram(Text line, std::size_t packed_size) {
    Datagram datagram;
    const ReadResult result = read(line, datagram);
    Json object{{"line", line_}, {"ok", static_cast<bool>(result)}};
    if (packed_size != 0) object["packed"] = packed_size;
    if (result) {
      object["type"] = to_text(kind_of(datagram));
      object["pnum"] = datagram.has_pnum() ? Json(datagram.pnum()) : Json();
      object["t"] = datagram.has_time() ? Json(datagram.time_ms()) : Json();
      object["fields"] = fields_json(datagram);
    } else {
      object.update(bad_datagram_json(result));
      any_bad_ = true;
    }
    object["text"] = escaped({line.data(), line.size()});
    print(object);
  }

  void report_long_line() {
    any_bad_ = true;
    ReadResult result;
    result.error = ReadError::length;
    result.position = max_datagram;
    Json object{{"line", line_}, {"ok", false}};
    object.update(bad_datagram_json(result));
    object["size"] = line_size_;
    print(object);
  }

  static void print(const Json& object) {
    const std::string line = line_of(object);
    std::fwrite(line.data(), 1, line.size(), stdout);
  }

  LineFraming framing_;
  std::uint64_t line_ = 1;
  std::uint64_t line_size_ = 0;
  bool after_cr_ = false;
  bool any_bad_ = false;
};

int decode(const Options& options) {
  Input input(options.file);
  Decoder decoder;
  for (std::string_view bytes = input.read(); !bytes.empty(); bytes = input.read()) {
    decoder.push(bytes);
    std::fflush(stdout);  // a pipe's reader need not wait for more
  }
  decoder.finish();
  return decoder.any_bad() ? static_cast<int>(ErrorKind::data) : 0;
}

constexpr const char* footer = R"(One JSON object for each line of input that is not empty:
  line, ok      the line's number from 1; is it a valid datagram
  type          state, heartbeat, command, nack or identity
  pnum, t       packet number and time, null where it has none
  fields        the other fields: numbers as numbers, several values as an array
  error         length, syntax or crc, with the position of the byte where it went wrong
  expected, found   for crc: the checksum of the bytes, and the one that they claim
  packed        of a line packed:HEX (r4 encode --packed, docs/packed.md): its size in bytes;
                the rest is about the datagram that it holds
  error packed  it holds none; reason: hex (not pairs of hexadecimal digits), length, version
                (of a later one: update r4) or syntax
  text          the datagram; bytes that are no printable ASCII, and \, as \xNN

Examples:
  r4 encode O:358,1,1 | r4 decode
  r4 encode O:358,1,1 --packed | r4 decode
  cut -f2 tests/data/paper_capture.tsv | r4 decode

Exit codes: 0 every datagram is valid; 1 at least one is not; 4, 5 the file cannot be read.)";

}  // namespace

void add_decode(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(
      root, chosen, "decode", "Check datagrams and show them as JSON", footer, options, decode);
  command->add_option("FILE", options->file, "datagrams, one a line (default: standard input)")
      ->type_name(file_type);
}

}  // namespace r4::tool
