// SPDX-License-Identifier: GPL-3.0-or-later
// The form of a file, by its first bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "../config.hpp"
#include "../error.hpp"

namespace r4 {

enum class FileForm : std::uint8_t {
  text,  // text, and unknown forms
  zstd,  // also with skippable frames first
  pcap,  // or pcapng
  mcap,
  gzip,
  xz,
  bzip2,
  lz4,
  zip,
  utf16,
};

// This many bytes distinguish all forms.
constexpr std::size_t form_bytes = 8;

R4LINK_API FileForm form_of(std::string_view beginning);

// The byte order mark that some editors write before UTF-8.
constexpr std::string_view utf8_mark = "\xEF\xBB\xBF";

// An error that names the form, and how to make a recording from it.
R4LINK_API Error not_a_recording(const std::string& name, FileForm form);

}  // namespace r4
