// SPDX-License-Identifier: GPL-3.0-or-later
#include "text_file.hpp"

#include <cerrno>
#include <fstream>
#include <system_error>

#include "r4link/error.hpp"

namespace r4 {

std::string read_text_file(const std::string& path, std::size_t most, const char* fix) {
  std::string text(most + 1, '\0');
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (file) file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad() || (file.fail() && !file.eof())) {
    const int why = errno == 0 ? EIO : errno;
    throw Error(why == EACCES ? ErrorKind::permission : ErrorKind::open, path,
                std::generic_category().message(why), fix);
  }
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

}  // namespace r4
