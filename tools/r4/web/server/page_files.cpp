// SPDX-License-Identifier: GPL-3.0-or-later
#include "page_files.hpp"

#include <fmt/format.h>
#include <libdeflate.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <system_error>

namespace r4::tool::web {
namespace {

std::string type_of(std::string_view name) {
  if (name.ends_with(".html")) return "text/html; charset=utf-8";
  if (name.ends_with(".js")) return "text/javascript; charset=utf-8";
  if (name.ends_with(".css")) return "text/css; charset=utf-8";
  if (name.ends_with(".svg")) return "image/svg+xml";
  return "application/octet-stream";
}

std::string gzip(std::string_view content) {
  constexpr int level = 6;
  const std::unique_ptr<libdeflate_compressor, void (*)(libdeflate_compressor*)> compressor(
      libdeflate_alloc_compressor(level), libdeflate_free_compressor);
  std::string out(libdeflate_gzip_compress_bound(compressor.get(), content.size()), '\0');
  out.resize(libdeflate_gzip_compress(compressor.get(), content.data(), content.size(), out.data(),
                                      out.size()));
  return out;
}

}  // namespace

PageFile page_file(std::string_view name, std::string_view content) {
  return {type_of(name),
          fmt::format("\"{:08x}-{}\"", libdeflate_crc32(0, content.data(), content.size()),
                      content.size()),
          std::string(content), gzip(content)};
}

std::optional<PageFile> page_file_in(const std::string& folder, std::string_view path) {
  constexpr std::uintmax_t largest = 4 << 20;
  if (!path.starts_with('/') || path.starts_with("/.") ||
      path.find('/', 1) != std::string_view::npos) {
    return std::nullopt;
  }
  const std::filesystem::path file = folder + std::string(path);
  std::error_code error;
  // Reading a named pipe would block.
  if (!is_regular_file(file, error) || file_size(file, error) > largest) return std::nullopt;
  std::ifstream stream(file, std::ios::binary);
  std::string content(std::istreambuf_iterator<char>(stream), {});
  if (!stream) return std::nullopt;
  return page_file(path, content);
}

PageFiles page_files() {
  PageFiles files;
  for (int i = 0; i < embedded_file_count; ++i) {
    const EmbeddedFile& each = embedded_files[i];
    files.emplace("/" + std::string(each.name), page_file(each.name, each.content));
  }
  return files;
}

}  // namespace r4::tool::web
