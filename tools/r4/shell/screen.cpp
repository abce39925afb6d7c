// SPDX-License-Identifier: GPL-3.0-or-later
#include "screen.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

#include "json.hpp"

namespace r4::tool {
namespace {

winsize terminal_size() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) size.ws_col = 80;
  if (size.ws_row == 0) size.ws_row = 24;
  return size;
}

}  // namespace

bool Screen::has_room() {
  pollfd out{STDOUT_FILENO, POLLOUT, 0};
  return ::poll(&out, 1, 0) != 0;
}

Screen::~Screen() {
  if (begun_) print_raw("\x1b[?25h");
}

std::size_t Screen::columns() { return terminal_size().ws_col; }

void Screen::draw(std::vector<std::string> lines) {
  const winsize size = terminal_size();
  lines.resize(std::min<std::size_t>(lines.size(), size.ws_row - 1U));
  std::string frame = begun_ ? "" : "\x1b[?25l";
  begun_ = true;
  if (drawn_ > 0) frame += fmt::format("\x1b[{}A", drawn_);
  for (std::string& line : lines) {
    line = printable(line);
    if (line.size() > size.ws_col) line.resize(size.ws_col);
    while (printable(line) != line) line.pop_back();  // a truncated UTF-8 character
    frame += "\r" + line + "\x1b[K\n";
  }
  frame += "\x1b[J";
  drawn_ = lines.size();
  print_raw(frame);
}

}  // namespace r4::tool
