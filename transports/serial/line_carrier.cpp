// SPDX-License-Identifier: GPL-3.0-or-later
#include "line_carrier.hpp"

#include <unistd.h>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <asio/post.hpp>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

namespace r4 {
namespace {

constexpr std::size_t normal_entries = 64;
constexpr std::size_t state_entries = 1;

bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

}  // namespace

LineCarrier::LineCarrier(asio::io_context& io, std::string name,
                         std::chrono::milliseconds look_interval)
    : io_(io),
      name_(std::move(name)),
      look_interval_(look_interval),
      timer_(io),
      stream_(io),
      writable_(io),
      queue_(normal_entries, state_entries, counters_.tx_dropped) {}

void LineCarrier::start(FileDescriptor descriptor, const std::string& thing, bool asks) {
  stop();
  asks_ = asks;
  with_system_errors(thing, [&] { stream_.assign(descriptor.get()); });
  (void)descriptor.release();
  framing_.reset();
  line_size_ = line_written_ = 0;
  terminator_first_ = false;
  begin_to_receive();
}

void LineCarrier::report_up() {
  ++counters_.ups;
  handler_->on_carrier_event({CarrierEvent::Kind::up, Problem{ErrorKind::open, name_, "", ""}});
}

void LineCarrier::look_later() {
  timer_.expires_after(look_interval_);
  timer_.async_wait(looking_.handler([this] { look(); }));
}

void LineCarrier::close() noexcept {
  handler_ = nullptr;
  looking_.cancel();
  stop();
}

void LineCarrier::stop() noexcept {
  readable_.cancel();
  failure_.cancel();
  writable_.stop();
  queue_.clear();
  asio::error_code ignored;
  stream_.close(ignored);
}

// Asio reads once before it waits, which on a tty costs half as much as arming a wait. When a
// stopped program continues, a stream that `asks` must not be read before may_read().
void LineCarrier::begin_to_receive() {
  if (asks_) {
    stream_.async_wait(asio::posix::descriptor_base::wait_read,
                       readable_.handler([this] { ask_and_read(); }));
    return;
  }
  stream_.async_read_some(asio::buffer(received_),
                          readable_.handler([this](const asio::error_code& error,
                                                   std::size_t size) { receive(error, size); }));
}

void LineCarrier::ask_and_read() {
  if (!may_read()) return;
  const ssize_t size = ::read(stream_.native_handle(), received_.data(), received_.size());
  if (size < 0 && would_block(errno)) return begin_to_receive();
  if (size <= 0) return lost(size == 0 ? 0 : errno);
  receive({}, static_cast<std::size_t>(size));
}

void LineCarrier::receive(const asio::error_code& error, std::size_t size) {
  if (error) return lost(error == asio::error::eof ? 0 : error.value());
  const auto take = [this](Text line) {
    if (!stream_.is_open()) return;  // the handler of an earlier line closed it
    ++counters_.rx_datagrams;
    counters_.rx_bytes += line.size();
    handler_->on_datagram({line.data(), line.size()}, everyone);
  };
  framing_.push(received_.data(), size, take, [this](Text beginning) {
    if (stream_.is_open()) handler_->on_oversize({beginning.data(), beginning.size()});
  });
  counters_.rx_oversize = framing_.oversize();
  // The system hands a backlog over in pieces of up to 4095 bytes.
  if (stream_.is_open() && size < received_.size() / 2) handler_->on_drained();
  if (stream_.is_open()) begin_to_receive();
}

void LineCarrier::lost(int error) {
  stop();
  ++counters_.downs;
  const Problem problem = on_lost(error);
  look_later();
  handler_->on_carrier_event({CarrierEvent::Kind::down, problem});
}

SendResult LineCarrier::send(std::string_view bytes, Priority priority, Peer) {
  if (!stream_.is_open()) return SendResult::down;
  if (bytes.size() > max_datagram) {
    ++counters_.tx_errors;
    return SendResult::full;
  }
  if (priority == Priority::state) before_state();
  if (line_written_ == line_size_ && queue_.empty()) {
    const Outcome outcome = write_line(bytes);
    if (outcome != Outcome::busy) {
      return outcome == Outcome::written ? SendResult::sent : SendResult::down;
    }
  }
  const SendResult result =
      queue_.push(bytes, priority, everyone, std::chrono::steady_clock::now());
  writable_.start(stream_.native_handle(), [this] { send_waiting(); });
  return result;
}

void LineCarrier::restart_line() {
  line_size_ = line_written_ = 0;
  terminator_first_ = true;
  if (!queue_.empty()) send_waiting();
}

// Begins a line. Returns `written` also if the system took only a part of it.
LineCarrier::Outcome LineCarrier::write_line(std::string_view bytes) {
  std::size_t size = 0;
  const auto append = [&](const char* data, std::size_t count) {
    std::memcpy(line_.data() + size, data, count);
    size += count;
  };
  if (terminator_first_) append(line_end.data(), line_end.size());
  append(bytes.data(), bytes.size());
  append(line_end.data(), line_end.size());
  line_size_ = size;
  line_written_ = 0;
  const Outcome outcome = continue_line();
  if (line_written_ == 0) {
    line_size_ = 0;
    return outcome;
  }
  terminator_first_ = false;
  ++counters_.tx_datagrams;
  counters_.tx_bytes += bytes.size();
  if (outcome == Outcome::busy) {
    writable_.start(stream_.native_handle(), [this] { send_waiting(); });
  }
  return Outcome::written;
}

LineCarrier::Outcome LineCarrier::continue_line() {
  while (line_written_ != line_size_) {
    const ssize_t count =
        ::write(stream_.native_handle(), line_.data() + line_written_, line_size_ - line_written_);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && would_block(errno)) return Outcome::busy;
    if (count < 0) {
      ++counters_.tx_errors;
      asio::post(io_, failure_.handler([this, error = errno] { lost(error); }));
      return Outcome::failed;
    }
    line_written_ += static_cast<std::size_t>(count);
    on_written(static_cast<std::size_t>(count));
    if (line_written_ != line_size_) return Outcome::busy;
  }
  return Outcome::written;
}

void LineCarrier::send_waiting() {
  Outcome outcome = continue_line();
  while (outcome == Outcome::written && line_written_ == line_size_) {
    const SendQueue::Entry* const entry = queue_.front(std::chrono::steady_clock::now());
    if (entry == nullptr) return writable_.stop();
    outcome = write_line(entry->text());
    if (outcome == Outcome::written) queue_.pop();
  }
  if (outcome != Outcome::failed) {
    writable_.start(stream_.native_handle(), [this] { send_waiting(); });
  }
}

}  // namespace r4
