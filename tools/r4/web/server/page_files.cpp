// SPDX-License-Identifier: GPL-3.0-or-later
#include "page_files.hpp"

#include <fmt/format.h>
#include <libdeflate.h>

#include <filesystem>
#include <fstream>
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
  constexpr std::size_t largest = 4 << 20;
  if (!path.starts_with('/') || path.starts_with("/.") ||
      path.find('/', 1) != std::string_view::npos) {
    return std::nullopt;
  }
  const std::string name = folder + std::string(path);
  std::error_code error;
  // Opening a named pipe would wait for a program that writes into it.
  if (!std::filesystem::is_regular_file(name, error)) return std::nullopt;
  const auto size = std::filesystem::file_size(name, error);
  if (error || size > largest) return std::nullopt;
  std::string content(size, '\0');
  std::ifstream file(name, std::ios::binary);
  file.read(content.data(), static_cast<std::streamsize>(size));
  if (!file.is_open() || file.bad()) return std::nullopt;
  content.resize(static_cast<std::size_t>(file.gcount()));  // it may have become shorter meanwhile
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
