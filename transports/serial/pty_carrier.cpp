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
#include "../operation_slot.hpp"
#include "line_stream.hpp"
#include "unread_marks.hpp"

namespace r4 {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds look_for_host{20};
constexpr std::chrono::milliseconds stale{30};
// Up to 4095 unread bytes lie where they can be counted, the others before that.
constexpr int countable_bytes = 3500;
constexpr std::size_t all_bytes = 4096 + 20480;

// A link that a board left behind, or that of another board: into /dev/pts, or to nowhere.
bool is_our_kind(const std::filesystem::path& link) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::read_symlink(link, error);
  return !error && (target.parent_path() == "/dev/pts" || !std::filesystem::exists(link, error));
}

class PtyCarrier final : public Carrier, public BoardEnd, private LineStream::Owner {
 public:
  PtyCarrier(asio::io_context& io, Url url);
  ~PtyCarrier() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer) override {
    return stream_.send(bytes, priority);
  }
  bool is_own_cable() const override { return true; }
  bool up() const override { return up_; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 private:
  void on_line(std::string_view line) override { handler_->on_datagram(line, everyone); }
  void on_oversize(std::string_view beginning) override { handler_->on_oversize(beginning); }
  void on_drained() override { handler_->on_drained(); }
  void on_lost(int error) override;
  void before_state() override;
  void on_written(std::size_t bytes) override { unread_.wrote(bytes, Clock::now()); }

  void make_link();
  FileDescriptor open_other_end() const;
  void look_later();
  void look();

  const Url url_;
  std::string name_;
  std::string device_;  // "/dev/pts/5"
  bool linked_ = false;
  std::string obstacle_;  // why a host that is there cannot be heard
  LoopTimer timer_;
  OperationSlot looking_;
  FileDescriptor master_;
  UnreadMarks unread_;
  Handler* handler_ = nullptr;
  bool up_ = false;
  CarrierCounters counters_;
  LineStream stream_;
};

PtyCarrier::PtyCarrier(asio::io_context& io, Url url)
    : url_(std::move(url)), name_(url_.text()), timer_(io), stream_(io, *this, counters_) {
  url_.allow_only("");
  if (!url_.host().empty()) {
    throw Error(ErrorKind::usage, url_.text(), "it is not pty: or pty:PATH",
                "write it as in pty:/tmp/r4");
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
    // ENOSPC: there are as many pseudo-terminals as there may be (kernel.pty.max).
    const auto problem = out_of_resources(url_.text(), error == ENOSPC ? 0 : error);
    if (problem) throw Error(*problem);
    throw Error(ErrorKind::open, url_.text(),
                std::string("no pseudo-terminal is to be had: ") + std::strerror(error),
                "see that /dev/ptmx and /dev/pts are there");
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
  open_other_end().reset();  // until it has been open once, nothing tells that it is closed
  look_later();
}

void PtyCarrier::make_link() {
  namespace fs = std::filesystem;
  if (url_.path().empty()) return;
  const fs::path link(url_.path());
  std::error_code error;
  const fs::file_status status = fs::symlink_status(link, error);
  if (fs::exists(status) && !is_our_kind(link)) {
    throw Error(ErrorKind::open, url_.text(), link.string() + " is there and leads to no pty",
                "give another path, or remove it");
  }
  // Made aside and moved there: at no moment is the path without a link.
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
                "give a path in a folder of yours");
  }
  linked_ = true;
}

void PtyCarrier::close() noexcept {
  handler_ = nullptr;
  up_ = false;
  looking_.cancel();
  stream_.stop();
  master_.reset();
  unread_.clear();
  if (std::exchange(linked_, false)) {
    // Another board may have taken the link over.
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

// The system tells when a host closes its end, not when one opens it.
void PtyCarrier::look_later() {
  timer_.expires_after(look_for_host);
  timer_.async_wait(looking_.handler([this] { look(); }));
}

void PtyCarrier::look() {
  pollfd state{master_.get(), POLLIN, 0};
  ::poll(&state, 1, 0);
  FileDescriptor stream;
  if ((state.revents & POLLHUP) == 0) {
    stream.reset(::fcntl(master_.get(), F_DUPFD_CLOEXEC, 0));
  }
  if (!stream) return look_later();
  // A line may have been under way when the last host went.
  if (const FileDescriptor other = open_other_end()) ::tcflush(other.get(), TCIFLUSH);
  unread_.clear();
  try {
    stream_.start(std::move(stream), name_);
  } catch (const Error& error) {
    look_later();
    if (std::exchange(obstacle_, error.what()) != error.what()) {
      handler_->on_carrier_event({CarrierEvent::Kind::warning, error.problem()});
    }
    return;
  }
  obstacle_.clear();
  up_ = true;
  ++counters_.ups;
  handler_->on_carrier_event({CarrierEvent::Kind::up, Problem{ErrorKind::open, name_, "", ""}});
}

void PtyCarrier::on_lost(int) {
  up_ = false;
  ++counters_.downs;
  look_later();
  handler_->on_carrier_event(
      {CarrierEvent::Kind::down, Problem{ErrorKind::open, name_, "no host has it open",
                                         "open it at the host: serial://" + device_}});
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
  stream_.restart_line();
}

}  // namespace

std::unique_ptr<Carrier> make_pty_carrier(asio::io_context& io, const Url& url, Role role) {
  if (role == Role::host) {
    throw Error(ErrorKind::usage, url.text(), "pty is the board's end",
                "a host opens the other end: serial:///dev/pts/N");
  }
  return std::make_unique<PtyCarrier>(io, url);
}

}  // namespace r4
