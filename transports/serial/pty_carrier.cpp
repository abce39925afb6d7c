// SPDX-License-Identifier: GPL-3.0-or-later
#include "pty_carrier.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>

#include "../board_end.hpp"
#include "../file_descriptor.hpp"
#include "line_carrier.hpp"
#include "unread_marks.hpp"

namespace r4 {
namespace {

using Clock = std::chrono::steady_clock;

// The system reports when a host closes its end, but not when a host opens it.
constexpr std::chrono::milliseconds look_for_host{20};
constexpr std::chrono::milliseconds stale{30};
// The kernel counts up to 4095 unread bytes of a pty; further bytes wait in an earlier buffer.
constexpr int countable_bytes = 3500;
constexpr std::size_t all_bytes = 4096 + 20480;

// True for a link of a board: its target is in /dev/pts, or missing.
bool is_our_kind(const std::filesystem::path& link) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::read_symlink(link, error);
  return !error && (target.parent_path() == "/dev/pts" || !std::filesystem::exists(link, error));
}

class PtyCarrier final : public LineCarrier, public BoardEnd {
 public:
  PtyCarrier(asio::io_context& io, Url url);
  ~PtyCarrier() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;
  bool is_own_cable() const override { return true; }

 private:
  void look() override;
  Problem on_lost(int error) override;
  void before_state() override;
  void on_written(std::size_t bytes) override { unread_.wrote(bytes, Clock::now()); }

  void make_link();
  FileDescriptor open_other_end() const;

  const Url url_;
  std::string device_;  // "/dev/pts/5"
  bool linked_ = false;
  std::string obstacle_;  // why the datagrams of a host cannot be received
  FileDescriptor master_;
  UnreadMarks unread_;
};

PtyCarrier::PtyCarrier(asio::io_context& io, Url url)
    : LineCarrier(io, url.text(), look_for_host), url_(std::move(url)) {
  url_.allow_only("");
  if (!url_.host().empty()) {
    throw Error(ErrorKind::usage, url_.text(), "the URL is not pty: or pty:PATH",
                "write a URL such as pty:/tmp/r4");
  }
}

void PtyCarrier::open(Handler& handler) {
  close();
  master_.reset(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  std::array<char, 64> device{};
  termios settings{};
  bool made = master_ && ::grantpt(master_.get()) == 0 && ::unlockpt(master_.get()) == 0 &&
              ::ptsname_r(master_.get(), device.data(), device.size()) == 0 &&
              ::tcgetattr(master_.get(), &settings) == 0;
  if (made) {
    ::cfmakeraw(&settings);
    made = ::tcsetattr(master_.get(), TCSANOW, &settings) == 0;
  }
  if (!made) {
    const int error = errno;
    master_.reset();
    // ENOSPC: the limit of pseudo-terminals is reached (kernel.pty.max).
    const auto problem = out_of_resources(url_.text(), error == ENOSPC ? 0 : error);
    if (problem) throw Error(*problem);
    throw Error(ErrorKind::open, url_.text(),
                std::string("a pseudo-terminal cannot be opened: ") + std::strerror(error),
                "check that /dev/ptmx and /dev/pts exist");
  }
  device_ = device.data();
  try {
    make_link();
  } catch (...) {
    master_.reset();
    throw;
  }
  name_ = "pty:" + (url_.path().empty() ? device_ : url_.path());
  handler_ = &handler;
  open_other_end().reset();  // the system reports a closed end only after it was open once
  look_later();
}

void PtyCarrier::make_link() {
  namespace fs = std::filesystem;
  if (url_.path().empty()) return;
  const fs::path link(url_.path());
  std::error_code error;
  const fs::file_status status = fs::symlink_status(link, error);
  if (fs::exists(status) && !is_our_kind(link)) {
    throw Error(ErrorKind::open, url_.text(), link.string() + " exists and is not a link to a pty",
                "give another path, or remove that file");
  }
  // The new link replaces an old link in one step, so the path always has a link.
  const fs::path fresh = fmt::format("{}.{}", link.string(), ::getpid());
  fs::create_symlink(device_, fresh, error);
  if (!error) {
    fs::rename(fresh, link, error);
    std::error_code ignored;
    if (error) fs::remove(fresh, ignored);
  }
  if (error) {
    throw Error(error == std::errc::permission_denied ? ErrorKind::permission : ErrorKind::open,
                url_.text(), "the link cannot be made: " + error.message(),
                "give a path in a folder that you may write to");
  }
  linked_ = true;
}

void PtyCarrier::close() noexcept {
  LineCarrier::close();
  master_.reset();
  unread_.clear();
  if (std::exchange(linked_, false)) {
    // The link may belong to another board by now.
    std::error_code error;
    if (std::filesystem::read_symlink(url_.path(), error) == device_ && !error) {
      std::filesystem::remove(url_.path(), error);
    }
  }
}

FileDescriptor PtyCarrier::open_other_end() const {
  return FileDescriptor(
      ::ioctl(master_.get(), TIOCGPTPEER, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
}

void PtyCarrier::look() {
  pollfd state{master_.get(), POLLIN, 0};
  ::poll(&state, 1, 0);
  FileDescriptor stream;
  if ((state.revents & POLLHUP) == 0) {
    stream.reset(::fcntl(master_.get(), F_DUPFD_CLOEXEC, 0));
  }
  if (!stream) return look_later();
  // The last host may have left the rest of a line unread.
  if (const FileDescriptor other = open_other_end()) ::tcflush(other.get(), TCIFLUSH);
  unread_.clear();
  try {
    start(std::move(stream), name_);
  } catch (const Error& error) {
    look_later();
    if (std::exchange(obstacle_, error.what()) != error.what()) {
      handler_->on_carrier_event({CarrierEvent::Kind::warning, error.problem()});
    }
    return;
  }
  obstacle_.clear();
  report_up();
}

Problem PtyCarrier::on_lost(int) {
  return {ErrorKind::open, name_, "a host has not opened the pty",
          "open this URL at the host: serial://" + device_};
}

void PtyCarrier::before_state() {
  if (!unread_.any()) return;
  const Clock::time_point now = Clock::now();
  if (now - unread_.oldest() < stale) return;
  const FileDescriptor other = open_other_end();
  int unread = 0;
  if (!other || ::ioctl(other.get(), FIONREAD, &unread) != 0) return unread_.clear();
  unread_.unread_at_most(unread < countable_bytes ? static_cast<std::size_t>(unread) : all_bytes);
  if (!unread_.any() || now - unread_.oldest() < stale) return;
  ::tcflush(other.get(), TCIFLUSH);
  unread_.clear();
  ++counters_.tx_dropped;
  restart_line();
}

}  // namespace

std::unique_ptr<Carrier> make_pty_carrier(asio::io_context& io, const Url& url, Role role,
                                          const Claim&) {
  if (role == Role::host) {
    throw Error(ErrorKind::usage, url.text(), "pty: is the board's end",
                "open the other end at the host: serial:///dev/pts/N");
  }
  return std::make_unique<PtyCarrier>(io, url);
}

}  // namespace r4
