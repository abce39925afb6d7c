// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recordings/file_form.hpp"

#include <array>

#include "r4link/recordings/zstd_stream.hpp"

namespace r4 {
namespace {

using namespace std::string_view_literals;

struct Mark {
  std::string_view bytes;
  FileForm form;
};

constexpr std::array marks{
    Mark{"\xA1\xB2\xC3\xD4"sv, FileForm::pcap},
    Mark{"\xD4\xC3\xB2\xA1"sv, FileForm::pcap},
    Mark{"\xA1\xB2\x3C\x4D"sv, FileForm::pcap},
    Mark{"\x4D\x3C\xB2\xA1"sv, FileForm::pcap},
    Mark{"\x0A\x0D\x0D\x0A"sv, FileForm::pcap},
    Mark{"\x89MCAP0\r\n"sv, FileForm::mcap},
    Mark{"\x1F\x8B"sv, FileForm::gzip},
    Mark{"\xFD\x37zXZ"sv, FileForm::xz},
    Mark{"BZh"sv, FileForm::bzip2},
    Mark{"\x04\x22\x4D\x18"sv, FileForm::lz4},
    Mark{"PK\x03\x04"sv, FileForm::zip},
    Mark{"\xFF\xFE"sv, FileForm::utf16},
    Mark{"\xFE\xFF"sv, FileForm::utf16},
    Mark{"#\0 \0"sv, FileForm::utf16},
    Mark{"\0#\0 "sv, FileForm::utf16},
    Mark{"(\0"sv, FileForm::utf16},
    Mark{"\0("sv, FileForm::utf16},
};

}  // namespace

FileForm form_of(std::string_view beginning) {
  if (is_zstd(beginning)) return FileForm::zstd;
  for (const Mark& mark : marks) {
    if (beginning.starts_with(mark.bytes)) return mark.form;
  }
  return FileForm::text;
}

Error not_a_recording(const std::string& name, FileForm form) {
  const auto error = [&name](const char* reason, const char* fix) {
    return Error(ErrorKind::data, name, reason, fix);
  };
  switch (form) {
    case FileForm::pcap:
      return error("is a capture of packets, not a recording",
                   "convert the capture: r4 convert CAPTURE -o FILE.r4log");
    case FileForm::mcap:
      return error("is an MCAP file, not a recording in the native format",
                   "convert the file: r4 convert FILE.mcap -o FILE.r4log");
    case FileForm::gzip:
      return error("is compressed by gzip", "unpack the file first: gzip -dk FILE.gz");
    case FileForm::xz:
      return error("is compressed by xz", "unpack the file first: xz -dk FILE.xz");
    case FileForm::bzip2:
      return error("is compressed by bzip2", "unpack the file first: bzip2 -dk FILE.bz2");
    case FileForm::lz4:
      return error("is compressed by lz4", "unpack the file first: lz4 -d FILE.lz4");
    case FileForm::zip:
      return error("is a zip archive", "unpack the file first: unzip FILE.zip");
    case FileForm::utf16:
      return error("is text in UTF-16",
                   "convert the file to UTF-8: iconv -f UTF-16 -t UTF-8 FILE -o NEW");
    case FileForm::zstd:
    case FileForm::text:
      break;
  }
  return error(
      "is not a recording",
      "make a recording with r4 record URL -o FILE, or convert a log of candump with r4 convert");
}

}  // namespace r4
