// SPDX-License-Identifier: GPL-3.0-or-later
#include "recording_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "../../protocol/datagram/numbers.hpp"
#include "r4link/error.hpp"

namespace r4 {
namespace {

constexpr std::uint64_t least_kept = 1 << 20;
constexpr std::uint64_t least_parts = 4;  // keep_bytes has room for at least four files

// Position of the file's number, which precedes the ending of the format.
std::size_t ending_of(std::string_view path) {
  for (const std::string_view ending : {".r4log.zst", ".r4log", ".zst"}) {
    if (path.ends_with(ending)) return path.size() - ending.size();
  }
  const std::size_t slash = path.rfind('/');
  const std::size_t dot = path.rfind('.');
  const bool has_one = dot != std::string_view::npos && dot != 0 &&
                       (slash == std::string_view::npos || dot > slash + 1);
  return has_one ? dot : path.size();
}

bool has_limits(const RecordingOptions& options) {
  return options.rotate_bytes != 0 || options.rotate_after.count() != 0 || options.keep_bytes != 0;
}

void require_limits(const RecordingOptions& options) {
  if (options.rotate_after.count() < 0) {
    throw Error(ErrorKind::usage, "rotate_after", "is negative", "give 1 s or more");
  }
  if (options.keep_bytes == 0) return;
  if (options.keep_bytes < least_kept) {
    throw Error(ErrorKind::usage, fmt::format("keep {}", options.keep_bytes), "is too little",
                "keep 1M or more");
  }
  if (options.rotate_bytes > options.keep_bytes / least_parts) {
    throw Error(ErrorKind::usage, fmt::format("keep {}", options.keep_bytes),
                "the limit is too small for the size of the files",
                "keep at least four times the size of a file");
  }
}

}  // namespace

RecordingParts::RecordingParts(const std::string& path, RecordingOptions options)
    : stem_(std::filesystem::absolute(path.substr(0, ending_of(path)))),
      ending_(path.substr(ending_of(path))),
      options_(options),
      most_bytes_(options.rotate_bytes != 0 ? options.rotate_bytes
                                            : options.keep_bytes / least_parts) {
  require_limits(options);
}

std::string RecordingParts::next() {
  if (!has_limits(options_)) return stem_ + ending_;
  if (number_ == 0) {
    const std::vector<Part> parts = found();
    if (!parts.empty()) number_ = parts.back().number;
  }
  return fmt::format("{}-{:05}{}", stem_, ++number_, ending_);
}

std::vector<RecordingParts::Part> RecordingParts::found() const {
  namespace fs = std::filesystem;
  std::vector<Part> parts;
  // A folder that cannot be listed counts as empty. Opening a file in it reports the reason.
  std::error_code error;
  const fs::path stem(stem_);
  const std::string prefix = stem.filename().string() + "-";
  const std::size_t around = prefix.size() + ending_.size();
  for (fs::directory_iterator at(stem.parent_path(), error), end; !error && at != end;
       at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(prefix) || !name.ends_with(ending_) || name.size() < around + 5) continue;
    std::uint64_t number = 0;
    if (!parse_number(Text(name).substr(prefix.size(), name.size() - around), number)) continue;
    std::error_code gone;
    const std::uintmax_t size =
        fs::is_regular_file(at->path(), gone) ? fs::file_size(at->path(), gone) : 0;
    if (!gone) parts.push_back({number, size, at->path().string()});
  }
  std::sort(parts.begin(), parts.end(),
            [](const Part& a, const Part& b) { return a.number < b.number; });
  return parts;
}

void RecordingParts::make_room() {
  if (options_.keep_bytes == 0) return;
  const std::vector<Part> parts = found();
  std::uint64_t sum = most_bytes_;  // room for the next file
  for (const Part& part : parts) sum += part.size;
  for (const Part& part : parts) {
    if (sum <= options_.keep_bytes) return;
    std::error_code error;
    std::filesystem::remove(part.path, error);
    if (error) {
      throw Error(ErrorKind::open, part.path, "cannot be removed: " + error.message(),
                  "remove the file, or record in another folder");
    }
    sum -= part.size;
  }
}

}  // namespace r4
