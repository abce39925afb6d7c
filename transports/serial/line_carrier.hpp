// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams as lines on a tty: the common part of serial_carrier.cpp and pty_carrier.cpp. Each line
// is one write; a line taken in part is completed first. Waiting lines keep the order of SendQueue.
// Reads at most 4096 bytes a turn. The carrier is up while the stream is open.
#pragma once

#include <array>
#include <asio/error_code.hpp>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

#include "../file_descriptor.hpp"
#include "../framing/line_framing.hpp"
#include "../operation_slot.hpp"
#include "../send_queue.hpp"
#include "../writable_wait.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

// More than 15 data members: the stream with its waits, the line in progress, the search timer.
class LineCarrier : public Carrier {
 public:
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer) override;
  bool up() const override { return stream_.is_open(); }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 protected:
  LineCarrier(asio::io_context& io, std::string name, std::chrono::milliseconds look_interval);

  // Looks for the device, and starts the stream if the device exists.
  virtual void look() = 0;
  // The stream has ended. `error`: errno, or 0 for an end of file. Returns the problem to report.
  virtual Problem on_lost(int error) = 0;
  // For a stream that `asks`: true if this program may read. Otherwise the end closes the carrier.
  virtual bool may_read() { return true; }
  // A state is about to be sent. Called within send().
  virtual void before_state() {}
  // The system has taken that many bytes. Called within send().
  virtual void on_written(std::size_t) {}

  // Begins to receive from the descriptor, which must not block. `asks`: may_read() is called
  // before each read. Throws Error about `thing` if the loop cannot wait for the stream.
  void start(FileDescriptor descriptor, const std::string& thing, bool asks = false);
  void report_up();
  void look_later();
  // Written bytes were discarded on their way, so the next line begins with a terminator.
  void restart_line();

  asio::io_context& io_;
  std::string name_;
  Handler* handler_ = nullptr;
  CarrierCounters counters_;

 private:
  enum class Outcome { written, busy, failed };

  void stop() noexcept;
  void begin_to_receive();
  void ask_and_read();
  void receive(const asio::error_code& error, std::size_t size);
  void lost(int error);
  Outcome write_line(std::string_view bytes);
  Outcome continue_line();
  void send_waiting();

  const std::chrono::milliseconds look_interval_;
  LoopTimer timer_;
  OperationSlot looking_;
  LoopDescriptor stream_;
  OperationSlot readable_;
  OperationSlot failure_;
  WritableWait writable_;
  bool asks_ = false;
  LineFraming framing_;
  SendQueue queue_;
  std::array<char, 4096> received_;

  std::array<char, 2 * line_end.size() + max_datagram> line_;
  std::size_t line_size_ = 0;
  std::size_t line_written_ = 0;
  bool terminator_first_ = false;
};

}  // namespace r4
