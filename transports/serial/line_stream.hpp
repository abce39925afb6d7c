// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams as lines on an open byte stream (a tty): what serial and pty have in common.
//
// One write a line; a line that the system takes in part is continued and never interleaved. What
// must wait keeps the order of SendQueue: stop behind the line in progress, then normal, then the
// newest state. Reads at most 4096 bytes a turn. The stream's end is told once, by on_lost().
#pragma once

#include <array>
#include <asio/error_code.hpp>
#include <asio/io_context.hpp>
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

class LineStream {
 public:
  // Called from the event loop, but before_state() and on_written() from within send().
  class Owner {
   public:
    virtual void on_line(std::string_view line) = 0;
    // The beginning of a line that is too long: it is thrown away.
    virtual void on_oversize(std::string_view beginning) = 0;
    virtual void on_drained() = 0;
    // The stream has ended and is closed: errno, or 0 for an end of file.
    virtual void on_lost(int error) = 0;
    // Of a stream that asks: is what has come ours to read? If not, the owner stops the stream.
    virtual bool may_read() { return true; }
    // A state is about to be sent.
    virtual void before_state() {}
    // The system has taken that many bytes.
    virtual void on_written(std::size_t) {}

   protected:
    ~Owner() = default;
  };

  LineStream(asio::io_context& io, Owner& owner, CarrierCounters& counters);
  ~LineStream() { stop(); }

  // Begins to receive. The descriptor must not block. `asks`: the owner, before each reading. Throws Error about `thing`
  // if the system does not let the loop wait for it.
  void start(FileDescriptor descriptor, const std::string& thing, bool asks = false);
  // Closes it and drops what waits.
  void stop() noexcept;

  SendResult send(std::string_view bytes, Priority priority);

  // What was written has been thrown away on its way: the next line begins with a terminator.
  void restart_line();

 private:
  enum class Outcome { written, busy, failed };

  void begin_to_receive();
  void ask_and_read();
  void receive(const asio::error_code& error, std::size_t size);
  void lost(int error);
  Outcome write_line(std::string_view bytes);
  Outcome continue_line();
  void send_waiting();

  asio::io_context& io_;
  Owner& owner_;
  CarrierCounters& counters_;
  LoopDescriptor stream_;
  OperationSlot readable_;
  OperationSlot failure_;
  WritableWait writable_;
  bool asks_ = false;
  LineFraming framing_;
  SendQueue queue_;
  std::array<char, 4096> received_;

  // The line in progress: line_[line_written_, line_size_) is still to be written.
  std::array<char, 2 * line_end.size() + max_datagram> line_;
  std::size_t line_size_ = 0;
  std::size_t line_written_ = 0;
  bool terminator_first_ = false;
};

}  // namespace r4
