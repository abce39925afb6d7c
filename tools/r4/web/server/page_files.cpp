// SPDX-License-Identifier: GPL-3.0-or-later
#include "page_files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <libdeflate.h>
#include <sys/stat.h>
#include <unistd.h>

#include <memory>

#include "protocol/datagram/crc32.hpp"
#include "r4link/text.hpp"
#include "transports/file_descriptor.hpp"

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
  return {type_of(name), fmt::format("\"{:08x}-{}\"", crc32(Text(content)), content.size()),
          std::string(content), gzip(content)};
}

std::optional<PageFile> page_file_in(const std::string& folder, std::string_view path) {
  constexpr off_t largest = 4 << 20;
  if (!path.starts_with('/') || path.starts_with("/.") ||
      path.find('/', 1) != std::string_view::npos) {
    return std::nullopt;
  }
  // O_NONBLOCK: a named pipe would wait for somebody who writes into it.
  const FileDescriptor file(
      ::open((folder + std::string(path)).c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK));
  struct stat status {};
  if (!file || ::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode) ||
      status.st_size > largest) {
    return std::nullopt;
  }
  std::string content(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t size = 0;
  while (size < content.size()) {
    const ssize_t n = ::read(file.get(), content.data() + size, content.size() - size);
    if (n < 0) return std::nullopt;
    if (n == 0) break;  // it has become shorter meanwhile
    size += static_cast<std::size_t>(n);
  }
  content.resize(size);
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
